"""Network namespaces: hosts of their own with their own interfaces, where this machine lets a test make them.

Run as a program it is one such host: `python -m tests.rtps_net.namespaces MODULE:FUNCTION` calls the function.
"""

import importlib
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TIME_LIMIT = 30
_UNSHARE = ("unshare", "--user", "--map-root-user", "--net")


@cache
def _why_not() -> str:
    for tool in ("unshare", "ip", "nsenter"):
        if shutil.which(tool) is None:
            return f"no program {tool} here"
    probe = "ip link set lo up && ip link add veth0 type veth peer name veth1"
    done = subprocess.run(
        [*_UNSHARE, "sh", "-c", probe], capture_output=True, text=True, timeout=TIME_LIMIT, check=False
    )
    return "" if done.returncode == 0 else f"no network namespace can be made here ({done.stderr.strip()})"


def require_namespaces() -> None:
    """Skips the test, and says why, where no namespace can be made."""
    if why := _why_not():
        pytest.skip(why)


def run(function: str, *arguments: str) -> None:
    """Calls `module:function` in a new namespace, where only an idle loopback is; fails as it does."""
    require_namespaces()
    done = subprocess.run(
        [*_UNSHARE, sys.executable, "-W", "error", "-m", "tests.rtps_net.namespaces", function, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=TIME_LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def ip(*words: str) -> None:
    """The program ip, inside."""
    subprocess.run(["ip", *" ".join(words).split()], check=True, timeout=TIME_LIMIT)


def main() -> None:
    """Called in the namespace."""
    module, _, function = sys.argv[1].partition(":")
    getattr(importlib.import_module(module), function)(*sys.argv[2:])


if __name__ == "__main__":
    main()
