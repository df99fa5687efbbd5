"""`muros rtc run`, `muros rtcd` and `muros rtc names` as users call them."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from muros.cli import main
from muros.rtc.corba import NameServer, Orb, RunningNameServer
from tests.rtc.conftest import find_free_port
from tests.rtc.manager._processes import ENVIRONMENT, Managers, wait_until

SHIM = Path(__file__).parents[1] / "shim" / "components"

TWO = """
from muros.rtc import Component, run
class One(Component): ...
class Two(Component): ...
if __name__ == "__main__":
    run(One, Two)
"""


@pytest.fixture
def managers(tmp_path: Path, name_server: RunningNameServer) -> Iterator[Managers]:
    (tmp_path / "two.py").write_text(TWO)
    with Managers(tmp_path, name_server.address) as made:
        yield made


def names_at(orb: Orb, server: RunningNameServer) -> list[str]:
    return sorted(
        binding.name for _, binding in NameServer(orb, server.address).walk() if binding.kind == "rtc"
    )


@pytest.mark.parametrize("how", ["muros rtc run", "python"])
def test_a_file_is_a_program_and_a_module(
    managers: Managers, orb: Orb, name_server: RunningNameServer, how: str
) -> None:
    file = str(managers.folder / "two.py")
    words = ("--instance_name=First",)
    if how == "python":
        command = managers.command(*words)
        process = managers.start_command([command[0], file, *command[4:]])
    else:
        process = managers.start(*words, command=("rtc", "run", file))
    wait_until(lambda: names_at(orb, name_server) == ["First", "Two0"])
    assert re.search(
        r"^muros .* · First, Two0 · names at .* · Ctrl-C ends it$", managers.said(process), re.MULTILINE
    )
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 0
    assert names_at(orb, name_server) == []


def test_components_of_openrtm_run(managers: Managers, orb: Orb, name_server: RunningNameServer) -> None:
    managers.start("--instance_name=Old", command=("rtc", "run", str(SHIM / "ConsoleOut.py")))
    wait_until(lambda: names_at(orb, name_server) == ["Old"])


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        ([], 2, "muros: name the file of a component: muros rtc run MyComp.py"),
        (["none.py"], 2, "muros: none.py: no such file"),
        (
            ["empty.py"],
            1,
            r"muros: .*empty.py: no component in it: neither a function emptyInit\(manager\) nor a class",
        ),
        (["broken.py"], 1, r"muros: .*broken.py: cannot be imported: broken.py:2: ZeroDivisionError"),
        (["bad.py"], 1, r"muros: Bad0: on_initialize answered RTC_ERROR"),
    ],
)
def test_files_that_cannot_be_run(tmp_path: Path, words: list[str], status: int, message: str) -> None:
    (tmp_path / "empty.py").write_text("")
    (tmp_path / "broken.py").write_text("\n1 / 0\n")
    (tmp_path / "bad.py").write_text(
        "from muros.rtc import Component, ReturnCode\n"
        "class Bad(Component):\n    def on_initialize(self):\n        return ReturnCode.RTC_ERROR\n"
    )
    alone = ["-o", "logger.enable:NO", "-o", "naming.enable:NO", "-o", "corba.endpoints:127.0.0.1:"]
    done = subprocess.run(
        [sys.executable, "-m", "muros", "rtc", "run", *alone, *words],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=30,
        env=ENVIRONMENT,
    )
    assert done.returncode == status
    assert re.match(message, done.stderr)
    assert done.stderr.count("\n") == 1


def test_a_name_service_on_demand(tmp_path: Path, orb: Orb) -> None:
    port = find_free_port()
    command = [
        sys.executable,
        "-m",
        "muros",
        "rtc",
        "names",
        "-p",
        str(port),
        "--folder",
        str(tmp_path / "n"),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT) as process:
        assert process.stdout is not None
        said = process.stdout.readline()
        assert re.fullmatch(rf"name service at 127\.0\.0\.1:{port}, pid \d+; Ctrl-C ends it\n", said)
        server = NameServer(orb, f"127.0.0.1:{port}")
        assert server.is_there()
        again = subprocess.run(command, capture_output=True, text=True, timeout=30, env=ENVIRONMENT)
        assert (again.returncode, again.stdout) == (0, f"a name service runs at 127.0.0.1:{port} already\n")
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
    pid = int(said.split("pid ")[1].split(";")[0])
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.parametrize(
    "words", [["rtc", "--help"], ["rtc", "run", "--help"], ["rtcd", "-h"], ["rtc", "names", "-h"]]
)
def test_help(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 0
    assert capsys.readouterr().out.startswith("usage: muros rtc")


def test_wrong_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rtc"]) == 2
    assert main(["rtc", "walk"]) == 2
    assert capsys.readouterr().err == (
        "muros: muros rtc what? There are run, new, profile, names\n"
        "muros: unknown command 'walk': there are run, new, profile, names\n"
    )


def test_without_the_extra(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("muros.cli._rtc.find_spec", lambda name: None)
    assert main(["rtc", "run", "x.py"]) == 1
    assert main(["rtcd"]) == 1
    assert capsys.readouterr().err == (
        "muros: RT components need an ORB, which is an extra: pip install 'muros[rtc]'\n" * 2
    )
