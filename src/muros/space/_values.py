"""What passes through the door of a space: topics, services, samples and their identities."""

import struct
from dataclasses import dataclass
from typing import Final, NamedTuple

__all__ = [
    "CDR_BE",
    "CDR_LE",
    "Reply",
    "Request",
    "Sample",
    "Service",
    "Topic",
    "identity_of",
    "split_identity",
]

CDR_BE: Final = 0x0000
"""Representation: classic CDR, big endian (DDSI-RTPS 2.5, 10.2, representation identifier)."""

CDR_LE: Final = 0x0001
"""Representation: classic CDR, little endian."""

GID_SIZE: Final = 16
"""Bytes of a gid: DDSI-RTPS GUID, 12 of prefix, 3 of entity key, 1 of entity kind."""

IDENTITY_SIZE: Final = 24
"""Bytes of a sample identity: gid, sequence high (i32) and low (u32)."""

_SEQUENCE: Final = struct.Struct("<iI")


class Topic(NamedTuple):
    """A topic by its DDS names: `Topic("rt/chatter", "std_msgs::msg::dds_::String_")`."""

    name: str
    type_name: str


@dataclass(frozen=True, slots=True)
class Service:
    """A service and the two topics that carry it, by their DDS names.

    `Service("/add", "rq/addRequest", "rr/addReply", "p::srv::dds_::Add_Request_", "p::srv::dds_::Add_Response_")`
    """

    name: str
    request_topic: str
    reply_topic: str
    request_type: str
    reply_type: str


class Sample:
    """One sample, its body untouched. Shared by all readers that hold it: do not change it."""

    __slots__ = ("data", "expires", "related", "representation", "sequence", "source_time", "writer_gid")

    data: bytes
    """CDR body, without encapsulation header."""
    source_time: int
    """When it was written, ns."""
    writer_gid: bytes
    """Who wrote it, 16 bytes."""
    sequence: int
    """Its number among the writer's samples, from 1."""
    related: bytes | None
    """For a reply: identity (24 bytes) of the request it answers."""
    representation: int
    """How `data` is encoded: `CDR_LE` unless said otherwise."""
    expires: int
    """When it becomes worthless, ns of the space's clock; 0 = never."""

    def __init__(
        self,
        data: bytes,
        source_time: int,
        writer_gid: bytes,
        sequence: int,
        related: bytes | None = None,
        representation: int = CDR_LE,
        expires: int = 0,
    ) -> None:
        self.data = data
        self.source_time = source_time
        self.writer_gid = writer_gid
        self.sequence = sequence
        self.related = related
        self.representation = representation
        self.expires = expires

    @property
    def identity(self) -> bytes:
        """What a reply to this sample has to name: 24 bytes."""
        return identity_of(self.writer_gid, self.sequence)

    def __repr__(self) -> str:
        return f"<Sample {self.sequence} of {self.writer_gid.hex()}, {len(self.data)} B>"


class Request(NamedTuple):
    """A request as a server takes it."""

    identity: bytes
    """To be given back with the reply, 24 bytes."""
    data: bytes
    sample: Sample


class Reply(NamedTuple):
    """A reply as a client takes it."""

    sequence: int
    """What `send` returned for the request."""
    data: bytes
    sample: Sample


def identity_of(writer_gid: bytes, sequence: int) -> bytes:
    """SampleIdentity of DDS-RPC 1.0, 7.5.1.1.1: the writer's GUID, then the sequence number, little endian."""
    return writer_gid + _SEQUENCE.pack(sequence >> 32, sequence & 0xFFFFFFFF)


def split_identity(identity: bytes) -> tuple[bytes, int]:
    """Writer gid and sequence of a sample identity. ValueError unless it is 24 bytes long."""
    if len(identity) != IDENTITY_SIZE:
        raise ValueError(f"a sample identity has {IDENTITY_SIZE} bytes, this one has {len(identity)}")
    high, low = _SEQUENCE.unpack_from(identity, GID_SIZE)
    return bytes(identity[:GID_SIZE]), (high << 32) + low
