"""CDR for boards: what generated message code calls to check, read and write a caller's buffer.

Everything is little-endian XCDR1 (DDS-XTypes 1.3, 7.4.1): a value stands at a multiple of its size, counted from the
first byte of the body. Integers are put together by shifts, since ``struct.unpack_from`` allocates a tuple on boards;
with values of less than 31 bits nothing here allocates unless it says so.
"""

from array import array
from struct import pack_into

from muros.compat import MPY, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any


class CdrError(ValueError):
    """A message does not fit its type: received bytes are short or malformed, or a value cannot be written."""


class Fields:
    """A nested message: its fields are the attributes. What type it is only the message around it knows."""


def need(have: int, count: int) -> None:
    """Raises CdrError unless at least ``count`` bytes are there."""
    if have < count:
        raise CdrError("%d bytes, %d needed" % (have, count))


def ended(left: int) -> None:
    """Raises CdrError unless the body ends here; transports pad it with up to 3 bytes."""
    if left > 3:
        raise CdrError("%d bytes left over" % left)
    need(left, 0)


def integer(buf: "bytearray", p: int, size: int, signed: int) -> int:
    """The integer of ``size`` bytes at ``p``."""
    i = p + size - 1
    n = buf[i]
    if signed and n > 127:
        n -= 256
    while i > p:
        i -= 1
        n = n << 8 | buf[i]
    return n


def count(buf: "bytearray", p: int, end: int, least: int) -> int:
    """The count at ``p`` of elements that take at least ``least`` bytes each, checked against ``end``."""
    need(end - p, 4)
    n = integer(buf, p, 4, 0)
    need(end - p - 4, n * least)
    return n


def text(buf: "bytearray", p: int, n: int) -> str:
    """The string of ``n`` bytes with its NUL at ``p``. Allocates the string and a view."""
    if n == 0:
        return ""
    try:
        if buf[p + n - 1] == 0:
            return str(memoryview(buf)[p : p + n - 1], "utf-8")
    except ValueError:
        pass
    raise CdrError("bad string")


def encoded(value: "str | bytes | bytearray", memo: "list[Any]") -> "bytes | bytearray":
    """The bytes of a string attribute; a str is encoded once and kept in ``memo`` until it is replaced."""
    if isinstance(value, str):
        if value is not memo[0]:
            memo[1] = value.encode()
            memo[0] = value
        return memo[1]  # type: ignore[no-any-return]
    return value


def put_text(buf: "bytearray", p: int, value: "bytes | bytearray") -> int:
    """Writes a string: its count, its bytes, NUL; returns the offset behind it."""
    n = len(value)
    pack_into("<I", buf, p, n + 1)
    p += 4
    buf[p : p + n] = value
    buf[p + n] = 0
    return p + n + 1


def pad(buf: "bytearray", p: int, start: int, align: int) -> int:
    """Zeroes up to the next multiple of ``align`` from ``start``; returns its offset."""
    while p - start & align - 1:
        buf[p] = 0
        p += 1
    return p


def block(values: "Sequence[Any]", code: str, n: int) -> "Any":
    """The ``n`` numbers of an array as what ``struct`` packs with ``s``. Anything but an array or bytes allocates."""
    if not isinstance(values, array) and not isinstance(values, bytes):  # a tuple of both would allocate
        values = array(code, values)
    if len(values) != n:
        raise CdrError("%d elements, %d needed" % (len(values), n))
    return values if MPY else bytes(values)
