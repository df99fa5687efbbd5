"""What participants of all engines have in common: identity, children, what they say of QoS they cannot keep."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from itertools import count
from typing import Any, Final, Generic, NamedTuple, TypeAlias, TypeVar, cast

from muros.findings import Severity
from muros.space._core import Core
from muros.space._door import ClosedError
from muros.space._endpoint import Closing, EngineEndpoint
from muros.space._graph import ParticipantInfo, full_name
from muros.space._qos import Durability, Qos
from muros.space._services import EngineReplier, EngineRequester
from muros.space._values import Service, Topic

__all__ = ["Child", "EngineParticipant", "Makers", "prefix_of", "prefixes"]

WRITER_KIND: Final = 0x03
"""Entity kind of a user's writer without key (DDSI-RTPS 2.5, 9.3.1.2)."""

READER_KIND: Final = 0x04
"""Entity kind of a user's reader without key."""

PARTICIPANT_ID: Final = b"\x00\x00\x01\xc1"
"""Entity id of a participant."""

FIRST_NUMBER: Final = 0x800000
"""Numbers of entities without a key of their own count from here; there are 24 bits."""

Child: TypeAlias = EngineEndpoint | EngineRequester | EngineReplier

_Writer = TypeVar("_Writer", bound=EngineEndpoint)
_Reader = TypeVar("_Reader", bound=EngineEndpoint)
_Requester = TypeVar("_Requester", bound=EngineRequester)
_Replier = TypeVar("_Replier", bound=EngineReplier)


class Makers(NamedTuple, Generic[_Writer, _Reader, _Requester, _Replier]):
    """What an engine makes the entities of its participants with; they are not open yet."""

    writer: Callable[[Any, Topic, Qos, bytes], _Writer]
    """Of a participant, a topic, QoS and a gid; a reader also of what it calls when something has come."""
    reader: Callable[[Any, Topic, Qos, bytes, Callable[[Any], object] | None], _Reader]
    requester: Callable[..., _Requester]
    """Of a participant, a service, QoS, gids of writer and reader, and the two callbacks of the door."""
    replier: Callable[..., _Replier]


class EngineParticipant(Closing, Generic[_Writer, _Reader, _Requester, _Replier]):
    """Somebody in the space. See `muros.space.Participant`.

    An engine says what it makes (`makers`), opens it for others (`open_child`) and takes it out (`take_out`).
    """

    __slots__ = (
        "_children", "_next", "closed", "core", "domain", "enclave", "gid", "name", "namespace", "owner",
    )  # fmt: skip

    makers: Makers[_Writer, _Reader, _Requester, _Replier]

    def __init__(
        self, core: Core, domain: int, prefix: bytes, name: str, namespace: str, enclave: str, owner: str
    ) -> None:
        self.core = core
        self.domain = domain
        self.gid = prefix + PARTICIPANT_ID
        self.name = name
        self.namespace = namespace
        self.enclave = enclave
        self.owner = owner or (full_name(namespace, name) if name else f"participant {prefix.hex()}")
        self.closed = False
        self._children: list[Child] = []
        self._next = FIRST_NUMBER

    def writer(self, topic: Topic, qos: Qos | None = None, *, key: int | None = None) -> _Writer:
        """A new writer."""
        qos = self.settled(qos, "dds_writer", topic.name, holds=False)
        gids = self.gids(key, WRITER_KIND)
        writer = self.makers.writer(self, topic, qos, gids[0])
        self.open_child(writer, gids, writer)
        return writer

    def reader(
        self,
        topic: Topic,
        qos: Qos | None = None,
        on_data: Callable[[Any], object] | None = None,
        *,
        key: int | None = None,
    ) -> _Reader:
        """A new reader."""
        qos = self.settled(qos, "dds_reader", topic.name)
        gids = self.gids(key, READER_KIND)
        reader = self.makers.reader(self, topic, qos, gids[0], on_data)
        self.open_child(reader, gids, reader)
        return reader

    def requester(
        self,
        service: Service,
        qos: Qos | None = None,
        on_reply: Callable[[int, bytes], object] | None = None,
        *,
        on_data: Callable[[Any], object] | None = None,
        key: int | None = None,
    ) -> _Requester:
        """A new client of a service."""
        qos = self.settled(qos, "services_default", service.name)
        gids = self.gids(key, WRITER_KIND, READER_KIND)
        requester = self.makers.requester(self, service, qos, *gids, on_reply, on_data)
        self.open_child(requester, gids, *self.parts(requester))
        return requester

    def replier(
        self,
        service: Service,
        qos: Qos | None = None,
        on_request: Callable[[bytes, bytes], object] | None = None,
        *,
        on_data: Callable[[Any], object] | None = None,
        key: int | None = None,
    ) -> _Replier:
        """A new server of a service."""
        qos = self.settled(qos, "services_default", service.name)
        gids = self.gids(key, WRITER_KIND, READER_KIND)
        replier = self.makers.replier(self, service, qos, *gids, on_request, on_data)
        self.open_child(replier, gids, *reversed(self.parts(replier)))  # no request may come before
        return replier

    def open_child(self, child: Child, gids: list[bytes], *endpoints: _Writer | _Reader) -> None:
        """`child` is one of the children from now on; `endpoints`, its parts, come into the space in this order."""
        raise NotImplementedError

    @property
    def endpoints(self) -> tuple[_Writer | _Reader, ...]:
        """The writers and readers made here, those of services too."""
        return tuple(endpoint for child in self._children for endpoint in self.parts(child))

    @staticmethod
    def parts(child: Child) -> tuple[_Writer | _Reader, ...]:
        """What a child is made of: itself, or the reader and the writer of its side of a service."""
        return cast("tuple[_Writer | _Reader, ...]", child.endpoints)

    def in_use(self, gid: bytes) -> bool:
        """Whether one of its endpoints has this gid."""
        raise NotImplementedError

    def take_out(self, child: Child) -> None:
        """Take a child out of the space."""
        raise NotImplementedError

    def close_child(self, child: Child) -> None:
        """A child is to be closed; it may be already."""
        if not child.closed:
            self._children.remove(child)
            self.take_out(child)
            self.core.settle()

    def info(self) -> ParticipantInfo:
        """Itself as a value."""
        return ParticipantInfo(self.gid, self.name, self.namespace, self.domain, self.enclave, self.owner)

    def __repr__(self) -> str:
        return f"<participant {self.owner} in domain {self.domain}{', closed' if self.closed else ''}>"

    def gids(self, key: int | None, *kinds: int) -> list[bytes]:
        """Gids for one number, which is `key` or the next free one."""
        if self.closed:
            raise ClosedError(f"participant {self.owner} is closed; make a new one")
        if key is None:
            number, self._next = self._next, self._next + 1
        elif 0 <= key < FIRST_NUMBER:
            number = key
        else:
            raise ValueError(f"key {key} of an entity must be from 0 to {FIRST_NUMBER - 1:#x}")
        gids = [self.gid[:12] + (number << 8 | kind).to_bytes(4, "big") for kind in kinds]
        if any(self.in_use(gid) for gid in gids):
            raise ValueError(
                f"key {key} is in use in {self.owner}; close its entity first, or take another key"
            )
        return gids

    def settled(self, qos: Qos | None, preset: str, about: str, *, holds: bool = True) -> Qos:
        """`qos` as this engine can keep it; what it cannot is a finding. `holds`: it is of who holds samples."""
        if qos is None:
            return Qos.preset(preset)
        if qos.durability > Durability.TRANSIENT_LOCAL:
            self.core.report(
                "durability-lowered",
                who=self.owner,
                subject=about,
                what=f"{about} of {self.owner} is transient local instead of {qos.durability.name.lower()}",
                why="there is no service that keeps samples after their writer has gone",
                remedy="Ask for transient local",
                severity=Severity.INFO,
            )
            qos = qos.replace(durability=Durability.TRANSIENT_LOCAL)
        limit = self.core.limits.resource_limit
        if (holds or qos.durability) and not qos.keeps_all and qos.depth > limit:
            self.core.report(
                "depth-limited",
                who=self.owner,
                subject=about,
                what=f"{about} of {self.owner} keeps the last {limit} instead of {qos.depth}",
                why="that is the limit of this space",
                remedy="Ask for a smaller depth, or give the space a greater resource_limit",
                severity=Severity.INFO,
            )
        return qos


def prefixes(seed: bytes) -> Callable[[], bytes]:
    """A source of gid prefixes: 8 bytes of `seed`, then a counter."""
    numbers = count(1)
    return lambda: seed[:8] + (next(numbers) & 0xFFFFFFFF).to_bytes(4, "big")


def prefix_of(key: bytes) -> bytes:
    """The 12 bytes of a gid prefix for a participant's key."""
    if not key:
        raise ValueError("the key of a participant is empty; leave it out, or give at least one byte")
    return bytes(key) if len(key) == 12 else hashlib.blake2b(key, digest_size=12).digest()
