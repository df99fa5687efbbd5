"""What messages of a type take under some rules: each member's capacity, bytes in all, and the longest body.

The sizes are those of the C library for boards, so that the figures of one hold for the other: what strings and
sequences point to, in C structures of a machine whose pointers have ``word`` bytes. The functions are methods of
`memory.Rules`, on hosts only, where boards are planned. They raise RulesError for a rule that is for no member.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from muros.rclc.arena import Arena
from muros.rclc.memory_plan import Walker, capacity, divide

if TYPE_CHECKING:
    from muros.rclc.memory import Rules

__all__ = ["capacities", "carve", "longest", "size", "static_size"]

_ALIGN = 4
"""Bytes to which what is carved out of a buffer is aligned."""


class Member(NamedTuple):
    """A word of a shape."""

    form: str
    """``s``, ``w``, the bytes of a number, ``[`` for a sequence and ``(`` for an array of what has members."""
    path: str
    """That of a string or sequence, empty for all else."""
    times: int
    """The capacity, or how often it is there."""
    inner: list[Member]
    """The members of an element."""


def capacities(self: Rules, kind: Any) -> dict[str, int]:
    """The capacity of each string and sequence of a type, by its path."""
    found: dict[str, int] = {}
    walker = _walk(self, kind)
    for _ in walker:
        if walker.path:
            found[walker.path] = capacity(self, walker.path, walker.form)
    return found


def size(self: Rules, kind: Any, word: int = 8) -> int:
    """The bytes that all strings and sequences of a message take together."""
    return _total(_members(self, _walk(self, kind)), word, 1)


def static_size(self: Rules, kind: Any, word: int = 8) -> int:
    """The bytes of a buffer out of which all of them can be carved, each aligned to 4 bytes."""
    return _total(_members(self, _walk(self, kind)), word, _ALIGN)


def longest(self: Rules, kind: Any) -> int:
    """The bytes of the longest body that keeps to the rules; ``Session(largest=...)`` needs 8 more."""
    return _end(_members(self, _walk(self, kind)), 0)


def carve(self: Rules, kind: Any, memory: Arena | bytearray, word: int = 8) -> dict[str, list[memoryview]]:
    """Carves what a message takes out of a buffer: the places of each string and sequence, by its path.

    Raises CapacityError when it is too small.
    """
    if isinstance(memory, bytearray):
        memory = Arena(memory)
    found: dict[str, list[memoryview]] = {}
    _carve(_members(self, _walk(self, kind)), memory, word, found)
    return found


def _walk(rules: Rules, kind: Any) -> Walker:
    """A way through the type. RulesError for a rule that is for none of its members."""
    divide(rules, kind.TYPE, [kind])
    return Walker(kind)


def _members(rules: Rules, walker: Walker) -> list[Member]:
    """The members up to the end, or to the closing word."""
    found: list[Member] = []
    for word in walker:
        form, path = walker.form, walker.path
        if word == ")":
            break
        if form == "":
            width, _, count = word.partition("*")
            found.append(Member(width, "", int(count or 1), []))
        elif form == "{":
            found.append(Member("(", "", 1, _members(rules, walker)))
        elif form[-1] == "(":
            found.append(Member("(", "", int(form[:-1]), _members(rules, walker)))
        else:
            most = capacity(rules, path, form)
            found.append(Member(form[0], path, most, _members(rules, walker) if form[0] == "[" else []))
    return found


def _total(members: list[Member], word: int, align: int) -> int:
    """The bytes of all that members point to."""
    total = 0
    for form, path, count, inner in members:
        if path:
            total += count * _width(form, inner, word) + align - 1 & -align
        if inner:
            total += count * _total(inner, word, align)
    return total


def _width(form: str, inner: list[Member], word: int) -> int:
    """The bytes of an element, or of a character."""
    if form == "[":
        return _struct(inner, word)[0]
    return 1 if form == "s" else 2 if form == "w" else int(form)


def _struct(members: list[Member], word: int) -> tuple[int, int]:
    """Bytes and alignment of a C structure; strings and sequences are a pointer and two sizes."""
    at = 0
    most = 1
    for form, path, count, inner in members:
        if path:
            n, align = 3 * word, word
        elif form == "(":
            n, align = _struct(inner, word)
            n *= count
        else:
            align = int(form)
            n = align * count
        at = (at + align - 1 & -align) + n
        most = max(most, align)
    return at + most - 1 & -most, most


def _end(members: list[Member], p: int) -> int:
    """Where members that begin at ``p`` end in the longest body."""
    for form, path, count, inner in members:
        if path:
            p = (p + 3 & -4) + 4
        if inner:
            for _ in range(count):
                p = _end(inner, p)
        elif form == "s":
            p += count + 1
        elif form == "w":
            p += 4 * count
        else:
            p = (p + int(form) - 1 & -int(form)) + count * int(form)
    return p


def _carve(members: list[Member], memory: Arena, word: int, found: dict[str, list[memoryview]]) -> None:
    for form, path, count, inner in members:
        if path:
            found.setdefault(path, []).append(memory.take(count * _width(form, inner, word)))
        if inner:
            for _ in range(count):
                _carve(inner, memory, word, found)
