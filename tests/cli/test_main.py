"""The command `muros` itself: what it finds, what it says, how it ends."""

import os
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from muros import __version__, cli


def command(monkeypatch: pytest.MonkeyPatch, **functions: Callable[..., Any]) -> None:
    """Adds a sub-command `probe` whose module has these functions."""
    module = types.ModuleType("probe_command")
    vars(module).update(functions)
    monkeypatch.setitem(sys.modules, "probe_command", module)
    monkeypatch.setitem(cli.COMMANDS, "probe", ("probe_command", "a command for tests"))


@pytest.mark.parametrize("flag", ["-V", "--version"])
def test_version(flag: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([flag]) == 0
    assert capsys.readouterr() == (f"muros {__version__}\n", "")


@pytest.mark.parametrize("words", [["-h"], ["--help"], ["help"]])
def test_help_lists_the_commands(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(words) == 0
    out, err = capsys.readouterr()
    assert out.startswith("usage: muros COMMAND")
    assert all(f"  {name} " in out for name in cli.COMMANDS)
    assert err == ""


@pytest.mark.parametrize("words", [["agent", "--help"], ["help", "agent"]])
def test_help_of_a_command(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(words) == 0
    assert capsys.readouterr().out.startswith("usage: muros agent TRANSPORT")


def test_no_words_is_wrong_use(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("usage: muros COMMAND")


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("agnet", "muros: unknown command 'agnet': did you mean agent?\n"),
        ("--verison", "muros: unknown option '--verison': there are "),
        ("zzz", "muros: unknown command 'zzz': there are agent"),
    ],
)
def test_an_unknown_command(word: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([word]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(said)
    assert err.count("\n") == 1


def test_a_command_gets_its_words_and_gives_its_status(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[list[str]] = []

    def run(words: list[str]) -> int:
        seen.append(words)
        return 7

    command(monkeypatch, run=run)
    assert cli.main(["probe", "a", "--b"]) == 7
    assert seen == [["a", "--b"]]


def test_a_command_on_argparse(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def register(subparsers: Any) -> None:
        parser = subparsers.add_parser("probe")
        parser.add_argument("--size", type=int, required=True)
        parser.set_defaults(run=lambda arguments: arguments.size)

    command(monkeypatch, register=register)
    assert cli.main(["probe", "--size", "5"]) == 5
    assert cli.main(["probe", "--size", "x"]) == 2
    assert "invalid int value" in capsys.readouterr().err
    assert cli.main(["probe", "--help"]) == 0


def test_an_interrupt_ends_quietly(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(words: list[str]) -> int:
        raise KeyboardInterrupt

    command(monkeypatch, run=run)
    assert cli.main(["probe"]) == 130
    assert capsys.readouterr() == ("", "")


def test_a_bug_of_ours_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(words: list[str]) -> int:
        raise RuntimeError("a bug")

    command(monkeypatch, run=run)
    with pytest.raises(RuntimeError, match="a bug"):
        cli.main(["probe"])


def test_a_reader_that_leaves_is_no_error() -> None:
    """As `muros --help | head -0`: the pipe has no reader when we write."""
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "muros", "--help"],
            stdout=write,
            stderr=subprocess.PIPE,
            timeout=30,
            check=False,
        )
    finally:
        os.close(write)
    assert (done.returncode, done.stderr) == (1, b"")


def test_python_dash_m(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "muros", "--version"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, f"muros {__version__}\n", "")
