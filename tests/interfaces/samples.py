"""Random messages of any standard type, made with the classes of rosbags, which are the oracle."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import normalize_fieldname

from muros.interfaces import Registry

DISTRO = Registry().distro
STORE = get_typestore(Stores(f"ros2_{DISTRO}"))
NAMES = sorted(STORE.types)

_DTYPES: dict[str, Any] = {"bool": np.bool_, "char": np.uint8, "byte": np.uint8}
_TEXTS = ("", "x", "base_link", "äöü", "€", "\U0001f916 robot", "a b")
_FLOATS = (0.0, -0.0, 1.5, -2.25, 1e30, float("inf"), float("-inf"))
_DUMMY = "structure_needs_at_least_one_member"


def sample(name: str, random: Random) -> Any:
    """A random message of a type: edge values, short sequences, empty ones among them."""
    fields = STORE.fielddefs[name][1]
    return STORE.types[name](
        **{normalize_fieldname(n): 0 if n == _DUMMY else _value(d, random) for n, d in fields}
    )


def encode(message: Any, name: str, big_endian: bool = False) -> bytes:
    """The message with its encapsulation header, as rosbags writes it."""
    return bytes(STORE.serialize_cdr(message, name, little_endian=not big_endian))


def _value(description: Any, random: Random) -> Any:
    node, content = description
    if node == Nodetype.BASE:
        return _primitive(content[0], random)
    if node == Nodetype.NAME:
        return sample(content, random)
    inner, count = content
    if node == Nodetype.SEQUENCE:
        count = random.randrange(min(count or 4, 4) + 1)
    items = [_value(inner, random) for _ in range(count)]
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        base = inner[1][0]
        return np.array(items, dtype=_DTYPES.get(base) or getattr(np, base))
    return items


def _primitive(base: str, random: Random) -> Any:
    if base == "string":
        return random.choice(_TEXTS)
    if base == "bool":
        return random.random() < 0.5
    if base.startswith("float"):
        return (
            random.choice(_FLOATS) if random.random() < 0.5 else float(np.float32(random.uniform(-1e6, 1e6)))
        )
    if base == "byte":
        return random.randrange(128)  # rosbags takes a single byte for an int8
    bits = 8 if base == "char" else int(base.lstrip("uint"))
    low = 0 if base[0] in "uc" else -(1 << bits - 1)
    edges = (low, low + (1 << bits) - 1, 0, 1)
    return random.choice(edges) if random.random() < 0.5 else random.randrange(low, low + (1 << bits))
