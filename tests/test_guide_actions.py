"""The programs of the guide to actions, and the example, do what is said of them."""

import re
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

from example_interfaces.action import Fibonacci

__all__ = ["bench"]

GUIDE = "docs/actions.md"
EXAMPLE = ROOT / "examples/fibonacci.py"


def test_no_program_goes_untested() -> None:
    assert len(programs(GUIDE)) == 3


def test_the_server_and_who_waits(bench: Bench) -> None:
    client = bench.node.action_client(Fibonacci, "fibonacci")
    server = bench.start(GUIDE, 0)
    bench.until(lambda: bench.events.count("ClientReady") >= 2)
    asker = bench.start(GUIDE, 2)
    assert asker.end() == (0, "")
    assert asker.lines == ["[0, 1, 1, 2, 3, 5]"]
    refused = client.send_goal(Fibonacci.Goal(order=40))
    assert refused is not None
    bench.until(lambda: refused.accepted is False)
    bench.says_goodbye(server)


def test_the_server_and_who_has_callbacks(bench: Bench) -> None:
    server = bench.start(GUIDE, 0)
    bench.until(lambda: bench.events.count("ClientReady") >= 2)
    asker = bench.start(GUIDE, 1)
    bench.until(lambda: asker.process.poll() is not None)
    assert asker.end() == (0, "")
    assert asker.lines[0] == "accepted"
    assert asker.lines[1:5] == ["1", "2", "3", "5"]
    assert "canceling" in asker.lines
    assert re.fullmatch(r"the result has \d numbers, status 5", asker.lines[-1])
    bench.says_goodbye(server)


@pytest.fixture
def shell() -> Iterator[Shell]:
    """Commands in a domain of the test's own."""
    with free_domain() as domain:
        yield Shell(domain)


def test_the_example_and_the_command(shell: Shell) -> None:
    server = _run([str(EXAMPLE), "dds:"], shell.environment)
    try:
        asker = [sys.executable, str(EXAMPLE), "dds:", "ask"]

        def ask(*numbers: str) -> str:
            done = subprocess.run(
                [*asker, *numbers], env=shell.environment, capture_output=True, text=True, timeout=30
            )
            assert (done.returncode, done.stderr) == (0, "")
            return done.stdout

        assert ask("5") == "heard [1, 2, 3, 5]\nsucceeded [0, 1, 1, 2, 3, 5]\n"
        assert ask("1000", "3").splitlines()[-1].startswith("canceled [0, 1, 1, 2, 3")
        assert ask("-1") == "the goal was rejected\n"
        kind = "example_interfaces/action/Fibonacci"
        assert shell.run("action list -t").stdout == f"/fibonacci [{kind}]\n"
        said = shell.run("action info /fibonacci").stdout
        assert said == "Action: /fibonacci\nAction clients: 0\nAction servers: 1\n    /counter\n"
        text = (ROOT / GUIDE).read_text().partition("$ muros action send_goal -f")[2]
        printed = re.sub(r"[0-9a-f]{32}", "ID", text.partition("\n")[2].partition("```")[0])
        done = shell.run(f"action send_goal -f /fibonacci {kind} '{{order: 3}}'")
        assert re.sub(r"[0-9a-f]{32}", "ID", done.stdout) == printed
        server.send_signal(signal.SIGINT)
        out, err = server.communicate(timeout=20)
        assert out.splitlines()[:3] == ["counting to 5", "counted to 5", "counting to 1000"]
        assert (err, server.returncode) == ("", 0)
    finally:
        server.kill()
        server.communicate()


@pytest.mark.parametrize("serving", ["python", "micropython"])
def test_the_example_on_micropython(bench: Bench, tmp_path: Path, serving: str) -> None:
    require("unix")
    from muros.interfaces import board

    board.generate(["example_interfaces/action/Fibonacci"], tmp_path, action_services=True, constants=())
    way = ["udp", "127.0.0.1", str(bench.link.port)]
    library = (ROOT / "src", tmp_path)
    if serving == "python":
        server = _run([str(EXAMPLE), *way])
    else:
        from tests.micropython.runtimes import UNIX

        path = {"MICROPYPATH": ":".join([".frozen", *map(str, library)])}
        server = _run([str(EXAMPLE), *way], path, str(UNIX))
    try:
        bench.until(lambda: bench.events.count("ClientReady") >= 2)
        expected = "heard [1, 2, 3, 5]\nsucceeded [0, 1, 1, 2, 3, 5]\n"
        assert run_mpy(EXAMPLE, [*way, "ask", "5"], library=library) == expected
    finally:
        server.kill()
        server.communicate()


def _run(words: list[str], environment: Any = None, python: str = "") -> "subprocess.Popen[str]":
    """A program beside the test."""
    return subprocess.Popen(
        [python or sys.executable, *words],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
