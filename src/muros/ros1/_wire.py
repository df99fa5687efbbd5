"""TCPROS, how ROS 1 nodes speak to each other: connection headers, and blocks behind their length.

Both ends begin with a header, which is a block of fields ``name=value``, each behind its own length. What follows on a
topic are messages, each a block. A service's answers have one more byte in front: 1, or 0 where the block is an error's
text. Lengths are u32, little endian (ROS wiki: "ROS/Connection Header", "ROS/TCPROS").
"""

from __future__ import annotations

from collections.abc import Mapping
from struct import Struct

HEADER_LIMIT = 1 << 20
"""Bytes of the longest connection header that is read; it carries a definition's whole text."""
BLOCK_LIMIT = 64 << 20
"""Bytes of the longest message that is read."""

_LENGTH = Struct("<I")


class WireError(ValueError):
    """The bytes of a peer are no TCPROS; the text says what is wrong with them."""


def header(fields: Mapping[str, str]) -> bytes:
    """A connection header with its length."""
    body = b"".join(block(f"{name}={value}".encode()) for name, value in fields.items())
    return block(body)


def header_untrusted(body: bytes) -> dict[str, str]:
    """The fields of a connection header, its length left out. Raises :class:`WireError`."""
    fields: dict[str, str] = {}
    at = 0
    while at < len(body):
        if at + 4 > len(body):
            raise WireError("a connection header ends inside a field")
        (size,) = _LENGTH.unpack_from(body, at)
        at += 4
        if size > len(body) - at:
            raise WireError(f"a field of {size} bytes where {len(body) - at} are left in a connection header")
        name, equals, value = body[at : at + size].partition(b"=")
        at += size
        if not equals:
            raise WireError("a field of a connection header has no '='")
        fields[name.decode("utf-8", "replace")] = value.decode("utf-8", "replace")
    return fields


def block(body: bytes) -> bytes:
    """Bytes behind their length."""
    return _LENGTH.pack(len(body)) + body


class Blocks:
    """Cuts a stream into blocks. With ``lead`` so many bytes stand before each length and are kept in front.

    A block longer than ``limit`` raises :class:`WireError`.
    """

    def __init__(self, limit: int = HEADER_LIMIT, lead: int = 0) -> None:
        self.limit = limit
        self.lead = lead
        self._data = bytearray()

    def feed_untrusted(self, data: bytes) -> None:
        """Takes bytes as they come. Raises :class:`WireError` when they announce too long a block."""
        self._data += data
        self._check()

    def next_untrusted(self) -> bytes | None:
        """The next whole block without its length, None if there is none yet. Raises :class:`WireError`."""
        size = self._check()
        if size is None or len(self._data) < self.lead + 4 + size:
            return None
        end = self.lead + 4 + size
        body = bytes(self._data[: self.lead]) + bytes(self._data[self.lead + 4 : end])
        del self._data[:end]
        return body

    def _check(self) -> int | None:
        """The length of the next block, None if it is not here yet."""
        if len(self._data) < self.lead + 4:
            return None
        size: int = _LENGTH.unpack_from(self._data, self.lead)[0]
        if size > self.limit:
            raise WireError(f"a block of {size} bytes is announced, more than {self.limit}: is it TCPROS?")
        return size
