"""The program of the guide to service ports does what is said of it."""

from __future__ import annotations

from pathlib import Path

from tests.test_guides import Guided, programs

LINES = [
    "Directory directory of port Caller0.directory is not connected, phone_of cannot be called: connect its port with "
    "one that provides the interface (rtcon, or an editor), or look at is_connected before",
    "Directory directory of port Caller0.directory: the provider is not active, or has ended",
    "12 1",
    "unknown: Bob",
]


def test_it_prints_what_it_must(tmp_path: Path) -> None:
    (program,) = programs("docs/rtc-service-ports.md")
    program = f"import os; os.chdir({str(tmp_path)!r})\n{program}"
    running = Guided(program, 0, tmp_path)
    try:
        assert running.end() == (0, "")
        assert running.lines == LINES
    finally:
        running.stop()
