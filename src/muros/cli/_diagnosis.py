"""What `muros doctor` says: one result for each thing it looked at."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from muros.cli._tool import printable

__all__ = ["Level", "Result", "fine", "note", "report", "wrong"]


class Level(Enum):
    """How much a result matters."""

    FINE = "ok"
    NOTE = "note"
    """Nothing is broken, but it may explain what somebody misses."""
    WRONG = "WRONG"


@dataclass(frozen=True, slots=True)
class Result:
    """One thing that was looked at: what is so, and for what is not fine, what to do."""

    level: Level
    what: str
    remedy: str = ""


def fine(what: str) -> Result:
    """All is well with it."""
    return Result(Level.FINE, what)


def note(what: str, remedy: str = "") -> Result:
    """Worth knowing."""
    return Result(Level.NOTE, what, remedy)


def wrong(what: str, remedy: str) -> Result:
    """To be mended."""
    return Result(Level.WRONG, what, remedy)


def report(results: Iterable[Result]) -> str:
    """The lines for one result after the other."""
    lines = []
    for result in results:
        lines.append(f"{result.level.value:<6} {_one_line(result.what)}")
        if result.remedy:
            lines.append(f"{'':<6} -> {_one_line(result.remedy)}")
    return "\n".join(lines)


def _one_line(text: str) -> str:
    return printable(text).replace("\n", "\\n").replace("\t", "\\t")
