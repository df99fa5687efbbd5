"""Real ROS 1, from Debian: a master and rospy processes that tests command.

Debian's packages live in ``/usr/lib/python3/dist-packages``, where a virtual environment does not look. So each peer is
a process of ``/usr/bin/python3`` that speaks JSON lines, as the DDS peers do (`tests/dds/peers.py`). `tools/setup.sh`
names the packages; where they are not installed the tests are skipped and say so, under ``CI=true`` they fail.

    with Master() as master, master.peer("talker") as ros:
        talker = ros.do("publisher", topic="/chatter", type="std_msgs/String")
"""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, Self

import pytest

from muros.ros1 import _xmlrpc
from tests.dds.peers import ROOT, Peer

__all__ = ["PACKAGES", "Master", "require", "require_tools"]

PYTHON: Final = Path("/usr/bin/python3")
MASTER: Final = Path("/usr/bin/rosmaster")
PROGRAM: Final = Path(__file__).resolve().parent / "programs/ros1.py"
PACKAGES: Final = (
    "python3-rosmaster python3-rospy python3-std-msgs python3-sensor-msgs python3-std-srvs "
    "python3-rostopic python3-rosservice python3-rosparam"
)
TOOLS: Final = ("rostopic", "rosservice", "rosparam")
LOGS: Final = ROOT / "build/peers/logs"
START: Final = 20.0
"""Seconds that a master may take to answer."""


def require() -> None:
    """Skips the running test, or fails it under ``CI=true``, unless ROS 1 is installed."""
    if MASTER.exists() and Path("/usr/lib/python3/dist-packages/rospy").is_dir():
        return
    reason = f"ROS 1 is not installed (Debian: apt install {PACKAGES})"
    if os.environ.get("CI") == "true":
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


def require_tools() -> None:
    """Skips the running test, or fails it under ``CI=true``, unless the commands of ROS 1 are installed."""
    lacking = [name for name in TOOLS if not Path(f"/usr/bin/{name}").exists()]
    if not lacking:
        return
    reason = f"{', '.join(lacking)} not installed (Debian: apt install {PACKAGES})"
    if os.environ.get("CI") == "true":
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


class Master:
    """A ``rosmaster`` of its own, on a free port of this machine."""

    def __init__(self) -> None:
        require()
        self.port = _free_port()
        self.uri = f"http://127.0.0.1:{self.port}/"
        LOGS.mkdir(parents=True, exist_ok=True)
        self.start()

    @property
    def environment(self) -> dict[str, str]:
        """The variables by which a process finds it."""
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("ROS", "PYTHON"))}
        return {
            **kept,
            "PATH": f"/usr/bin:{kept.get('PATH', '')}",
            "PYTHONUNBUFFERED": "1",
            "ROS_IP": "127.0.0.1",
            "ROS_LOG_DIR": str(LOGS),
            "ROS_MASTER_URI": self.uri,
        }

    def start(self) -> None:
        """Runs it; it knows nothing of what another one knew."""
        self._process = subprocess.Popen(
            [str(MASTER), "--core", "-p", str(self.port)],
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        end = time.monotonic() + START
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1.0).close()
                return
            except OSError:
                assert self._process.poll() is None, "rosmaster has ended"
                assert time.monotonic() < end, "rosmaster does not answer"
                time.sleep(0.02)

    def stop(self) -> None:
        """Ends it as a power cut would."""
        self._process.kill()
        self._process.wait(10)

    @contextmanager
    def peer(self, name: str) -> Iterator[Peer]:
        """A rospy node."""
        log = LOGS / f"ros1-{name}-{os.getpid()}-{time.monotonic_ns()}.log"
        with log.open("wb") as printed:
            process = subprocess.Popen(
                [str(PYTHON), str(PROGRAM)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=printed,
                env=self.environment,
                cwd=LOGS,
            )
        with Peer(f"rospy {name}", process, log) as peer:
            peer.do("node", name=name)
            yield peer

    async def ask(self, method: str, *arguments: Any) -> Any:
        """A call of its API by somebody who is no node."""
        return await _xmlrpc.call(self.uri, method, "/test", *arguments)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(ProcessLookupError):
            self.stop()


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as found:
        port: int = found.getsockname()[1]
        return port
