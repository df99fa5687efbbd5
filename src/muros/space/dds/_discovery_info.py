"""`ros_discovery_info`: which nodes a participant has and which endpoints are theirs.

DDS knows participants and endpoints, not nodes; every participant of ROS 2 writes this topic for the others
(rmw_dds_common/msg/ParticipantEntitiesInfo). Its gids have 16 bytes since ROS 2 Iron and 24 before, under the same
type name; a sample of the other size cannot be read by anybody, and is silently ignored by ROS 2. Here the size is
found by what parses exactly.
"""

import struct
from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol

from muros.space._endpoint import EngineEndpoint
from muros.space._graph import Role
from muros.space._qos import Durability, Qos
from muros.space._values import CDR_BE, CDR_LE, GID_SIZE, Topic

__all__ = [
    "GID_SIZE_OLD",
    "INFO_QOS",
    "INFO_TOPIC",
    "DiscoveryInfo",
    "InvalidDiscoveryInfo",
    "NodeEntities",
    "told_by",
]

INFO_TOPIC: Final = Topic("ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_")

INFO_QOS: Final = Qos(durability=Durability.TRANSIENT_LOCAL)
"""Reliable, for who comes later too, the last one only."""

GID_SIZE_OLD: Final = 24
"""Bytes of a gid up to ROS 2 Humble; the first 16 are the GUID, the others 0."""

MAX_BYTES: Final = 4 << 20
"""Bytes read of one sample; what is larger is refused."""

MAX_NODES: Final = 4096
"""Nodes of one participant; more are refused."""

MAX_NAME: Final = 256
"""Characters of a node's name or namespace that are kept; the type allows no more."""


class InvalidDiscoveryInfo(ValueError):  # noqa: N818
    """Foreign bytes that are no `ros_discovery_info`."""


class NodeEntities(NamedTuple):
    """One node."""

    namespace: str
    name: str
    readers: tuple[bytes, ...]
    """Gids of 16 bytes."""
    writers: tuple[bytes, ...]


class Told(Protocol):
    """A participant, as far as others are told of it."""

    gid: bytes
    namespace: str
    name: str
    closed: bool

    @property
    def endpoints(self) -> Sequence[EngineEndpoint]:
        """Its writers and readers."""


class DiscoveryInfo(NamedTuple):
    """What one participant says."""

    participant: bytes
    """Its gid, 16 bytes."""
    nodes: tuple[NodeEntities, ...]

    def body(self, gid_size: int = GID_SIZE) -> bytes:
        """As little-endian CDR, without encapsulation."""
        body = bytearray(self.participant.ljust(gid_size, b"\0"))
        _align(body)
        body += len(self.nodes).to_bytes(4, "little")
        for node in self.nodes:
            _put_text(body, node.namespace)
            _put_text(body, node.name)
            for gids in (node.readers, node.writers):
                _align(body)
                body += len(gids).to_bytes(4, "little")
                for gid in gids:
                    body += gid.ljust(gid_size, b"\0")
        return bytes(body)

    @classmethod
    def parse_untrusted(cls, body: bytes, representation: int = CDR_LE) -> "tuple[DiscoveryInfo, int]":
        """What a sample says, and the size of its gids. `InvalidDiscoveryInfo` when it is neither size."""
        if representation not in (CDR_LE, CDR_BE) or len(body) > MAX_BYTES:
            raise InvalidDiscoveryInfo(f"{len(body)} bytes in representation 0x{representation:04x}")
        order = "<" if representation == CDR_LE else ">"
        for gid_size in (GID_SIZE, GID_SIZE_OLD):
            try:
                return _Reading(body, order, gid_size).info(), gid_size
            except (struct.error, _NotThisSize):
                continue
        raise InvalidDiscoveryInfo(f"{len(body)} bytes fit neither size of gids")


def told_by(participant: Told) -> DiscoveryInfo:
    """What others are to know of a participant's node.

    One that goes says that it has none: Fast DDS does not understand Cyclone's word for that, and would believe in the
    node until the lease is over.
    """
    if participant.closed:
        return DiscoveryInfo(participant.gid, ())
    sides: dict[Role, list[bytes]] = {Role.READER: [], Role.WRITER: []}
    for endpoint in participant.endpoints:
        sides[endpoint.role].append(endpoint.gid)
    readers, writers = map(tuple, sides.values())
    return DiscoveryInfo(
        participant.gid, (NodeEntities(participant.namespace, participant.name, readers, writers),)
    )


class _NotThisSize(Exception):  # noqa: N818
    """It does not parse exactly with gids of this size."""


class _Reading:
    """One try to read a sample."""

    def __init__(self, body: bytes, order: str, gid_size: int) -> None:
        self.body = body
        self.count = struct.Struct(order + "I").unpack_from
        self.gid_size = gid_size
        self.at = 0

    def info(self) -> DiscoveryInfo:
        """All of it."""
        participant = self.gid()
        nodes = self.number()
        if nodes > MAX_NODES:
            raise _NotThisSize
        info = DiscoveryInfo(participant, tuple(self.node() for _ in range(nodes)))
        if len(self.body) - self.at > 3:  # a sample may be filled up to a multiple of 4
            raise _NotThisSize
        return info

    def node(self) -> NodeEntities:
        return NodeEntities(self.text(), self.text(), self.gids(), self.gids())

    def gids(self) -> tuple[bytes, ...]:
        number = self.number()
        if number > (len(self.body) - self.at) // self.gid_size:
            raise _NotThisSize
        return tuple(self.gid() for _ in range(number))

    def gid(self) -> bytes:
        gid = self.body[self.at : self.at + self.gid_size]
        self.at += self.gid_size
        if len(gid) != self.gid_size or any(gid[GID_SIZE:]):
            raise _NotThisSize
        return gid[:GID_SIZE]

    def text(self) -> str:
        size = self.number()
        end = self.at + size
        if end > len(self.body) or (size and self.body[end - 1]):
            raise _NotThisSize
        octets = self.body[self.at : end - 1] if size else b""
        self.at = end
        return octets.decode("utf-8", "backslashreplace")[:MAX_NAME]

    def number(self) -> int:
        at = self.at + 3 & ~3
        self.at = at + 4
        number: int = self.count(self.body, at)[0]
        return number


def _align(body: bytearray) -> None:
    body += bytes(-len(body) & 3)


def _put_text(body: bytearray, text: str) -> None:
    octets = text.encode()[:MAX_NAME] + b"\0"
    _align(body)
    body += len(octets).to_bytes(4, "little") + octets
