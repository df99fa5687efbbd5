"""Types that Cyclone DDS takes to be empty, so that samples pass as the bytes they are.

Cyclone checks the CDR it is given against a description of the type. One with no fields consumes nothing and leaves
the rest alone, so a payload passes untouched. There must be only one such type for each name in a process: Cyclone's
memory grows without bound after some thirty unequal ones.

By itself Cyclone would announce the description of the (empty) type, and Fast DDS 3 refuses to match what differs
from its own. So its table of functions for that is taken out while an endpoint is made. That leans on the inner layout
of one version; with another one nothing is taken out, and `announces_types` says so.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from threading import Lock
from typing import Any, Final

__all__ = ["VERSION", "announces_types", "installed_version", "opaque_type", "unannounced"]

VERSION: Final = "11.0.1"
"""The version of cyclonedds whose layout is known."""

OPERATIONS: Final = 14
"""Pointers in the table of functions of a type (struct ddsi_sertype_ops)."""

DESCRIBING: Final = (8, 9, 10)
"""Those among them that give a type's id, its map and its information."""

_swapping: Final = Lock()
_silent: Final[dict[tuple[int | None, ...], Any]] = {}
"""Tables without those, by what they were made of. They stay: Cyclone may have copied the pointer to one."""


def installed_version() -> str:
    """The version of cyclonedds that is installed, "" if it is not."""
    try:
        return version("cyclonedds")
    except PackageNotFoundError:
        return ""


def announces_types() -> bool:
    """Whether peers are told descriptions of types, because this version's layout is not known."""
    return installed_version() != VERSION


@cache
def opaque_type(type_name: str) -> Any:
    """The class for samples of a type, the same one in the whole life of the process."""
    from cyclonedds.idl import make_idl_struct

    return make_idl_struct("Opaque", type_name, {}, dataclassify=False)


@contextmanager
def unannounced(topic: Any) -> Iterator[None]:
    """What is made of `topic` meanwhile is announced without a description of its type."""
    if announces_types():
        yield
        return
    kind = ctypes.c_void_p()
    result = topic._dll_handle.dds_get_entity_sertype(topic._ref, ctypes.byref(kind))
    if result != 0 or not kind.value:
        yield
        return
    word = ctypes.POINTER(ctypes.c_void_p)
    table = ctypes.cast(kind.value, word)  # its first word points to the functions
    with _swapping:
        original = table[0]
        table[0] = ctypes.addressof(_without_descriptions(tuple(ctypes.cast(original, word)[:OPERATIONS])))
        try:
            yield
        finally:
            table[0] = original


def _without_descriptions(operations: tuple[int | None, ...]) -> Any:
    silent = _silent.get(operations)
    if silent is None:
        kept = (None if slot in DESCRIBING else pointer for slot, pointer in enumerate(operations))
        silent = _silent[operations] = (ctypes.c_void_p * OPERATIONS)(*kept)
    return silent
