"""What old components use for texts, time and CORBA sequences."""
# ruff: noqa: N802 (the names are those that components know)

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from muros.rtc.data import stamp

__all__ = [
    "Time",
    "TimeValue",
    "eraseBlank",
    "eraseBothEndsBlank",
    "eraseHeadBlank",
    "eraseTailBlank",
    "escape",
    "flatten",
    "includes",
    "isAbsolutePath",
    "isURL",
    "normalize",
    "otos",
    "replaceString",
    "setTimestamp",
    "split",
    "stringTo",
    "toArgv",
    "toBool",
    "toString",
    "unescape",
    "unique_sv",
]


def eraseBlank(text: Any) -> Any:
    """Without blanks; a one-element list is changed in its place."""
    return _in_place(text, lambda one: re.sub(r"[ \t]", "", one))


def eraseHeadBlank(text: Any) -> Any:
    """Without blanks at its head; a one-element list is changed in its place."""
    return _in_place(text, lambda one: one.lstrip(" \t"))


def eraseTailBlank(text: Any) -> Any:
    """Without blanks at its tail; a one-element list is changed in its place."""
    return _in_place(text, lambda one: one.rstrip(" \t"))


def eraseBothEndsBlank(text: Any) -> Any:
    """Without blanks at both ends; a one-element list is changed in its place."""
    return _in_place(text, lambda one: one.strip(" \t"))


def normalize(text: Any) -> Any:
    """In small letters, without blanks at both ends; a one-element list is changed in its place."""
    return _in_place(text, lambda one: one.strip(" \t").lower())


def replaceString(text: Any, before: str, after: str) -> Any:
    """With `after` for `before`; a one-element list is changed in its place."""
    return _in_place(text, lambda one: one.replace(before, after))


def escape(text: str) -> str:
    """With line ends, tabs, quotes and backslashes as escape sequences."""
    for sign, code in (
        ("\\", "\\\\"),
        ("\t", "\\t"),
        ("\n", "\\n"),
        ("\f", "\\f"),
        ("\r", "\\r"),
        ('"', '\\"'),
    ):
        text = text.replace(sign, code)
    return text


def unescape(text: str) -> str:
    """What `escape` made of it."""
    signs = {"t": "\t", "n": "\n", "f": "\f", "r": "\r"}
    return re.sub(r"\\(.)", lambda found: signs.get(found[1], found[1]), text, flags=re.DOTALL)


def split(text: str, delimiter: str) -> list[str]:
    """The parts between delimiters, without blanks around them, without empty ones."""
    return [part.strip() for part in text.split(delimiter) if part.strip()] if delimiter else [text]


def flatten(parts: Iterable[str], delimiter: str = ", ") -> str:
    """One text of many."""
    return delimiter.join(parts)


def unique_sv(parts: Iterable[str]) -> list[str]:
    """Each text once."""
    return list(dict.fromkeys(parts))


def includes(parts: Sequence[str] | str, value: str, ignore_case: bool = True) -> bool:
    """Whether `value` is among the parts (of a list, or of a text with commas)."""
    known = split(parts, ",") if isinstance(parts, str) else [part.strip() for part in parts]
    if ignore_case:
        return value.strip().lower() in (part.lower() for part in known)
    return value.strip() in known


def toBool(text: str, yes: str, no: str, default_value: bool | None = None) -> bool:
    """Whether `text` says `yes`, or `no`; else `default_value`."""
    lower = text.upper()
    if yes.upper() in lower:
        return True
    if no.upper() in lower:
        return False
    return bool(default_value)


def isAbsolutePath(text: str) -> bool:
    """Whether it begins at a root or a drive."""
    return re.match(r"/|[A-Za-z]:[\\/]|\\\\", text) is not None


def isURL(text: str) -> bool:
    """Whether it has a scheme: `SOMETHING://...`."""
    return text.find("://") > 0


def toArgv(args: Iterable[str]) -> list[str]:
    """A list of arguments."""
    return [str(arg) for arg in args]


def otos(value: object) -> str:
    """A value as text."""
    return str(value)


def toString(value: object) -> str:
    """A value as text; the elements of a list with commas."""
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)


def stringTo(variable: Any, text: str) -> Any:
    """Put `text`, as the type of what is in the one-element list `variable`, into it. False where it cannot be.

    As in version 2, a value that is no list is answered with: whether it can be, and the value then.
    """
    if not isinstance(variable, list):
        return _converted(variable, text)
    if not variable:
        return False
    there, variable[0] = _converted(variable[0], text)
    return there


def setTimestamp(data: Any) -> None:
    """Give a timed value the time of now."""
    stamp(data, time.time_ns)


class TimeValue:
    """A span of time: seconds and microseconds. Made of both, or of seconds with a fraction."""

    def __init__(self, sec: float = 0, usec: float | None = None) -> None:
        total = round(sec * 1e6) if usec is None else int(sec) * 1_000_000 + int(usec)
        self.tv_sec = int(total / 1_000_000)
        self.tv_usec = total - self.tv_sec * 1_000_000

    def sec(self) -> int:
        return self.tv_sec

    def usec(self) -> int:
        return self.tv_usec

    def toDouble(self) -> float:
        return self.tv_sec + self.tv_usec / 1e6

    def set_time(self, time_: float) -> TimeValue:
        self.__init__(time_)  # type: ignore[misc]
        return self

    def sign(self) -> int:
        total = self.toDouble()
        return (total > 0) - (total < 0)

    def __add__(self, other: TimeValue) -> TimeValue:
        return TimeValue(0, self._total() + other._total())

    def __sub__(self, other: TimeValue) -> TimeValue:
        return TimeValue(0, self._total() - other._total())

    def __str__(self) -> str:
        return str(self.toDouble())

    def _total(self) -> int:
        return self.tv_sec * 1_000_000 + self.tv_usec


class Time:
    """The time of day, when it is made or asked for."""

    def __init__(self) -> None:
        self.sec, self.usec = self.gettimeofday()

    def gettimeofday(self) -> tuple[int, int]:
        seconds, rest = divmod(time.time_ns(), 1_000_000_000)
        return seconds, rest // 1000

    def getTime(self) -> TimeValue:
        return TimeValue(*self.gettimeofday())


def _converted(now: Any, text: str) -> tuple[bool, Any]:
    """Whether `text` can be of the type of `now`, and the value; else `now`."""
    try:
        if isinstance(now, (list, tuple)):
            kind = type(now[0]) if now else str
            return True, [kind(part.strip()) for part in text.split(",") if part.strip()]
        return True, type(now)(int(text)) if isinstance(now, bool) else type(now)(text)
    except (TypeError, ValueError):
        return False, now


def _in_place(text: Any, change: Callable[[str], str]) -> Any:
    if isinstance(text, list):
        if text:
            text[0] = change(text[0])
        return text[0] if text else ""
    return change(text)
