"""The programs of the guide to managed nodes, and the example, do what is said of them."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.cli.shell import Shell
from tests.dds.domains import free_domain
from tests.micropython.runtimes import require
from tests.micropython.unix import run_mpy
from tests.test_guides import ROOT, Bench, bench, programs

from std_msgs.msg import Int32

__all__ = ["bench"]

GUIDE = "docs/lifecycle.md"
EXAMPLE = ROOT / "examples/managed_node.py"
LIFE = """\
configure True inactive
activate True active
deactivate True inactive
cleanup True unconfigured
shutdown True finalized
"""


def test_no_program_goes_untested() -> None:
    assert len(programs(GUIDE)) == 2


def test_the_sonar_and_who_launches_it(bench: Bench) -> None:
    got: list[int] = []
    bench.node.subscription(Int32, "/lab/depth", lambda message: got.append(message.data))
    sonar = bench.start(GUIDE, 0)
    bench.until(lambda: bench.events.count("ClientReady") >= 2)
    assert got == []
    launcher = bench.start(GUIDE, 1)
    bench.until(lambda: got and launcher.process.poll() is not None)
    assert launcher.lines == ["True active"]
    assert sonar.lines == ["the sensor is open", "it measures"]
    assert got[0] == 42
    bench.says_goodbye(sonar)


@pytest.fixture
def shell() -> Iterator[Shell]:
    """Commands in a domain of the test's own."""
    with free_domain() as domain:
        yield Shell(domain)


def test_the_example_and_the_command(shell: Shell) -> None:
    talker = _run([str(EXAMPLE), "dds:"], shell.environment)
    try:
        done = subprocess.run(
            [sys.executable, str(EXAMPLE), "dds:", "launch"],
            env=shell.environment,
            capture_output=True,
            text=True,
            timeout=30,
            check=True,
        )
        assert done.stdout.endswith(LIFE)
        assert shell.run("lifecycle get").stdout == "/talker: finalized [4]\n"
        talker.send_signal(signal.SIGINT)
        out, err = talker.communicate(timeout=20)
        lines = out.splitlines()
        assert [*lines[:2], *lines[3:]] == ["configured", "activated", "cleaned up", "shut down"]
        assert lines[2].startswith("deactivated at ")
        assert (err, talker.returncode) == ("", 0)
    finally:
        talker.kill()
        talker.communicate()


def test_the_example_on_micropython(bench: Bench, tmp_path: Path) -> None:
    require("unix")
    from muros.interfaces import board

    kinds = ("ChangeState", "GetState", "GetAvailableStates", "GetAvailableTransitions")
    names = ["std_msgs/msg/Int32", "lifecycle_msgs/msg/TransitionEvent"]
    board.generate([*names, *(f"lifecycle_msgs/srv/{kind}" for kind in kinds)], tmp_path, constants=())
    port = str(bench.link.port)
    talker = _run([str(EXAMPLE), "udp", "127.0.0.1", port])
    try:
        library = (ROOT / "src", tmp_path)
        assert run_mpy(EXAMPLE, ["udp", "127.0.0.1", port, "launch"], library=library).endswith(LIFE)
    finally:
        talker.kill()
        talker.communicate()


def _run(words: list[str], environment: Any = None) -> "subprocess.Popen[str]":
    """A Python program beside the test."""
    return subprocess.Popen(
        [sys.executable, "-u", *words],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
