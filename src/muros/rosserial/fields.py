"""ROS 1 serialisation for boards: what generated message classes call to check, read and write a caller's buffer.

Little endian, no padding: a string is a u32 length and its bytes, an array of any length a u32 count and its elements.
What does not fit its type raises MessageError.
"""

import struct

from muros.compat import MPY, const
from muros.rosserial.messages import MessageError

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.xrce._types import Buffer


def need(off: int, n: int, end: int) -> None:
    """Raises MessageError unless ``n`` bytes stand before ``end``."""
    if end - off < n:
        raise MessageError(str(end - off) + " bytes where " + str(n) + " are needed")


def text_size(value: "str | bytes") -> int:
    """Bytes of a string."""
    return 4 + len(value.encode() if isinstance(value, str) else value)


def write_text(buf: bytearray, off: int, value: "str | bytes") -> int:
    """Writes a string; returns the offset behind."""
    if isinstance(value, str):
        value = value.encode()
    n = len(value)
    struct.pack_into("<I", buf, off, n)
    off += 4
    buf[off : off + n] = value
    return off + n


def read_text(buf: "Buffer", off: int, end: int) -> "tuple[str | bytes, int]":
    """The string at ``off`` and the offset behind; bytes if it is not UTF-8, which ROS 1 allows."""
    n, off = read_count(buf, off, end, 1)
    raw = bytes(buf[off : off + n])
    try:
        return raw.decode(), off + n
    except ValueError:
        return raw, off + n


def write_count(buf: bytearray, off: int, n: int) -> int:
    """Writes the count of an array; returns the offset behind."""
    struct.pack_into("<I", buf, off, n)
    return off + 4


def read_count(buf: "Buffer", off: int, end: int, least: int) -> "tuple[int, int]":
    """The count of an array whose elements take ``least`` bytes or more, and the offset behind it."""
    need(off, 4, end)
    n: int = struct.unpack_from("<I", buf, off)[0]
    need(off + 4, n * least, end)
    return n, off + 4


def exactly(values: "Any", n: int) -> "Any":
    """What a constructor or a program put in an array of ``n``; MessageError if it is not as long."""
    if len(values) != n:
        raise MessageError(str(len(values)) + " elements, " + str(n) + " needed")
    return values


class Message:
    """The base of generated messages. On hosts they can be compared and printed."""

    if not MPY:

        def __eq__(self, other: object) -> bool:
            return type(other) is type(self) and other.__dict__ == self.__dict__

        __hash__ = None  # type: ignore[assignment]

        def __repr__(self) -> str:
            fields = ", ".join([name + "=" + repr(value) for name, value in self.__dict__.items()])
            return type(self).__name__ + "(" + fields + ")"
