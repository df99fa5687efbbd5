"""A value on its way through a connection: encoded once, decoded when somebody looks, copied when it is handed out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from muros.rtc.data._types import AnyDataType

__all__ = ["Outgoing", "Sample", "copy_value", "stamp"]

_NOTHING: Final = object()
_ATOMS: Final = frozenset({int, float, str, bytes, bool, complex, type(None)})


class Sample:
    """One value: its octets, or itself, or both. Belongs to one connector."""

    __slots__ = ("_codec", "_little", "_octets", "_value", "order")

    def __init__(
        self, codec: AnyDataType, little: bool, octets: bytes | None = None, value: object = _NOTHING
    ) -> None:
        self._codec = codec
        self._little = little
        self._octets = octets
        self._value = value
        self.order = 0
        """Its place among the arrivals at its port."""

    @property
    def octets(self) -> bytes:
        """Encoded at the first call. DataError where the type cannot hold it."""
        if self._octets is None:
            self._octets = self._codec.encode(self._value, self._little)
        return self._octets

    @property
    def value(self) -> Any:
        """Decoded at the first call; the same object until `hand_out`. DataError for malformed octets."""
        if self._value is _NOTHING:
            self._value = self._codec.decode(self._octets or b"", self._little)
        return self._value

    def replace(self, value: object) -> None:
        """Carry `value` from now on."""
        self._value = value
        self._octets = None

    def hand_out(self) -> Any:
        """The value, for somebody who may change it: the next call gives another object. DataError as above."""
        if self._octets is None:
            return copy_value(self._value)
        value = self.value
        self._value = _NOTHING
        return value


class Outgoing:
    """A value in a call of write: encoded once for all connections that want the same octets."""

    __slots__ = ("_codec", "_little", "_octets", "value")

    def __init__(self, value: Any) -> None:
        self.value = value
        self._codec: AnyDataType | None = None
        self._little = False
        self._octets = b""

    def octets(self, codec: AnyDataType, little: bool) -> bytes:
        """Its octets. DataError where the type cannot hold it."""
        if self._codec is not codec or self._little is not little:
            self._octets = codec.encode(self.value, little)
            self._codec, self._little = codec, little
        return self._octets


def copy_value(value: Any) -> Any:
    """A value of its own: what can be changed is copied, down to the ground.

    Values are those of IDL types: structures of numbers, texts, octets, sequences and structures.
    The elements of a sequence are of one kind.
    """
    kind: Any = type(value)
    if kind in _ATOMS:
        return value
    if kind is list or kind is tuple:
        if not value or type(value[0]) in _ATOMS:
            return value if kind is tuple else value.copy()
        return kind(map(copy_value, value))
    if kind is bytearray:
        return bytearray(value)
    if kind is dict:
        return {key: copy_value(one) for key, one in value.items()}
    try:
        members = value.__dict__
    except AttributeError:
        return value.copy() if hasattr(value, "copy") else value
    if hasattr(kind, "_is_a"):  # a reference to an object
        return value
    copied = object.__new__(kind)
    into = copied.__dict__
    for name, one in members.items():
        into[name] = one if type(one) in _ATOMS else copy_value(one)
    return copied


def stamp(value: Any, now_ns: Callable[[], int]) -> bool:
    """Set the value's `tm` to the time of day. False where it has none."""
    tm = getattr(value, "tm", None)
    if tm is None or not hasattr(tm, "sec"):
        return False
    tm.sec, tm.nsec = divmod(now_ns(), 1_000_000_000)
    return True
