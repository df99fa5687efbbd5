"""How a message lies in the two serialisations at once: ROS 1 on one side, CDR of ROS 2 on the other.

Both write the same values in the same order. They differ in padding (ROS 1 has none), in the NUL behind CDR strings, in
how a negative duration is written, and in fields that one of the two definitions lacks. :func:`paired` walks two
definitions side by side and gives the leaves of both in wire order; a leaf that only one side has says so, and carries
the bytes the other direction makes up for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from struct import pack

from muros.interfaces._model import PRIMITIVES, Field, FieldType, InterfaceError, Kind, Message

Find = Callable[[str], Message]


class Side(Enum):
    """Which of the two serialisations has a leaf."""

    BOTH = "both"
    ROS1 = "ROS 1 only"
    CDR = "ROS 2 only"


class Care(Enum):
    """What has to be done to bytes on their way, beside copying them."""

    NONE = "nothing"
    BOOL = "ROS 1 takes any byte but 0 for true, CDR only 1"
    DURATION = "ROS 1 has negative nanoseconds, ROS 2 borrows from the seconds"
    SEQ = "the counter of a header, which ROS 2 has not"


@dataclass(frozen=True, slots=True)
class Fixed:
    """``size`` bytes, at a multiple of ``align`` in CDR; ``fill`` stands for them where they are missing."""

    side: Side
    align: int
    size: int
    care: Care = Care.NONE
    fill: bytes = b""


@dataclass(frozen=True, slots=True)
class Text:
    """One string."""

    side: Side


@dataclass(frozen=True, slots=True)
class Run:
    """A sequence of equal elements of ``size`` bytes that lie back to back on both sides."""

    side: Side
    align: int
    size: int
    care: Care = Care.NONE


@dataclass(frozen=True, slots=True)
class Many:
    """An array (``count``) or sequence (``count`` 0) of anything else; ``body`` is one element."""

    side: Side
    count: int
    body: tuple[Leaf, ...]


Leaf = Fixed | Text | Run | Many

_MISSING: dict[tuple[str, str], bytes] = {
    ("sensor_msgs/msg/BatteryState", "temperature"): pack("<f", float("nan")),
}
"""What stands for a field that ROS 1 lacks, where zero would say something untrue."""

_SEQ = Fixed(Side.ROS1, 4, 4, Care.SEQ, bytes(4))


def paired(ros1: Message, ros2: Message, find1: Find, find2: Find) -> tuple[Leaf, ...]:
    """The leaves of a message in both serialisations.

    ``find1`` and ``find2`` give messages by full name as ROS 1 and as ROS 2 define them. Raises
    :class:`InterfaceError` if a field has another type on the other side, or another place among those both have.
    """
    return _message(ros1, ros2, Side.BOTH, find1, find2)


def plain(body: Sequence[Leaf]) -> tuple[int, int] | None:
    """Alignment and size of leaves that are the same bytes on both sides, any number of times in a row; else None."""
    align, size = 1, 0
    for leaf in body:
        if not isinstance(leaf, Fixed) or leaf.side is not Side.BOTH or leaf.care is not Care.NONE:
            return None
        if size % leaf.align:
            return None
        align, size = max(align, leaf.align), size + leaf.size
    return None if size % align or not size else (align, size)


def least_size(body: Sequence[Leaf], side: Side) -> int:
    """A lower bound of the bytes the leaves take on a side (``ROS1`` or ``CDR``), padding left out."""
    size = 0
    for leaf in body:
        if leaf.side not in (Side.BOTH, side):
            continue
        match leaf:
            case Fixed():
                size += leaf.size
            case Many(count=count) if count:
                size += count * least_size(leaf.body, side)
            case _:
                size += 4  # the count; some writers of CDR leave out the NUL of an empty string
    return size


def ros1_size(body: Sequence[Leaf]) -> int | None:
    """The bytes that every message of these leaves takes in ROS 1, None if they differ from message to message."""
    for leaf in body:
        if leaf.side is not Side.CDR and isinstance(leaf, Text | Run):
            return None
        if isinstance(leaf, Many) and leaf.side is not Side.CDR and not (leaf.count and ros1_size(leaf.body)):
            return None
    return least_size(body, Side.ROS1)


# ---- the walk ----


def _message(
    one: Message | None, two: Message | None, side: Side, find1: Find, find2: Find
) -> tuple[Leaf, ...]:
    """The leaves of a message that one or both sides have."""
    fields1 = one.fields if one else ()
    fields2 = two.fields if two else ()
    names1 = {field.name.lower() for field in fields1}
    names2 = {field.name.lower() for field in fields2}
    found: list[Leaf] = []
    left, right = list(fields1), list(fields2)
    while left or right:
        if left and left[0].name.lower() not in names2:
            field = left.pop(0)
            header = one is not None and one.name == "std_msgs/msg/Header" and field.name == "seq"
            if header and side is Side.BOTH:
                found.append(_SEQ)
            else:
                found += _alone(one, field, Side.ROS1, find1)
        elif right and right[0].name.lower() not in names1:
            found += _alone(two, right.pop(0), Side.CDR, find2)
        elif left and right and left[0].name.lower() == right[0].name.lower():
            assert one is not None
            assert two is not None
            found += _both(one, left.pop(0), right.pop(0), find1, find2)
        else:
            name = one.name if one else ""
            raise InterfaceError(
                f"{name}: ROS 1 and ROS 2 have its fields in another order, from {left[0].name} on"
            )
    if two is not None and not fields2:
        found.append(Fixed(Side.CDR, 1, 1, fill=b"\0"))  # CDR has no empty structure
    return tuple(found)


def _both(message: Message, one: Field, two: Field, find1: Find, find2: Find) -> tuple[Leaf, ...]:
    kind1, kind2 = one.type, two.type
    same = kind1.nested == kind2.nested and _shape(kind1) == _shape(kind2)
    if same and not kind1.nested:
        same = _same_bits(kind1.base, kind2.base)
    if not same:
        raise InterfaceError(f"{message.name}.{one.name} is {kind1} in ROS 1 and {kind2} in ROS 2")
    if not kind1.nested:
        return _repeated(kind1, Side.BOTH, _primitive(kind1.base, Side.BOTH, message, one.name))
    if kind2.base == "builtin_interfaces/msg/Duration":
        return _repeated(kind1, Side.BOTH, (Fixed(Side.BOTH, 4, 8, Care.DURATION),))
    return _repeated(
        kind1, Side.BOTH, _message(find1(kind1.base), find2(kind2.base), Side.BOTH, find1, find2)
    )


def _alone(message: Message | None, field: Field, side: Side, find: Find) -> tuple[Leaf, ...]:
    """A field that only one side has."""
    assert message
    kind = field.type
    if kind.nested:
        nested = find(kind.base)
        one, two = (nested, None) if side is Side.ROS1 else (None, nested)
        return _repeated(kind, side, _message(one, two, side, find, find))
    found = _primitive(kind.base, side, message, field.name)
    leaf = found[0]
    if kind.kind is Kind.ONE and isinstance(leaf, Fixed):
        missing = _MISSING.get((message.name, field.name))
        if missing is None and isinstance(field.default, bool | int | float):
            missing = pack("<" + PRIMITIVES[kind.base].code, field.default)
        return (Fixed(side, leaf.align, leaf.size, fill=missing or bytes(leaf.size)),)
    return _repeated(kind, side, found)


def _primitive(base: str, side: Side, message: Message, name: str) -> tuple[Leaf, ...]:
    if base == "wstring":
        raise InterfaceError(f"{message.name}.{name}: ROS 1 has no wstring")
    if base == "string":
        return (Text(side),)
    primitive = PRIMITIVES[base]
    care = Care.BOOL if base == "bool" and side is Side.BOTH else Care.NONE
    return (Fixed(side, primitive.size, primitive.size, care, bytes(primitive.size)),)


def _repeated(kind: FieldType, side: Side, body: tuple[Leaf, ...]) -> tuple[Leaf, ...]:
    """The leaves of a field whose element is ``body``."""
    if kind.kind is Kind.ONE:
        return body
    count = kind.count if kind.kind is Kind.ARRAY else 0
    if len(body) == 1 and isinstance(body[0], Fixed) and body[0].size == body[0].align:
        leaf = body[0]
        if count:
            return (Fixed(side, leaf.align, leaf.size * count, leaf.care, bytes(leaf.size * count)),)
        return (Run(side, leaf.align, leaf.size, leaf.care),)
    if (bulk := plain(body)) is not None:
        align, size = bulk
        if count:
            return (Fixed(side, align, size * count, fill=bytes(size * count)),)
        return (Run(side, align, size),)
    return (Many(side, count, body),)


def _shape(kind: FieldType) -> tuple[object, int]:
    return (Kind.ARRAY, kind.count) if kind.kind is Kind.ARRAY else (kind.kind is Kind.ONE, 0)


def _same_bits(one: str, two: str) -> bool:
    first, second = PRIMITIVES[one], PRIMITIVES[two]
    sizes_agree = first.size == second.size and bool(first.high) == bool(second.high)
    return sizes_agree and (one == "wstring") == (two == "wstring")
