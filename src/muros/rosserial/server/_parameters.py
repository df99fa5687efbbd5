"""Parameters as boards get them: an answer for every request, in every kind that a value has.

A client of any release looks only at the list of the kind it asked for, and an empty one ends its wait at once. So a
number is given as int and as float, and as text if there is room.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from muros.rosserial.messages import Values

__all__ = ["answer_of", "flat", "plain_name"]

_INT = (-(1 << 31), (1 << 31) - 1)
_FLOAT_MAX = 3.4028234663852886e38


def answer_of(value: Any, room: int) -> tuple[bytes, bool]:
    """The answer with ``value``, of at most ``room`` bytes; False if nothing of it could be said."""
    if value is None:
        return _bytes(Values()), True
    items = list(value) if isinstance(value, list | tuple | bytes) else [value]
    ints, floats, strings = _kinds(items)
    for values in (Values(ints, floats, strings), Values(ints, floats), Values(ints), Values([], floats)):
        if (values.ints or values.floats or values.strings or not items) and values.size() <= room:
            return _bytes(values), True
    texts = Values([], [], strings) if not ints and not floats else None
    if texts is not None and texts.strings and texts.size() <= room:
        return _bytes(texts), True
    return _bytes(Values()), False


def plain_name(name: str, node: str) -> str:
    """The parameter of ``node`` that a board means: ``~gain``, ``gain`` and ``/node/gain`` are ``gain``."""
    if name.startswith(node + "/"):
        name = name[len(node) :]
    return name.lstrip("~").strip("/").replace("/", ".")


def flat(tree: Mapping[Any, Any], prefix: str = "") -> dict[str, Any]:
    """Parameters of a tree as ROS 1 has them, by names with dots."""
    found: dict[str, Any] = {}
    for key, value in tree.items():
        name = f"{prefix}{str(key).strip('/').replace('/', '.')}"
        if isinstance(value, Mapping):
            found.update(flat(value, name + "."))
        else:
            found[name] = value
    return found


def _kinds(items: list[Any]) -> tuple[list[int], list[float], list[bytes]]:
    if all(isinstance(item, str) for item in items):
        return [], [], [item.encode() for item in items]
    if not all(isinstance(item, bool | int | float) for item in items):
        return [], [], []
    whole = all(_INT[0] <= item <= _INT[1] and item == int(item) for item in items)
    texts = [str(int(item) if isinstance(item, bool) else item) for item in items]
    return (
        [int(item) for item in items] if whole else [],
        [_single(item) for item in items],
        [text.encode() for text in texts],
    )


def _single(number: float) -> float:
    """A number as single precision has it: the largest one instead of those beyond."""
    if number != number or number in (math.inf, -math.inf):
        return number
    return float(max(-_FLOAT_MAX, min(_FLOAT_MAX, number)))


def _bytes(values: Values) -> bytes:
    body = bytearray(values.size())
    values.write(body, 0)
    return bytes(body)
