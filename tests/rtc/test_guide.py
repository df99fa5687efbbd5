"""The programs of the guide to RT components do what is said of them."""

from __future__ import annotations

import os
import re
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.running import PATIENCE, Running

DOCUMENT = Path(__file__).parents[2] / "docs/rtc.md"
ALONE = ("-o", "naming.enable:NO", "-o", "corba.endpoints:127.0.0.1:", "-o", "logger.enable:NO")
"""A manager that nobody else needs to know."""


def blocks(language: str) -> list[str]:
    """What the guide has in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", DOCUMENT.read_text(), re.MULTILINE | re.DOTALL)


def until(condition: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.02)


def run(folder: Path, files: dict[str, str]) -> Running:
    """A component's file, with what lies beside it, as a program in a folder."""
    for name, text in files.items():
        (folder / name).write_text(text)
    environment = {**os.environ, "HOME": str(folder), "OMNIORB_CONFIG": os.devnull}
    program = str(folder / next(iter(files)))
    command = [sys.executable, "-u", program, "-f", str(folder / "rtc.conf"), *ALONE]
    return Running(command, environment)


@pytest.mark.parametrize(
    ("files", "lines"),
    [
        (
            {"first.py": blocks("python")[0], "rtc.conf": blocks("ini")[0]},
            ["1 becomes 1.5", "2 becomes 3.0", "3 becomes 4.5"],
        ),
        (
            {
                "serve.py": blocks("python")[1],
                "rtc.conf": blocks("ini")[1],
                "Greeting.idl": blocks("idl")[0],
            },
            ["hello guest", "hello guest"],
        ),
    ],
    ids=["flow", "services"],
)
def test_it_prints_what_it_must(files: dict[str, str], lines: list[str], tmp_path: Path) -> None:
    running = run(tmp_path, files)
    try:
        until(lambda: len(running.lines) >= len(lines), f"printed so far: {running.lines}")
        status, said = running.end(signal.SIGINT)
        assert running.lines[: len(lines)] == lines
        assert status == 0
        assert re.fullmatch(r"muros \S+ · \w+0, \w+0 · no names · Ctrl-C ends it\n", said)
    finally:
        running.stop()


def test_no_program_goes_untested() -> None:
    assert len(blocks("python")) == 2


def test_keys_that_the_guide_names_are_known() -> None:
    from muros.rtc.manager._defaults import DEFAULTS

    rows = re.findall(r"^\| `([a-z_.]+)`.* \| (?!meaning)", DOCUMENT.read_text(), re.MULTILINE)
    keys = [key for key in rows if key.split(".")[0] in {"corba", "naming", "manager", "logger"}]
    assert len(keys) > 5
    assert set(keys) <= set(DEFAULTS)
