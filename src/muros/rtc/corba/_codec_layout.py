"""How values of a type lie in their octets: what its ORB descriptor says, and what is known of positions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from keyword import iskeyword
from typing import Any, Final, NamedTuple

import omniORB

__all__ = [
    "MAX_DEPTH", "START", "UNKNOWN", "Place", "Row", "Unwritable", "advanced", "alignment_of", "code_of",
    "default_maker", "kind_of", "least_size", "loosened", "members_of", "name_of", "resolved", "round_place", "row_of",
]  # fmt: skip

kinds: Final = omniORB.tcInternal
"""The numbers of kinds (`tv_long` ...), as descriptors have them."""

NUMBERS: Final = {
    kinds.tv_short: ("h", 2), kinds.tv_ushort: ("H", 2), kinds.tv_long: ("i", 4), kinds.tv_ulong: ("I", 4),
    kinds.tv_longlong: ("q", 8), kinds.tv_ulonglong: ("Q", 8), kinds.tv_float: ("f", 4), kinds.tv_double: ("d", 8),
    kinds.tv_boolean: ("?", 1), kinds.tv_octet: ("B", 1),
}  # fmt: skip
"""Kinds of one size, by their code in `struct`, with their size, which is their alignment, too. Characters and
enumerations are of one size, too, but go through a conversion."""

MAX_DEPTH: Final = 50
"""Structures in structures, and sequences in sequences."""


class Unwritable(Exception):  # noqa: N818 (a way out, not an error)
    """The type has parts that no code is written for; the text says which."""


def default_maker(descriptor: Any) -> Callable[[], Any]:
    """A function that makes a value of zeros, empty texts and empty sequences; None where a type has no such."""
    space: dict[str, Any] = {}
    text = _default(descriptor, space, 0)
    made: Callable[[], Any] = eval(f"lambda: {text}", space)
    return made


def kind_of(descriptor: Any) -> int:
    """The number of a descriptor's kind."""
    return descriptor if isinstance(descriptor, int) else int(descriptor[0])


def name_of(descriptor: Any) -> str:
    """What a type is called in tracebacks of its code."""
    return str(descriptor[3]) if kind_of(descriptor) == kinds.tv_struct else str(descriptor)[:60]


def resolved(descriptor: Any) -> Any:
    """Without the names that typedef gives."""
    while kind_of(descriptor) == kinds.tv_alias:
        descriptor = descriptor[3]
    return descriptor


def members_of(descriptor: Any) -> Iterator[tuple[str, Any]]:
    """The members of a structure: attribute and descriptor. Unwritable where one cannot be an attribute."""
    for name, kind in zip(descriptor[4::2], descriptor[5::2], strict=True):
        if not name.isidentifier() or iskeyword(name):
            raise Unwritable(f"member {name}")
        yield name, kind


def alignment_of(kind: int) -> int:
    """Of a kind of one size; 0 for others."""
    if kind in NUMBERS:
        return NUMBERS[kind][1]
    return {kinds.tv_char: 1, kinds.tv_enum: 4}.get(kind, 0)


def least_size(descriptor: Any, depth: int = 0) -> int:
    """Octets that a value has at least."""
    descriptor = resolved(descriptor)
    kind = kind_of(descriptor)
    if depth > MAX_DEPTH:
        raise Unwritable("too many structures in structures")
    if kind == kinds.tv_struct:
        return sum(least_size(member, depth + 1) for _, member in members_of(descriptor))
    if kind == kinds.tv_array:
        return int(descriptor[2]) * least_size(descriptor[1], depth + 1)
    if kind == kinds.tv_wchar:
        return 1
    return alignment_of(kind) or 4


class Place(NamedTuple):
    """What is known of a position: it is `offset` modulo `modulus`."""

    modulus: int
    offset: int

    def after(self, size: int) -> Place:
        return Place(self.modulus, (self.offset + size) % self.modulus)

    def padding(self, alignment: int) -> int | None:
        """Octets up to the next multiple; None if that cannot be known."""
        return -self.offset % alignment if alignment <= self.modulus else None

    def holds_for(self, other: Place) -> bool:
        """Whether a position of which `other` is known is one like this."""
        return other.modulus >= self.modulus and other.offset % self.modulus == self.offset


START: Final = Place(8, 0)
UNKNOWN: Final = Place(1, 0)


def round_place(run: Callable[[Place], Place], entry: Place) -> Place:
    """What is known at the start of every round of a loop that is entered at `entry`."""
    place = entry
    while not place.holds_for(run(place)):
        modulus = place.modulus // 2
        place = Place(modulus, place.offset % modulus)
    return place


def advanced(descriptor: Any, place: Place, depth: int = 0) -> Place:
    """What is known after a value, written from `place` on."""
    descriptor = resolved(descriptor)
    kind = kind_of(descriptor)
    if depth > MAX_DEPTH:
        raise Unwritable("too many structures in structures")
    if size := alignment_of(kind):
        padding = place.padding(size)
        return (Place(size, 0) if padding is None else place.after(padding)).after(size)
    if kind == kinds.tv_struct:
        for _, member in members_of(descriptor):
            place = advanced(member, place, depth + 1)
        return place
    if kind in (kinds.tv_sequence, kinds.tv_array):
        if kind == kinds.tv_sequence:
            place = advanced(kinds.tv_ulong, place)

        def run(start: Place) -> Place:
            return advanced(descriptor[1], start, depth + 1)

        at_start = round_place(run, place)
        if kind == kinds.tv_array:
            for _ in range(min(int(descriptor[2]), 8)):
                place = run(place)
            return place if int(descriptor[2]) <= 8 else round_place(run, at_start)
        return at_start
    if kind in (kinds.tv_string, kinds.tv_wstring, kinds.tv_wchar):
        return UNKNOWN
    raise Unwritable(f"kind {kind}")


class Row(NamedTuple):
    """A structure (or enumeration, or array) whose octets have one layout wherever it begins aligned."""

    codes: str
    size: int
    alignment: int
    leaves: list[tuple[str, int, Any]]
    """Path from the value (`.tm.sec`), kind, descriptor."""


def row_of(descriptor: Any) -> Row | None:
    """The layout of an element that repeats without padding between; None if there is none."""
    leaves: list[tuple[str, int, Any]] = []

    def collect(one: Any, path: str, depth: int) -> bool:
        one = resolved(one)
        kind = kind_of(one)
        if depth > MAX_DEPTH:
            raise Unwritable("too many structures in structures")
        if alignment_of(kind):
            leaves.append((path, kind, one))
            return True
        return kind == kinds.tv_struct and all(
            collect(member, f"{path}.{name}", depth + 1) for name, member in members_of(one)
        )

    if not collect(descriptor, "", 0) or not leaves:
        return None
    widest = max(alignment_of(kind) for _, kind, _ in leaves)
    if alignment_of(leaves[0][1]) != widest:
        return None
    codes, size = "", 0
    for _, kind, _ in leaves:
        alignment = alignment_of(kind)
        padding = -size % alignment
        codes += "x" * padding + code_of(kind)
        size += padding + alignment
    return Row(codes, size, widest, leaves) if size % widest == 0 else None


def code_of(kind: int) -> str:
    return NUMBERS[kind][0] if kind in NUMBERS else {kinds.tv_char: "c", kinds.tv_enum: "I"}[kind]


def loosened(entry: Place, size: int) -> Place:
    """What is known after any number of elements of `size`, entered at `entry`: none at all, or some, aligned."""
    modulus = min(size, entry.modulus)
    while entry.offset % modulus:
        modulus //= 2
    return Place(modulus, 0)


def _default(descriptor: Any, space: dict[str, Any], depth: int) -> str:
    """An expression for the default value; what it needs is put into `space`."""
    descriptor = resolved(descriptor)
    kind = kind_of(descriptor)
    if depth > MAX_DEPTH:
        return "None"
    if kind == kinds.tv_struct:
        name = f"class{len(space)}"
        space[name] = descriptor[1]
        return f"{name}({', '.join(_default(member, space, depth + 1) for member in descriptor[5::2])})"
    if kind == kinds.tv_enum:
        name = f"item{len(space)}"
        space[name] = descriptor[3][0]
        return name
    if kind in (kinds.tv_sequence, kinds.tv_array):
        element = kind_of(resolved(descriptor[1]))
        count = int(descriptor[2]) if kind == kinds.tv_array else 0
        if element == kinds.tv_octet:
            return f"bytes({count})"
        if element in (kinds.tv_char, kinds.tv_wchar):
            return f"'\\0' * {count}" if count else "''"
        return f"[{_default(descriptor[1], space, depth + 1)} for _ in range({count})]" if count else "[]"
    simple = {
        kinds.tv_string: "''", kinds.tv_wstring: "''", kinds.tv_char: "'\\0'", kinds.tv_wchar: "'\\0'",
        kinds.tv_boolean: "False", kinds.tv_float: "0.0", kinds.tv_double: "0.0",
    }  # fmt: skip
    return simple.get(kind, "0" if kind in NUMBERS else "None")
