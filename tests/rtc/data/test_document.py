"""The programs of the guide to data ports do what is said of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.test_guides import Guided, programs

DOCUMENT = "docs/rtc-data-ports.md"

LINES = {
    0: [
        "True PORT_OK", "True PORT_OK", "overwritten by 3", "True PORT_OK",
        "read 2", "read 3", "again PORT_OK 3",
    ],
    1: ["42"],
}  # fmt: skip


@pytest.mark.parametrize("number", LINES)
def test_it_prints_what_it_must(number: int, tmp_path: Path) -> None:
    running = Guided(programs(DOCUMENT)[number], 0, tmp_path)
    try:
        assert running.end() == (0, "")
        assert running.lines == LINES[number]
    finally:
        running.stop()


def test_no_program_goes_untested() -> None:
    assert len(programs(DOCUMENT)) == len(LINES)
