"""How a message lies in a CDR stream: its leaves in order, and what is known of their alignment.

XCDR1 aligns each primitive to its own size, counted from the first byte of the body (DDS-XTypes 1.3, 7.4.1). Behind a
string or a sequence the position is no longer known when the code is generated, only what it leaves when divided by
some power of two. That knowledge is an :class:`At`; with it a generator writes padding as constants wherever it can
and computes it at run time only where it must.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from muros.interfaces._model import PRIMITIVES, FieldType, Kind, Message, attribute

Path = tuple[str, ...]
"""The attributes to follow from a message to a leaf."""

MAX_ALIGN = 8
_UNROLLED = 64  # elements of an array of messages that fixed_size() adds up one by one


@dataclass(frozen=True, slots=True)
class Scalar:
    """One number or bool."""

    path: Path
    code: str
    size: int


@dataclass(frozen=True, slots=True)
class Block:
    """A fixed array of numbers or bools."""

    path: Path
    code: str
    size: int
    count: int


@dataclass(frozen=True, slots=True)
class Numbers:
    """A sequence of numbers or bools; ``bound`` 0 means unbounded."""

    path: Path
    code: str
    size: int
    bound: int


@dataclass(frozen=True, slots=True)
class Text:
    """One string; ``bound`` is its longest length, 0 means unbounded."""

    path: Path
    wide: bool
    bound: int


@dataclass(frozen=True, slots=True)
class Many:
    """An array (``count``) or sequence (``count`` 0) of strings or messages; ``body`` is one element."""

    path: Path
    type_name: str  # of a message, "" for strings
    count: int
    bound: int
    body: tuple[Leaf, ...]


@dataclass(frozen=True, slots=True)
class Group:
    """A nested message that is kept together, so that code of its own can deal with it."""

    path: Path
    type_name: str
    body: tuple[Leaf, ...]


@dataclass(frozen=True, slots=True)
class Dummy:
    """The one byte of a message without fields."""


Leaf = Scalar | Block | Numbers | Text | Many | Group | Dummy


class At(NamedTuple):
    """A position: it leaves ``rest`` when divided by ``modulus`` (1, 2, 4 or 8)."""

    modulus: int
    rest: int

    def pad(self, align: int) -> int | None:
        """The padding before something aligned so, None if it is not known."""
        return -self.rest % align if self.modulus >= align else None

    def moved(self, count: int) -> At:
        """The position ``count`` bytes on."""
        return At(self.modulus, (self.rest + count) % self.modulus)

    def aligned(self, align: int) -> At:
        """The next position that is aligned so."""
        pad = self.pad(align)
        return At(align, 0) if pad is None else self.moved(pad)

    def strided(self, size: int) -> At:
        """The position behind any number of elements of that size."""
        modulus = min(self.modulus, size & -size)
        return At(modulus, self.rest % modulus)

    def meet(self, other: At) -> At:
        """What holds of both positions."""
        modulus = min(self.modulus, other.modulus)
        while self.rest % modulus != other.rest % modulus:
            modulus //= 2
        return At(modulus, self.rest % modulus)


START = At(MAX_ALIGN, 0)


def leaves(
    message: Message, find: Callable[[str], Message], path: Path = (), kept: Container[str] = ()
) -> tuple[Leaf, ...]:
    """The leaves of a message in wire order; ``find`` gives a message by full name.

    Nested messages are dissolved, but for the types in ``kept``, which become groups.
    """
    if not message.fields:
        return (Dummy(),)
    found: list[Leaf] = []
    for field in message.fields:
        found += _field((*path, attribute(field.name)), field.type, find, kept)
    return tuple(found)


def _field(
    path: Path, kind: FieldType, find: Callable[[str], Message], kept: Container[str]
) -> Sequence[Leaf]:
    if kind.nested:
        nested = find(kind.base)
        if kind.kind is Kind.ONE:
            if kind.base in kept:
                return (Group(path, kind.base, leaves(nested, find, (), kept)),)
            return leaves(nested, find, path, kept)
        body = leaves(nested, find, (), kept)
    else:
        primitive = PRIMITIVES[kind.base]
        if primitive.size:
            if kind.kind is Kind.ONE:
                return (Scalar(path, primitive.code, primitive.size),)
            if kind.kind is Kind.ARRAY:
                return (Block(path, primitive.code, primitive.size, kind.count),)
            return (Numbers(path, primitive.code, primitive.size, kind.count),)
        wide = kind.base == "wstring"
        if kind.kind is Kind.ONE:
            return (Text(path, wide, kind.string_bound),)
        body = (Text((), wide, kind.string_bound),)
    array = kind.kind is Kind.ARRAY
    type_name = kind.base if kind.nested else ""
    return (Many(path, type_name, kind.count if array else 0, 0 if array else kind.count, body),)


def after(leaf: Leaf, at: At) -> At:
    """What is known of the position behind a leaf that begins (before its padding) at ``at``."""
    match leaf:
        case Scalar(size=size):
            return at.aligned(size).moved(size)
        case Block(size=size, count=count):
            return at.aligned(size).moved(size * count)
        case Dummy():
            return at.moved(1)
        case Text(wide=wide):
            return at.aligned(4).moved(4).strided(4 if wide else 1)
        case Numbers(size=size):
            counted = at.aligned(4).moved(4)
            return counted.aligned(size).strided(size).meet(counted)
        case Many(count=count, body=body):
            return loop(body, at if count else at.aligned(4).moved(4))
        case Group(body=body):
            for inner in body:
                at = after(inner, at)
            return at


def loop(body: Sequence[Leaf], at: At) -> At:
    """What is known of the position before each of any number of elements, and behind the last."""
    while True:
        end = at
        for leaf in body:
            end = after(leaf, end)
        met = at.meet(end)
        if met == at:
            return at
        at = met


def fixed_size(found: Sequence[Leaf], start: int = 0) -> int | None:
    """The end of leaves that begin at ``start``, None if it differs from message to message (or is long to tell)."""
    size = start
    for leaf in found:
        match leaf:
            case Scalar(size=width):
                size += -size % width + width
            case Block(size=width, count=count):
                size += -size % width + width * count
            case Dummy():
                size += 1
            case Group(body=body):
                end = fixed_size(body, size)
                if end is None:
                    return None
                size = end
            case Many(count=count, body=body) if 0 < count <= _UNROLLED:
                for _ in range(count):
                    end = fixed_size(body, size)
                    if end is None:
                        return None
                    size = end
            case _:
                return None
    return size


def least_size(found: Sequence[Leaf]) -> int:
    """A lower bound of the bytes the leaves take, by which counts of foreign data are checked."""
    size = 0
    for leaf in found:
        match leaf:
            case Scalar(size=width):
                size += width
            case Block(size=width, count=count):
                size += width * count
            case Many(count=count, body=body) if count:
                size += count * least_size(body)
            case Group(body=body):
                size += least_size(body)
            case Dummy():
                size += 1
            case _:
                size += 4
    return size
