"""Serializers by name: what `dataport.marshaling_type` may ask for besides a data type's own `cdr`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Protocol

from muros.rtc.data._types import AnyDataType, type_label

__all__ = ["CDR", "codec_of", "marshaling_types", "register_serializer", "register_serializers"]

CDR: Final = "cdr"
"""The serializer that each data type has."""


class Serializers(Protocol):
    """A family of serializers, made when they are asked for."""

    def names(self, data_type: AnyDataType) -> tuple[str, ...]:
        """Those that a port of this data type tells tools of."""

    def codec(
        self, data_type: AnyDataType, marshaling: str, options: Mapping[str, str]
    ) -> AnyDataType | None:
        """The one of that name, None where this family has none. `options`: the connection's effective properties."""


_NAMED: Final[dict[tuple[str, str], AnyDataType]] = {}
_FAMILIES: Final[list[Serializers]] = []


def register_serializer(marshaling: str, codec: AnyDataType) -> None:
    """Let connections of the codec's data type ask for `dataport.marshaling_type` = `marshaling`."""
    _NAMED[marshaling, type_label(codec.repository_id)] = codec


def register_serializers(family: Serializers) -> None:
    """Add a family. Asked in the order of adding, after those registered one by one."""
    if family not in _FAMILIES:
        _FAMILIES.append(family)


def codec_of(data_type: AnyDataType, marshaling: str, options: Mapping[str, str] = {}) -> AnyDataType | None:
    """The serializer of that name, None where there is none."""
    if marshaling == CDR:
        return data_type
    named = _NAMED.get((marshaling, type_label(data_type.repository_id)))
    if named is not None:
        return named
    for family in _FAMILIES:
        if (codec := family.codec(data_type, marshaling, options)) is not None:
            return codec
    return None


def marshaling_types(data_type: AnyDataType) -> tuple[str, ...]:
    """The names of all serializers of this data type."""
    label = type_label(data_type.repository_id)
    names = [name for name, owner in _NAMED if owner == label]
    for family in _FAMILIES:
        names += family.names(data_type)
    return (CDR, *dict.fromkeys(names))
