"""One domain of the cyclonedds engine: who of this space is in it, and what Cyclone has discovered of the others.

Theory of operation. One hidden participant, the *observer*, reads Cyclone's built-in topics (participants, writers,
readers) and `ros_discovery_info`. A `Watch` tells which entities of Cyclone have news; `fetch` then takes it: first
what was discovered, then who matches, then samples. It is called by the event loop when the watch asks for it, and at
the end of every call that may have caused something, for among the participants of one process all of this happens
inside the call that causes it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from itertools import count
from typing import TYPE_CHECKING, Any, Final

from muros._distros import OLD_DISTROS
from muros.rtps import user_values, vendor_name
from muros.rtps._constants import VENDOR_CYCLONE, VENDOR_EPROSIMA
from muros.space import _reports
from muros.space._core import Core
from muros.space._door import SpaceError
from muros.space._graph import (
    Appeared,
    Assigned,
    Endpoint,
    Incompatible,
    Matched,
    ParticipantInfo,
    Role,
    Unmatched,
    Vanished,
    full_name,
)
from muros.space._participant import PARTICIPANT_ID
from muros.space._qos import Mismatch, mismatches
from muros.space._timers import Timer
from muros.space._values import GID_SIZE
from muros.space.cyclone._endpoints import CycloneReader, CycloneWriter, encapsulated
from muros.space.cyclone._opaque import opaque_type, unannounced
from muros.space.cyclone._participant import CycloneParticipant, delete
from muros.space.cyclone._policies import from_policies, to_policies, user_data
from muros.space.cyclone._watch import Watch
from muros.space.dds._discovery_info import (
    GID_SIZE_OLD,
    INFO_QOS,
    INFO_TOPIC,
    DiscoveryInfo,
    InvalidDiscoveryInfo,
    NodeEntities,
    told_by,
)
from muros.space.dds._names import service_of, type_hash

if TYPE_CHECKING:
    import asyncio

__all__ = ["CycloneDomain", "Remote"]

DEBOUNCE: Final = 10_000_000
"""ns in which changes of a node are gathered before others are told."""

AT_ONCE: Final = 1000
"""Samples of built-in topics read in one call."""

ROUNDS: Final = 64
"""Times in one go that is looked whether there is more, before others on the event loop get their turn."""

DATA: Final = 1 << 8
"""Status DATA_AVAILABLE, in the words of Cyclone."""

WRITER_MATCHES: Final = 1 << 11
"""Status PUBLICATION_MATCHED."""

READER_MATCHES: Final = 1 << 12
"""Status SUBSCRIPTION_MATCHED."""

ALIVE: Final = 16
"""Instance state of what is there, in the words of Cyclone."""


class Remote:
    """A participant of somebody else, its nodes and endpoints."""

    def __init__(self, gid: bytes, domain: int, enclave: str = "") -> None:
        # Cyclone does not tell the vendor; these two begin their gids with it.
        vendor = vendor_name(gid[:2]) if gid[:2] in (VENDOR_CYCLONE, VENDOR_EPROSIMA) else ""
        owner = f"participant {gid[:12].hex()}" + (f" ({vendor})" if vendor else "")
        self.bare = ParticipantInfo(gid, "", "/", domain, enclave, owner, vendor)
        self.endpoints: dict[bytes, Endpoint] = {}
        self._nodes: tuple[ParticipantInfo, ...] = ()
        self._node_of: dict[bytes, ParticipantInfo] = {}

    @property
    def infos(self) -> tuple[ParticipantInfo, ...]:
        """Its nodes, or itself while it has none."""
        return self._nodes or (self.bare,)

    def info_of(self, gid: bytes) -> ParticipantInfo:
        """The node that has an endpoint; itself when none says so."""
        return self._node_of.get(gid, self.bare)

    def set_nodes(self, nodes: tuple[NodeEntities, ...]) -> None:
        """These are its nodes now."""
        bare, infos = self.bare, []
        self._node_of = {}
        for node in nodes:
            owner = full_name(node.namespace, node.name)
            info = ParticipantInfo(
                bare.gid, node.name, node.namespace, bare.domain, bare.enclave, owner, bare.vendor
            )
            infos.append(info)
            self._node_of.update(dict.fromkeys((*node.readers, *node.writers), info))
        self._nodes = tuple(infos)


class CycloneDomain:
    """One domain, as one space is in it."""

    def __init__(self, number: int, core: Core, ros_distro: str | None = None) -> None:
        self.number = number
        self.core = core
        self.wall: Callable[[], int] = time.time_ns
        self.participants: dict[bytes, CycloneParticipant] = {}
        self.endpoints: dict[bytes, CycloneReader | CycloneWriter] = {}
        """Ours, by gid."""
        self.remotes: dict[bytes, Remote] = {}
        """Participants of others, by prefix."""
        self.pairs: dict[tuple[bytes, bytes], None] = {}
        """Writers and readers that match, at least one of them ours."""
        self.closed = False
        self._distro = ros_distro
        self._gid_size = GID_SIZE_OLD if ros_distro in OLD_DISTROS else GID_SIZE
        self._handles: dict[int, bytes] = {}
        """Gids of endpoints, by the number that Cyclone gives them in this process."""
        self._numbers = count(1)
        self._looks: dict[int, Callable[[], None]] = {}
        """What to do about news of the observer's readers."""
        self._by_number: dict[int, CycloneReader | CycloneWriter] = {}
        self._fresh: list[CycloneReader | CycloneWriter] = []
        """Endpoints not looked at yet."""
        self._resumed: list[CycloneReader] = []
        self._fetching = False
        self._dirty: dict[CycloneParticipant, None] = {}
        self._timer: Timer | None = None
        self._observer = self.make_participant("", "muros observer")
        self._own = {self._observer.guid.bytes[:12]}
        self._watch = Watch(self._observer)
        self._open_observer()

    # --- News ------------------------------------------------------------------------------------------------

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """Have the loop called when Cyclone has something."""

        def notify() -> None:
            with suppress(RuntimeError):  # the loop is closed
                loop.call_soon_threadsafe(self._called)

        self._watch.start(notify)
        loop.call_soon(self._called)

    def watch(self, endpoint: CycloneReader | CycloneWriter) -> None:
        """Learn of news of an endpoint of ours."""
        number = next(self._numbers)
        self._by_number[number] = endpoint
        endpoint.number = number
        self._watch.add(
            endpoint.entity, number, DATA | READER_MATCHES if endpoint.role is Role.READER else WRITER_MATCHES
        )
        self._fresh.append(endpoint)

    def resume(self, reader: CycloneReader) -> None:
        """A reader that was full has room: what it left behind is to be taken soon."""
        if reader not in self._resumed:
            self._resumed.append(reader)
            self.core.need(self.core.clock())

    def hold(self, reader: CycloneReader) -> None:
        """A reader is full: its news is of no use."""
        reader.entity.set_status_mask(READER_MATCHES)

    def fetch(self) -> None:
        """Take what there is: what was discovered, who matches, samples."""
        if self._fetching or self.closed:
            return
        self._fetching = True
        try:
            for _ in range(ROUNDS):
                numbers = self._watch.poll()
                if not numbers and not self._fresh and not self._resumed:
                    break
                self._handle(sorted(numbers))
            else:
                self.core.need(self.core.clock())
        finally:
            self._fetching = False
        if self.core.queue and not self.core.draining:
            self.core.poke()

    def _handle(self, numbers: list[int]) -> None:
        fresh, self._fresh = self._fresh, []
        resumed, self._resumed = self._resumed, []
        for number in numbers:
            if number in self._looks:
                self._looks[number]()
        endpoints = [*fresh, *(self._by_number[n] for n in numbers if n in self._by_number)]
        for endpoint in endpoints:
            if not endpoint.closed:
                matches = READER_MATCHES if endpoint.role is Role.READER else WRITER_MATCHES
                if endpoint.entity.take_status(matches) or endpoint in fresh:
                    self._refresh(endpoint)
        for endpoint in (*endpoints, *resumed):
            if isinstance(endpoint, CycloneReader) and not endpoint.closed:
                if endpoint in resumed:
                    endpoint.entity.set_status_mask(DATA | READER_MATCHES)
                endpoint.fetch()

    def _called(self) -> None:
        if not self.closed:
            self.fetch()
            self.core.drain()
            self.core.settle()
            self._watch.handled()

    @property
    def waits(self) -> bool:
        """Whether there is something to fetch that nobody was asked to."""
        return bool(self._fresh or self._resumed)

    # --- Ours ------------------------------------------------------------------------------------------------

    def make_participant(self, enclave: str, name: str) -> Any:
        """A participant of Cyclone."""
        from cyclonedds.core import DDSException
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.qos import Policy, Qos

        policies = [Policy.EntityName(name)] if name else []
        if enclave:
            policies.append(Policy.Userdata(f"enclave={enclave};".encode()))
        try:
            return DomainParticipant(self.number, Qos(*policies))
        except DDSException as error:
            raise SpaceError(
                f"Cyclone DDS cannot take part in domain {self.number}: {error} "
                "Look at CYCLONEDDS_URI and at the network interfaces"
            ) from None

    def join(self, participant: CycloneParticipant) -> None:
        """A participant of ours has come."""
        prefix = participant.gid[:12]
        self.participants[prefix] = participant
        self._own.add(prefix)
        if self.core.watchers:
            self.core.tell(Appeared(participant.info()))
        if participant.name:
            participant.told = self._info_endpoint(participant.entity, writes=True)
            self.changed(participant)
        self.fetch()

    def leave(self, participant: CycloneParticipant) -> None:
        """A participant of ours goes; its endpoints are out of the books already."""
        del self.participants[participant.gid[:12]]
        self._dirty.pop(participant, None)
        self._tell_node(participant)

    def forget(self, endpoint: CycloneReader | CycloneWriter) -> None:
        """An endpoint of ours goes."""
        for gid in endpoint.matched:
            self.parted(endpoint, gid)
        endpoint.matched = ()
        del self.endpoints[endpoint.gid]
        del self._by_number[endpoint.number]

    def changed(self, participant: CycloneParticipant) -> None:
        """The endpoints of a node are others than before: tell everybody soon."""
        if participant.told is not None and not participant.closed:
            self._dirty[participant] = None
            if self._timer is None:
                self._timer = self.core.timers.at(self.core.timers.now() + DEBOUNCE, self._tell_nodes)

    def close(self) -> None:
        """Leave the domain."""
        for participant in tuple(self.participants.values()):
            participant.close()
        self.closed = True
        self._watch.close()
        for entity in self._observed:
            delete(entity)
        delete(self._observer)

    def type_hash(self, type_name: str) -> str:
        """Hash of a type's definition, if it is known."""
        return type_hash(type_name, self._distro)

    def lifespan_of(self, gid: bytes) -> int:
        """Lifespan of the samples of a writer, ns; 0 = for ever."""
        shown = self.endpoint_shown(gid)
        return 0 if shown is None else shown.qos.lifespan

    def gid_of(self, endpoint: CycloneReader | CycloneWriter, handle: int) -> bytes:
        """Gid of a counterpart of an endpoint by Cyclone's number for it; empty when it is unknown."""
        handle &= 0xFFFF_FFFF_FFFF_FFFF
        gid = self._handles.get(handle)
        if gid is None:
            entity = endpoint.entity
            data = (
                entity.get_matched_publication_data(handle)
                if endpoint.role is Role.READER
                else entity.get_matched_subscription_data(handle)
            )
            if data is None:
                return b""
            gid = self._handles[handle] = data.key.bytes
        return gid

    def met(self, endpoint: CycloneReader | CycloneWriter, gid: bytes) -> None:
        """An endpoint of ours matches another one."""
        pair = _pair(endpoint, gid)
        if pair not in self.pairs:
            self.pairs[pair] = None
            self._tell_pair(Matched, pair)

    def parted(self, endpoint: CycloneReader | CycloneWriter, gid: bytes) -> None:
        """An endpoint of ours and another one match no more."""
        pair = _pair(endpoint, gid)
        if pair in self.pairs:
            del self.pairs[pair]
            self._tell_pair(Unmatched, pair)

    def _refresh(self, endpoint: CycloneReader | CycloneWriter) -> None:
        """Ask Cyclone who matches an endpoint now."""
        if endpoint.closed:
            return
        entity = endpoint.entity
        reads = endpoint.role is Role.READER
        handles = entity.get_matched_publications() if reads else entity.get_matched_subscriptions()
        now = tuple(gid for handle in handles if (gid := self.gid_of(endpoint, handle)))
        before, endpoint.matched = endpoint.matched, now
        for gid in before:
            if gid not in now:
                self.parted(endpoint, gid)
                endpoint.disconnected(gid)
        for gid in now:
            if gid not in before:
                self.met(endpoint, gid)
                endpoint.connected(gid)

    def compare(self, endpoint: CycloneReader | CycloneWriter) -> None:
        """Say with which of the endpoints that are there one of ours does not fit."""
        shown = endpoint.info()
        for other in (*(own.info() for own in self.endpoints.values()), *self.remote_endpoints()):
            if other.topic == shown.topic and other.role is not shown.role:
                self._compare(*((shown, other) if shown.role is Role.WRITER else (other, shown)))

    def _compare(self, writer: Endpoint, reader: Endpoint) -> None:
        reasons: tuple[Mismatch, ...]
        if writer.type_name != reader.type_name:
            reasons = (_reports.types_differ(writer.type_name, reader.type_name),)
        else:
            reasons = mismatches(writer.qos, reader.qos)
        if not reasons:
            return
        core = self.core
        if core.watchers:
            core.tell(Incompatible(writer, reader, tuple(str(reason) for reason in reasons)))
        ours = reader.participant if reader.gid in self.endpoints else writer.participant
        names = (reader.participant.owner, writer.participant.owner)
        told = partial(_reports.mismatched, core, *names, reader.topic, reasons, who=ours.owner)
        core.notices.append(told)

    def _tell_pair(self, kind: type[Matched] | type[Unmatched], pair: tuple[bytes, bytes]) -> None:
        if self.core.watchers:
            writer, reader = self.endpoint_shown(pair[0]), self.endpoint_shown(pair[1])
            if writer is not None and reader is not None:
                self.core.tell(kind(writer, reader))

    # --- What the graph reads --------------------------------------------------------------------------------

    def shown(self, endpoint: Endpoint) -> Endpoint:
        """An endpoint of others as a value."""
        return endpoint

    def remote_endpoints(self) -> Iterator[Endpoint]:
        """All writers and readers of others."""
        for remote in self.remotes.values():
            yield from remote.endpoints.values()

    def endpoint_shown(self, gid: bytes) -> Endpoint | None:
        """The writer or reader with this gid, ours or somebody else's."""
        own = self.endpoints.get(gid)
        if own is not None:
            return own.info()
        remote = self.remotes.get(gid[:12])
        return None if remote is None else remote.endpoints.get(gid)

    def carries_requests(self, endpoint: Endpoint) -> bool:
        """Whether it is the request side of a service."""
        own = self.endpoints.get(endpoint.gid)
        return endpoint.topic.startswith("rq/") if own is None else own.carries_requests

    def concerns(self, pair: tuple[bytes, bytes]) -> bool:
        """Whether one of the two is ours, so that it is known whether they match."""
        return pair[0] in self.endpoints or pair[1] in self.endpoints

    # --- What is discovered ----------------------------------------------------------------------------------

    def _open_observer(self) -> None:
        from cyclonedds.builtin import (
            BuiltinDataReader,
            BuiltinTopicDcpsParticipant,
            BuiltinTopicDcpsPublication,
            BuiltinTopicDcpsSubscription,
        )

        self._observed: list[Any] = []
        for look, entity in (
            (self._look_at_participants, BuiltinDataReader(self._observer, BuiltinTopicDcpsParticipant)),
            (self._look_at_writers, BuiltinDataReader(self._observer, BuiltinTopicDcpsPublication)),
            (self._look_at_readers, BuiltinDataReader(self._observer, BuiltinTopicDcpsSubscription)),
            (self._look_at_nodes, self._info_endpoint(self._observer, writes=False)),
        ):
            number = next(self._numbers)
            self._looks[number] = partial(look, entity)
            self._watch.add(entity, number, DATA)
            self._observed.append(entity)
            look(entity)

    def _info_endpoint(self, participant: Any, *, writes: bool) -> Any:
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        topic = Topic(participant, INFO_TOPIC.name, opaque_type(INFO_TOPIC.type_name))
        policies = to_policies(INFO_QOS, self.core.limits, writes=writes)
        with unannounced(topic):
            return (DataWriter if writes else DataReader)(participant, topic, policies)

    def _look_at_participants(self, reader: Any) -> None:
        for sample in _taken(reader):
            gid = sample.key.bytes
            prefix = gid[:12]
            if prefix in self._own:
                continue
            if sample.sample_info.instance_state == ALIVE:
                if prefix not in self.remotes:
                    enclave = user_values(user_data(sample.qos)).get("enclave", "") if sample.qos else ""
                    remote = self.remotes[prefix] = Remote(gid, self.number, enclave)
                    self._tell_all(Appeared, remote.infos)
            elif (gone := self.remotes.pop(prefix, None)) is not None:
                self._tell_all(Vanished, gone.infos)

    def _look_at_writers(self, reader: Any) -> None:
        self._look_at_endpoints(Role.WRITER, reader)

    def _look_at_readers(self, reader: Any) -> None:
        self._look_at_endpoints(Role.READER, reader)

    def _look_at_endpoints(self, role: Role, reader: Any) -> None:
        for sample in _taken(reader):
            gid = sample.key.bytes
            handle = sample.sample_info.instance_handle & 0xFFFF_FFFF_FFFF_FFFF
            alive = sample.sample_info.instance_state == ALIVE and sample.topic_name is not None
            if alive:
                self._handles[handle] = gid
            prefix = gid[:12]
            if prefix in self._own:
                continue
            remote = self.remotes.get(prefix)
            if not alive:
                self._handles.pop(handle, None)
                gone = None if remote is None else remote.endpoints.pop(gid, None)
                if gone is not None and self.core.watchers:
                    self.core.tell(Vanished(gone))
                continue
            if remote is None:
                remote = self.remotes[prefix] = Remote(prefix + PARTICIPANT_ID, self.number)
                self._tell_all(Appeared, remote.infos)
            if gid not in remote.endpoints and sample.topic_name != INFO_TOPIC.name:
                hashed = user_values(user_data(sample.qos)).get("typehash", "")
                shown = Endpoint(
                    gid, role, sample.topic_name, sample.type_name, from_policies(sample.qos),
                    service_of(sample.topic_name), remote.info_of(gid), hashed,
                )  # fmt: skip
                remote.endpoints[gid] = shown
                if self.core.watchers:
                    self.core.tell(Appeared(shown))
                for own in tuple(self.endpoints.values()):
                    if own.topic.name == shown.topic and own.role is not role:
                        pair = (shown, own.info()) if role is Role.WRITER else (own.info(), shown)
                        self._compare(*pair)

    def _look_at_nodes(self, reader: Any) -> None:
        from dataclasses import replace

        from cyclonedds._clayer import ddspy_take

        got = ddspy_take(reader._ref, 0x7F, AT_ONCE)
        for payload, info in got if not isinstance(got, int) else ():
            if not info.valid_data or len(payload) < 4:
                continue
            try:
                told, size = DiscoveryInfo.parse_untrusted(payload[4:], payload[0] << 8 | payload[1])
            except InvalidDiscoveryInfo as error:
                self._unreadable(str(error))
                continue
            prefix = told.participant[:12]
            if prefix in self._own:
                continue
            if self._distro is None and size != self._gid_size:
                self._gid_size = size
                for participant in self.participants.values():
                    self.changed(participant)
            remote = self.remotes.get(prefix)
            if remote is None:
                remote = self.remotes[prefix] = Remote(told.participant, self.number)
            before = remote.infos
            remote.set_nodes(told.nodes)
            moved = []
            for gid, endpoint in remote.endpoints.items():
                if endpoint.participant != (info := remote.info_of(gid)):
                    moved.append(replace(endpoint, participant=info))
            remote.endpoints.update((endpoint.gid, endpoint) for endpoint in moved)
            self._tell_all(Vanished, tuple(info for info in before if info not in remote.infos))
            self._tell_all(Appeared, tuple(info for info in remote.infos if info not in before))
            if self.core.watchers:
                for endpoint in moved:
                    self.core.tell(Assigned(endpoint))

    def _unreadable(self, why: str) -> None:
        self.core.report(
            "discovery-info-unreadable",
            who=f"dds domain {self.number}",
            what="the nodes of {n} participant{s} are not known",
            why=why,
            remedy="Nothing, if it is no ROS 2; else look at what it writes on ros_discovery_info",
        )

    def _tell_all(self, event: type[Appeared] | type[Vanished], infos: tuple[ParticipantInfo, ...]) -> None:
        if self.core.watchers:
            for info in infos:
                self.core.tell(event(info))

    def _tell_nodes(self) -> None:
        self._timer = None
        dirty, self._dirty = self._dirty, {}
        for participant in dirty:
            self._tell_node(participant)
        self.fetch()

    def _tell_node(self, participant: CycloneParticipant) -> None:
        from cyclonedds._clayer import ddspy_write

        if participant.told is not None:
            body = told_by(participant).body(self._gid_size)
            ddspy_write(participant.told._ref, encapsulated(body))


def _taken(reader: Any) -> list[Any]:
    """Everything a built-in reader has."""
    found: list[Any] = []
    while got := reader.take(AT_ONCE):
        found += got
    return found


def _pair(endpoint: CycloneReader | CycloneWriter, gid: bytes) -> tuple[bytes, bytes]:
    return (endpoint.gid, gid) if endpoint.role is Role.WRITER else (gid, endpoint.gid)
