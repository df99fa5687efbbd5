"""Data types: values of the stubs' classes to octets and back, by straight-line code made for each type.

The octets are the plain CDR body, from offset 0, without a header. `data_type_of` looks a type up; the first time it
writes the source of its encoder and decoder (`_codec_source.py`), one pair for each endianness. What that cannot
express (`any`, unions, references to objects, types that hold themselves) is done by the ORB's own marshalling.

Values are taken generously: sequences of numbers may be lists, tuples, arrays or numpy arrays of that type,
sequences of octets anything with a buffer of octets. What is decoded is what the ORB itself would make: lists,
`bytes` for octets, `str` for characters. Texts are UTF-8; those that are not, as older peers send them, are taken as
ISO 8859-1.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable
from typing import Any, Final

import omniORB
from omniORB import CORBA

from muros.rtc.codes import RtcError
from muros.rtc.corba import _stubs
from muros.rtc.corba._codec_layout import Unwritable, default_maker
from muros.rtc.corba._codec_source import make_codec
from muros.rtc.data import ANY_TYPE, DataError

__all__ = ["IdlDataType", "data_type_of"]

_ERRORS: Final = (AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError, struct.error)
"""What generated code raises for bad values and octets."""

_lock = threading.Lock()
_known: dict[str, IdlDataType] = {}


def data_type_of(kind: object) -> IdlDataType:
    """The data type of a stub class, or of a name: `IDL:RTC/TimedLong:1.0`, `RTC::TimedLong`, `TimedLong`.

    A name without a module is looked for in RTC. RtcError if it is not the name of a data type whose stubs are
    loaded.
    """
    repository_id = _find_id(kind)
    descriptor = omniORB.findType(repository_id) if repository_id else None
    if descriptor is None:
        raise RtcError(
            f"{kind!r} is no data type: give the class of an IDL struct, such as RTC.TimedLong, or its name; "
            "types of IDL files of your own are known once the file is loaded"
        )
    with _lock:
        known = _known.get(repository_id)
        if known is None or known.descriptor is not descriptor:
            known = _known[repository_id] = IdlDataType(repository_id, descriptor)
        return known


class IdlDataType:
    """A data type of an IDL file; see `muros.rtc.data.DataType`. Use `data_type_of`."""

    __slots__ = ("_default", "decode", "descriptor", "encode", "python_class", "repository_id")

    encode: Callable[[Any, bool], bytes]
    decode: Callable[[bytes, bool], Any]

    def __init__(self, repository_id: str, descriptor: Any) -> None:
        self.repository_id: Final = repository_id
        self.descriptor: Final = descriptor
        self.python_class: Final[type[Any]] = descriptor[1] if isinstance(descriptor[1], type) else object
        self._default: Callable[[], Any] = default_maker(descriptor)
        try:
            little, big = make_codec(descriptor, "<"), make_codec(descriptor, ">")
        except Unwritable:
            self.encode, self.decode = _by_orb(repository_id)
            return
        self.encode = _encoder(repository_id, little[0], big[0])
        self.decode = _decoder(repository_id, little[1], big[1])

    def default(self) -> Any:
        """A new value of zeros, empty texts and empty sequences."""
        return self._default()

    def __repr__(self) -> str:
        return f"<data type {self.repository_id}>"


def _find_id(kind: object) -> str:
    if not isinstance(kind, str):
        return str(getattr(kind, "_NP_RepositoryId", ""))
    name = kind.strip()
    if name.startswith("IDL:") or name.lower() == ANY_TYPE:
        return name
    parts = name.replace("::", "/").strip("/").split("/")
    if len(parts) == 1:
        parts.insert(0, "RTC")
    found: Any = _stubs.MODULES.get(parts[0])
    for part in parts[1:]:
        found = getattr(found, part, None)
    return str(getattr(found, "_NP_RepositoryId", f"IDL:{'/'.join(parts)}:1.0"))


def _encoder(
    name: str, little_end: Callable[[Any], bytes], big_end: Callable[[Any], bytes]
) -> Callable[[Any, bool], bytes]:
    def encode(value: Any, little: bool) -> bytes:
        try:
            return little_end(value) if little else big_end(value)
        except _ERRORS as error:
            raise DataError(f"{_shown(value)} is no {name}: {error}") from error

    return encode


def _decoder(
    name: str, little_end: Callable[[bytes], Any], big_end: Callable[[bytes], Any]
) -> Callable[[bytes, bool], Any]:
    def decode(octets: bytes, little: bool) -> Any:
        try:
            return little_end(octets) if little else big_end(octets)
        except _ERRORS as error:
            raise DataError(f"{len(octets)} octets are no {name}: {error}") from error

    return decode


def _by_orb(name: str) -> tuple[Callable[[Any, bool], bytes], Callable[[bytes, bool], Any]]:
    typecode = omniORB.findTypeCode(name)

    def encode(value: Any, little: bool) -> bytes:
        try:
            octets: bytes = omniORB.cdrMarshal(typecode, value, int(little))
        except (CORBA.Exception, *_ERRORS) as error:
            raise DataError(f"{_shown(value)} is no {name}: {error!r}") from error
        return octets

    def decode(octets: bytes, little: bool) -> Any:
        try:
            return omniORB.cdrUnmarshal(typecode, octets, int(little))
        except (CORBA.Exception, *_ERRORS) as error:
            raise DataError(f"{len(octets)} octets are no {name}: {error!r}") from error

    return encode, decode


def _shown(value: object) -> str:
    try:
        text = repr(value)
    except Exception:
        text = type(value).__name__
    return text if len(text) <= 200 else f"{text[:200]}..."
