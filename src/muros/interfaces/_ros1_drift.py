"""Which definition an unknown md5 sum belongs to.

Firmware is built with the message definitions of its day. An md5 sum does not say what is different, but most changes
between releases are one small step: one or two fields or a constant came, or one changed its type. So the steps away
from the known definition are tried until one has the sum. That finds, for instance, the ``sensor_msgs/BatteryState``
without temperatures that every robot built before ROS Noetic sends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

from muros.interfaces._hashes import ros1_message_md5
from muros.interfaces._model import PRIMITIVES, Field, FieldType, InterfaceError, Kind, Message
from muros.interfaces._registry import Registry

_CHANGEABLE = tuple(name for name in PRIMITIVES if name != "wstring")


def guess(home: Registry, known: Message, md5: str) -> tuple[Message, str] | None:
    """The definition with that sum that is one step from the known one, and the step in words; None if there is none.

    What only the known definition has is left out of the message that is returned, so that a converter fills it in.
    """
    for changed, step in _steps(known):
        try:
            if ros1_message_md5(home, changed) == md5:
                return changed, step
        except InterfaceError:
            continue
    return None


def _steps(known: Message) -> Iterator[tuple[Message, str]]:
    """Definitions one step away, the likelier first."""
    fields, constants = known.fields, known.constants
    for count in (1, 2):
        for gone in combinations(fields, min(count, len(fields))):
            fewer = tuple(field for field in fields if field not in gone)
            names = " and ".join(field.name for field in gone)
            yield replace(known, fields=fewer), f"an older definition without {names}"
    for at, constant in enumerate(constants):
        others = replace(known, constants=constants[:at] + constants[at + 1 :])
        yield others, f"the same fields, without constant {constant.name}"
    for count in range(2, len(constants) + 1):
        yield (
            replace(known, constants=constants[:-count]),
            f"the same fields, without the last {count} constants",
        )
    for at, field in enumerate(fields):
        for other in _other_types(field.type):
            changed = (*fields[:at], Field(field.name, other), *fields[at + 1 :])
            yield replace(known, fields=changed), f"{field.name} is {other} there and {field.type} here"


def _other_types(kind: FieldType) -> Iterator[FieldType]:
    if kind.nested:
        return
    for base in _CHANGEABLE:
        if base != kind.base:
            yield replace(kind, base=base)
    if kind.kind is Kind.ARRAY:
        yield replace(kind, kind=Kind.SEQUENCE, count=0)
    elif kind.kind is Kind.SEQUENCE:
        yield replace(kind, kind=Kind.ONE)
    else:
        yield replace(kind, kind=Kind.SEQUENCE)
