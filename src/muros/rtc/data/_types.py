"""What data ports carry: data types, and how their names are compared."""

from __future__ import annotations

from typing import Any, Final, Protocol, TypeVar

from muros.rtc.codes import RtcError

__all__ = ["ANY_TYPE", "AnyDataType", "DataError", "DataType", "same_type", "type_label"]

T = TypeVar("T")

ANY_TYPE: Final = "any"
"""The data type of ports that take every type."""


class DataError(RtcError):
    """Octets that are no value of their data type, or a value that its data type cannot hold."""


class DataType(Protocol[T]):
    """A data type and its wire form: the plain CDR body of the value, from offset 0, without an encapsulation header.

    Values may be shared: who encodes does not keep them, who decodes makes new ones.
    """

    @property
    def repository_id(self) -> str:
        """Such as `IDL:RTC/TimedLong:1.0`, or `ANY_TYPE`."""

    @property
    def python_class(self) -> type[T]:
        """What its values are."""

    def default(self) -> T:
        """A new value of zeros, empty texts and empty sequences."""

    def encode(self, value: T, little: bool) -> bytes:
        """The octets of `value`, little endian or big. DataError where the type cannot hold it."""

    def decode(self, octets: bytes, little: bool) -> T:
        """The value of `octets`. DataError for every sequence of octets that is none."""


AnyDataType = DataType[Any]


def type_label(repository_id: str) -> str:
    """The name inside a repository id: `RTC/TimedLong` of `IDL:RTC/TimedLong:1.0`."""
    name = repository_id.strip()
    if name.startswith("IDL:"):
        name = name[4:].rsplit(":", 1)[0]
    return name.replace("::", "/").strip("/")


def same_type(one: str, other: str) -> bool:
    """Whether ports of these two data types may be connected.

    Repository ids are compared by their names; a bare `TimedLong`, as OpenRTM 1.0 wrote it, is the same as
    `IDL:RTC/TimedLong:1.0`. `any` and what is not told match everything.
    """
    a, b = type_label(one), type_label(other)
    if not a or not b or ANY_TYPE in (a.lower(), b.lower()):
        return True
    if "/" in a and "/" in b:
        return a == b
    return a.rsplit("/", 1)[-1] == b.rsplit("/", 1)[-1]
