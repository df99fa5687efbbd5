"""CDR for boards: what generated message code calls to check, read and write a caller's buffer.

Messages of fixed size need no more than this module; those with strings load ``cdr_texts``, with sequences of numbers
``cdr_lists`` too. What many classes would repeat stands there once.

Everything is little-endian XCDR1 (DDS-XTypes 1.3, 7.4.1): a value stands at a multiple of its size, counted from the
first byte of the body. Integers are put together by shifts, since ``struct.unpack_from`` allocates a tuple on boards;
with values of less than 31 bits nothing here allocates unless it says so.
"""

from array import array

from muros.compat import MPY, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    Buffer = bytes | bytearray | memoryview


_ANY = const(0x3FFFFFFF)


class CdrError(ValueError):
    """A message does not fit its type: received bytes are short or malformed, or a value cannot be written."""

    code = 1  # that of the C library for what cannot be serialised


class Fields:
    """A nested message: its fields are the attributes. What type it is only the message around it knows."""


def need(have: int, count: int, padding: int = _ANY) -> None:
    """Raises CdrError unless at least ``count`` bytes are there, and at most ``padding`` more."""
    if have < count:
        raise CdrError("%d bytes, %d needed" % (have, count))
    if have - count > padding:
        raise CdrError("%d bytes left over" % (have - count))


def integer(buf: "Buffer", p: int, size: int, signed: int) -> int:
    """The integer of ``size`` bytes at ``p``."""
    i = p + size - 1
    n = buf[i]
    if signed and n > 127:
        n -= 256
    while i > p:
        i -= 1
        n = n << 8 | buf[i]
    return n


def numbers(values: "Any", code: str, size: int = 0) -> "Any":
    """What a constructor was given for an array, or else a new one of ``size`` zero bytes."""
    return array(code, bytes(size)) if values is None else values


def block(values: "Sequence[Any]", code: str, n: int) -> "Any":
    """The ``n`` numbers of an array as what ``struct`` packs with ``s``. Anything but an array or bytes allocates."""
    if not isinstance(values, array) and not isinstance(values, bytes):  # a tuple of both would allocate
        values = array(code, values)
    if len(values) != n:
        raise CdrError("%d elements, %d needed" % (len(values), n))
    return values if MPY else bytes(values)
