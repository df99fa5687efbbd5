"""What `muros rtc new` reads in the text of IDL files: included files, and the operations of interfaces.

The compiler is not asked, for it does not know the parameters' names any more; what it would refuse is no matter here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

__all__ = ["Member", "members_of", "with_included"]

COMMENT: Final = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
INCLUDE: Final = re.compile(r'^[ \t]*#[ \t]*include[ \t]*["<]([^">\n]+)[">]', re.MULTILINE)
INTERFACE: Final = re.compile(r"\binterface\s+(\w+)\s*(?::([^{;]*))?{(.*?)}\s*;", re.DOTALL)
OPERATION: Final = re.compile(r"(?:oneway\s+)?[\w:<>,\s]+?\s(\w+)\s*\(([^)]*)\)")
ATTRIBUTE: Final = re.compile(r"(?:readonly\s+)?attribute\s+[\w:<>\s]+?\s(\w+(?:\s*,\s*\w+)*)\s*")
GIVEN: Final = re.compile(r"\b(?:in|inout)\s+[\w:<>\s]+?\s(\w+)\s*(?:,|$)")


@dataclass(frozen=True, slots=True)
class Member:
    """An operation of an interface, with the names of what a caller gives; None: it is an attribute."""

    interface: str
    name: str
    parameters: tuple[str, ...] | None


def with_included(files: Iterable[Path]) -> tuple[Path, ...]:
    """The files, and those beside them that they include, each once. The RTC world's own stand elsewhere."""
    found: dict[Path, None] = {}
    waiting = list(files)
    while waiting:
        path = waiting.pop(0)
        if path not in found:
            found[path] = None
            beside = (path.parent / name for name in INCLUDE.findall(_text(path)))
            waiting += [one for one in beside if one.is_file()]
    return tuple(found)


def members_of(kind: str, files: Sequence[Path]) -> list[Member]:
    """The members of an interface, `My::Service`, and behind them those of what it is derived from, each once."""
    interfaces = {
        found[1]: (found[2] or "", found[3]) for path in files for found in INTERFACE.finditer(_text(path))
    }
    members: dict[str, Member] = {}
    seen: set[str] = set()
    waiting = [_last(kind)]
    while waiting:
        name = waiting.pop(0)
        if name in interfaces and name not in seen:
            seen.add(name)
            bases, body = interfaces[name]
            for member in _members(name, body):
                members.setdefault(member.name, member)
            waiting += [_last(base) for base in bases.split(",")]
    return list(members.values())


def _members(interface: str, body: str) -> Iterator[Member]:
    for statement in body.split(";"):
        text = statement.strip()
        if attributes := ATTRIBUTE.match(text):
            yield from (Member(interface, name.strip(), None) for name in attributes[1].split(","))
        elif operation := OPERATION.match(text):
            yield Member(interface, operation[1], tuple(GIVEN.findall(operation[2])))


def _last(name: str) -> str:
    return name.strip().rpartition("::")[2]


def _text(path: Path) -> str:
    """Without comments; nothing of a file that cannot be read."""
    try:
        return COMMENT.sub("", path.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return ""
