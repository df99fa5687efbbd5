"""Participants of the local space and the domains they live in."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import Final, TypeAlias

from muros.findings import Severity
from muros.space._core import Core
from muros.space._door import ClosedError
from muros.space._endpoint import Closing, LocalEndpoint
from muros.space._graph import Appeared, ParticipantInfo, Vanished, full_name
from muros.space._qos import Durability, Qos
from muros.space._values import Service, Topic
from muros.space.local._matching import TopicRecord
from muros.space.local._reader import LocalReader
from muros.space.local._services import LocalReplier, LocalRequester
from muros.space.local._writer import LocalWriter

__all__ = ["Domain", "LocalParticipant"]

WRITER_KIND: Final = 0x03
"""Entity kind of a user's writer without key (DDSI-RTPS 2.5, 9.3.1.2)."""

READER_KIND: Final = 0x04
"""Entity kind of a user's reader without key."""

PARTICIPANT_ID: Final = b"\x00\x00\x01\xc1"
"""Entity id of a participant."""

FIRST_NUMBER: Final = 0x800000
"""Numbers of entities without a key of their own count from here; there are 24 bits."""

Child: TypeAlias = LocalEndpoint | LocalRequester | LocalReplier


class Domain:
    """One world: its topics, endpoints by gid, participants by gid prefix."""

    __slots__ = ("endpoints", "number", "participants", "topics")

    def __init__(self, number: int) -> None:
        self.number = number
        self.topics: dict[str, TopicRecord] = {}
        self.endpoints: dict[bytes, LocalEndpoint] = {}
        self.participants: dict[bytes, LocalParticipant] = {}


class LocalParticipant(Closing):
    """Somebody in the space. See `muros.space.Participant`."""

    __slots__ = (
        "_children", "_next", "closed", "core", "enclave", "gid", "home", "name", "namespace", "owner",
    )  # fmt: skip

    def __init__(
        self, core: Core, home: Domain, prefix: bytes, name: str, namespace: str, enclave: str, owner: str
    ) -> None:
        self.core = core
        self.home = home
        self.gid = prefix + PARTICIPANT_ID
        self.name = name
        self.namespace = namespace
        self.enclave = enclave
        self.owner = owner or (full_name(namespace, name) if name else f"participant {prefix.hex()}")
        self.closed = False
        self._children: list[Child] = []
        self._next = FIRST_NUMBER
        home.participants[prefix] = self
        if core.watchers:
            core.tell(Appeared(self.info()))
            core.settle()

    @property
    def domain(self) -> int:
        """Number of its domain."""
        return self.home.number

    def writer(self, topic: Topic, qos: Qos | None = None, *, key: int | None = None) -> LocalWriter:
        """A new writer."""
        qos = self._settled(qos, "dds_writer", topic.name)
        self._limit_depth(qos, topic.name, holds=qos.durability != Durability.VOLATILE)
        writer = LocalWriter(self, topic, qos, self._gids(key, WRITER_KIND)[0])
        self._add(writer, writer)
        return writer

    def reader(
        self,
        topic: Topic,
        qos: Qos | None = None,
        on_data: Callable[[LocalReader], object] | None = None,
        *,
        key: int | None = None,
    ) -> LocalReader:
        """A new reader."""
        qos = self._settled(qos, "dds_reader", topic.name)
        self._limit_depth(qos, topic.name)
        reader = LocalReader(self, topic, qos, self._gids(key, READER_KIND)[0], on_data)
        self._add(reader, reader)
        return reader

    def requester(
        self,
        service: Service,
        qos: Qos | None = None,
        on_reply: Callable[[int, bytes], object] | None = None,
        *,
        on_data: Callable[[LocalRequester], object] | None = None,
        key: int | None = None,
    ) -> LocalRequester:
        """A new client of a service."""
        qos = self._settled(qos, "services_default", service.name)
        self._limit_depth(qos, service.name)
        writer_gid, reader_gid = self._gids(key, WRITER_KIND, READER_KIND)
        requester = LocalRequester(self, service, qos, writer_gid, reader_gid, on_reply, on_data)
        self._add(requester, requester.reader, requester.writer)
        return requester

    def replier(
        self,
        service: Service,
        qos: Qos | None = None,
        on_request: Callable[[bytes, bytes], object] | None = None,
        *,
        on_data: Callable[[LocalReplier], object] | None = None,
        key: int | None = None,
    ) -> LocalReplier:
        """A new server of a service."""
        qos = self._settled(qos, "services_default", service.name)
        self._limit_depth(qos, service.name)
        writer_gid, reader_gid = self._gids(key, WRITER_KIND, READER_KIND)
        replier = LocalReplier(self, service, qos, writer_gid, reader_gid, on_request, on_data)
        self._add(replier, replier.writer, replier.reader)
        return replier

    def close(self) -> None:
        """Leave the space with everything made here, in one go."""
        if self.closed:
            return
        self.closed = True
        children, self._children = self._children, []
        for child in reversed(children):
            self._take_out(child)
        del self.home.participants[self.gid[:12]]
        if self.core.watchers:
            self.core.tell(Vanished(self.info()))
        self.core.settle()

    def remove(self, child: Child) -> None:
        """One of the children is being closed."""
        self._children.remove(child)
        self._take_out(child)

    def record(self, topic: Topic) -> TopicRecord:
        """Who is on a topic."""
        name = topic.name
        record = self.home.topics.get(name)
        if record is None:
            record = self.home.topics[name] = TopicRecord(name)
        return record

    def info(self) -> ParticipantInfo:
        """Itself as a value."""
        return ParticipantInfo(self.gid, self.name, self.namespace, self.domain, self.enclave, self.owner)

    def __repr__(self) -> str:
        return f"<participant {self.owner} in domain {self.domain}{', closed' if self.closed else ''}>"

    def _add(self, child: Child, *endpoints: LocalEndpoint) -> None:
        self._children.append(child)
        for endpoint in endpoints:
            self.home.endpoints[endpoint.gid] = endpoint
            if self.core.watchers:
                self.core.tell(Appeared(endpoint.info()))
            self.record(endpoint.topic).join(endpoint)
        self.core.settle()
        self.core.poke()

    def _take_out(self, child: Child) -> None:
        endpoints = (child,) if isinstance(child, LocalEndpoint) else (child.reader, child.writer)
        for endpoint in endpoints:
            record = self.record(endpoint.topic)
            record.leave(endpoint)
            if record.empty:
                del self.home.topics[record.name]
            del self.home.endpoints[endpoint.gid]
            if self.core.watchers:
                self.core.tell(Vanished(endpoint.info()))
        child.detach()

    def _gids(self, key: int | None, *kinds: int) -> list[bytes]:
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
        if any(gid in self.home.endpoints for gid in gids):
            raise ValueError(
                f"key {key} is in use in {self.owner}; close its entity first, or take another key"
            )
        return gids

    def _settled(self, qos: Qos | None, preset: str, about: str) -> Qos:
        """`qos` as this engine can keep it; what it cannot is a finding."""
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
        return qos

    def _limit_depth(self, qos: Qos, about: str, *, holds: bool = True) -> None:
        """Say so when an endpoint that holds samples will hold fewer than it was asked to."""
        limit = self.core.limits.resource_limit
        if holds and not qos.keeps_all and qos.depth > limit:
            self.core.report(
                "depth-limited",
                who=self.owner,
                subject=about,
                what=f"{about} of {self.owner} keeps the last {limit} instead of {qos.depth}",
                why="that is the limit of this space",
                remedy="Ask for a smaller depth, or give the space a greater resource_limit",
                severity=Severity.INFO,
            )


def prefixes(seed: bytes) -> Callable[[], bytes]:
    """A source of gid prefixes: 8 bytes of `seed`, then a counter."""
    numbers = count(1)
    return lambda: seed[:8] + (next(numbers) & 0xFFFFFFFF).to_bytes(4, "big")
