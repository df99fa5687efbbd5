"""How peers say which request a reply answers: the two dialects of services in ROS 2.

*Inline*, as rmw_fastrtps speaks: a request carries in its inline QoS the GUID of the reader that waits for the
reply (with an unknown sequence number); the reply carries that GUID and the sequence number of the request's DATA.
Payloads are bare. *Header*, as rmw_cyclonedds speaks: payloads begin with an id of the client (8 bytes) and the
client's number of the request (int64); the reply repeats both. The body behind them keeps its alignment, since they
are 16 bytes. Whoever is not Cyclone DDS is taken to speak inline, muros among them.
"""

import struct
from enum import Enum
from hashlib import blake2b
from typing import Final

from muros.rtps import inline_qos
from muros.rtps._constants import VENDOR_CYCLONE
from muros.space._values import CDR_LE, identity_of

__all__ = ["HEADER_SIZE", "Dialect", "client_id", "header", "inline_reply", "inline_request", "split_header"]

HEADER_SIZE: Final = 16
"""Bytes before the body in the header dialect."""

UNKNOWN_SEQUENCE: Final = -1 << 32
"""SEQUENCENUMBER_UNKNOWN (DDSI-RTPS 2.3, 8.3.5.4)."""


class Dialect(Enum):
    """How a peer relates replies to requests."""

    INLINE = "inline"
    HEADER = "header"

    @classmethod
    def of(cls, vendor: bytes) -> "Dialect":
        """That of a vendor."""
        return cls.HEADER if vendor == VENDOR_CYCLONE else cls.INLINE


def inline_request(reader: bytes) -> bytes:
    """Inline QoS of a request whose reply is awaited by `reader` (a gid)."""
    return inline_qos(related=identity_of(reader, UNKNOWN_SEQUENCE))


def inline_reply(client: bytes, sequence: int) -> bytes:
    """Inline QoS of the reply to the request `sequence` of `client` (the gid that its request named)."""
    return inline_qos(related=identity_of(client, sequence))


def client_id(gid: bytes) -> int:
    """The id that the client with this gid uses in headers."""
    return int.from_bytes(blake2b(gid, digest_size=8).digest(), "little")


def header(client: int, sequence: int, representation: int = CDR_LE) -> bytes:
    """What stands before the body."""
    return struct.pack(_order(representation) + "Qq", client, sequence)


def split_header(body: bytes, representation: int) -> tuple[int, int] | None:
    """Client and sequence number of a header; None when there is none."""
    if len(body) < HEADER_SIZE:
        return None
    client, sequence = struct.unpack_from(_order(representation) + "Qq", body)
    return client, sequence


def _order(representation: int) -> str:
    """Even identifiers are those of big-endian representations."""
    return "<" if representation & 1 else ">"
