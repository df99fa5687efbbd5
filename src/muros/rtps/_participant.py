"""One participant of this process: its writers and readers, and which of others' they meet.

Theory of operation. Discovery (`_discovery.py`) tells of others' endpoints; `_topics` holds all of them by topic, with
the participant's own, since its writers and readers meet each other too. Whenever one comes or changes it is
compared with what there is on the other side of its topic (`_matching.py`). Those that fit are made known to each
other's cores, and the domain is told whose events are for whom; for the others the reasons are kept and told.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from muros.rtps import _matching
from muros.rtps._announcer import Announcer, Welcome
from muros.rtps._constants import EntityKind, Pid, is_builtin, is_reader, is_writer
from muros.rtps._constants import keyed as is_keyed
from muros.rtps._discovery import Discovery
from muros.rtps._discovery_data import Assertion, EndpointData, ParticipantData
from muros.rtps._endpoint import Problem, Report
from muros.rtps._limits import check_limits, limited_reader, limited_writer
from muros.rtps._liveliness import Assertions, WriterLease
from muros.rtps._local import LocalReader, LocalWriter, OnSample
from muros.rtps._news import (
    Incompatible,
    LivelinessChanged,
    Matched,
    Mismatch,
    ParticipantChanged,
    ParticipantEvent,
    ParticipantFound,
    ParticipantLost,
    Trouble,
    Unmatched,
    Why,
)
from muros.rtps._parameters import ParameterBuilder
from muros.rtps._peer import Peer
from muros.rtps._qos import Durability, EndpointQos, Liveliness, write_qos
from muros.rtps._reach import INSIDE
from muros.rtps._settings import ReaderSettings, WriterSettings
from muros.rtps._values import INFINITE, EntityId, Guid, GuidPrefix, guid_of, split_guid

if TYPE_CHECKING:
    from muros.rtps._domain import DomainCore

__all__ = ["ParticipantCore"]

FIRST_KEY: Final = 0x010000
"""Entity keys given where the user names none begin here, above those that users are likely to name."""

LAST_KEY: Final = 0xFFFFFF


class ParticipantCore:
    """One participant of this process. Made by `DomainCore.participant`."""

    def __init__(
        self,
        home: "DomainCore",
        data: ParticipantData,
        on_event: Callable[[ParticipantEvent], object] | None,
        now: int,
    ) -> None:
        self.home: Final = home
        """Its domain."""
        self.prefix: Final[GuidPrefix] = data.prefix
        self.guid: Final[Guid] = data.guid
        self.domain: Final = home.domain
        self.data = data
        """What others are told of it."""
        self.on_event = on_event
        self.closed = False
        self.held = False
        """Not yet there for others, since they are still told that an earlier life has gone."""
        self.send = home.sender(self.prefix)
        """For its cores."""
        self.gathered_send = home.gatherer(self.prefix, self.send)
        """For those that may wait a little to be sent together."""
        self._writers: dict[EntityId, LocalWriter] = {}
        self._readers: dict[EntityId, LocalReader] = {}
        self._locals: dict[str, list[LocalWriter | LocalReader]] = {}
        self._topics: dict[str, dict[Guid, EndpointData]] = {}  # those of others
        self._leases: dict[GuidPrefix, dict[Guid, WriterLease]] = {}
        self._next_key = FIRST_KEY
        self._discovery = Discovery(self)
        self._announcer = Announcer(
            data,
            self.gathered_send,
            home.settings,
            home.addresses.announce_to,
            home.peers,
            home.number,
            now,
        )
        self._welcome = Welcome(
            self._announcer, home.agenda, self._discovery.is_heard_by, home.others.neighbours
        )
        self._automatic = Assertions(False, home.agenda, self._discovery.say_alive)
        self._manual = Assertions(True, home.agenda, self._discovery.say_alive)

    # --- What is there -----------------------------------------------------------------------------------

    @property
    def participants(self) -> tuple[ParticipantData, ...]:
        """All others that are there, those of this process included."""
        siblings = (other.data for other in self.home.participants if other is not self)
        return (*siblings, *(known.peer.data for known in self._discovery.known.values()))

    @property
    def endpoints(self) -> tuple[EndpointData, ...]:
        """All writers and readers of others, those of this process included."""
        siblings = (other for other in self.home.participants if other is not self)
        return (
            *(local.data for sibling in siblings for local in sibling.locals()),
            *(endpoint for known in self._discovery.known.values() for endpoint in known.endpoints.values()),
        )

    def endpoint(self, guid: Guid) -> EndpointData | None:
        """The writer or reader of somebody else with this GUID; None = there is none."""
        if guid[:12] == self.prefix:
            return None
        local = self.home.registry.get(guid)
        if local is not None:
            return local.data
        known = self._discovery.known.get(guid[:12])
        return None if known is None else known.endpoints.get(guid)

    def on_topic(self, topic: str) -> tuple[EndpointData, ...]:
        """The writers and readers with this topic, its own and those of this process included."""
        ours = (local.data for local in self.home.registry.on_topic(topic))
        return (*ours, *self._topics.get(topic, {}).values())

    @property
    def writers(self) -> tuple[LocalWriter, ...]:
        """Its own."""
        return tuple(self._writers.values())

    @property
    def readers(self) -> tuple[LocalReader, ...]:
        """Its own."""
        return tuple(self._readers.values())

    # --- What its owner does -----------------------------------------------------------------------------

    def writer(
        self,
        topic: str,
        type_name: str,
        qos: EndpointQos,
        *,
        now: int,
        entity: EntityId | None = None,
        keyed: bool = False,
        user_data: bytes = b"",
        last: int = 0,
        settings: WriterSettings | None = None,
        on_room: Callable[[], object] | None = None,
    ) -> LocalWriter:
        """A new writer.

        entity: its entity id, with the kind of a user's writer (0x..02 with a key, 0x..03 without); None = the next
        free one. keyed: whether the topic has a key, where `entity` does not say. last: the sequence number of the
        last sample that an earlier life of the same GUID wrote. on_room: called when a refused sample is worth
        trying again. ValueError: the id is in use or no writer's, the limits in `qos` make no sense, or the participant
        is closed.
        """
        entity = self._entity(entity, EntityKind.WRITER_KEYED if keyed else EntityKind.WRITER)
        if not is_writer(entity):
            raise ValueError(f"entity id 0x{entity:08x} is not a writer's: its last octet must be 02 or 03")
        check_limits(qos)
        data = EndpointData(
            guid=guid_of(self.prefix, entity),
            topic=topic,
            type_name=type_name,
            qos=qos,
            user_data=user_data,
        )
        made = self._writers[entity] = LocalWriter(
            self,
            data,
            now=now,
            last=last,
            settings=limited_writer(settings or self.home.settings.writer, qos, keyed=is_keyed(entity)),
            endpoint_qos=_inline_qos(topic, qos),
            on_room=on_room,
        )
        self.home.now = now
        self.home.add_writer(made)
        self._open(made, now)
        return made

    def reader(
        self,
        topic: str,
        type_name: str,
        qos: EndpointQos,
        on_sample: OnSample,
        *,
        now: int,
        entity: EntityId | None = None,
        keyed: bool = False,
        user_data: bytes = b"",
        settings: ReaderSettings | None = None,
        expects_inline_qos: bool = False,
    ) -> LocalReader:
        """A new reader; as `writer` (kinds of readers: 0x..07 with a key, 0x..04 without)."""
        entity = self._entity(entity, EntityKind.READER_KEYED if keyed else EntityKind.READER)
        if not is_reader(entity):
            raise ValueError(f"entity id 0x{entity:08x} is not a reader's: its last octet must be 04 or 07")
        check_limits(qos)
        data = EndpointData(
            guid=guid_of(self.prefix, entity),
            topic=topic,
            type_name=type_name,
            qos=qos,
            user_data=user_data,
            expects_inline_qos=expects_inline_qos,
        )
        made = self._readers[entity] = LocalReader(
            self, data, on_sample, settings=limited_reader(settings or self.home.settings.reader, qos)
        )
        self.home.now = now
        self._open(made, now)
        return made

    def set_user_data(self, user_data: bytes, now: int) -> None:
        """Tell others different user data."""
        self.home.now = now
        self.data = replace(self.data, user_data=user_data)
        self._announcer.change(self.data, now)
        if not self.held:
            self.home.agenda.at(self._announcer, now)
        self.home.finish()

    def assert_liveliness(self, now: int) -> None:
        """The participant, and so its writers with MANUAL_BY_PARTICIPANT liveliness, are alive."""
        self.home.now = now
        self.assert_manual(now)
        self.home.finish()

    def close(self, now: int) -> None:
        """Take it away with all it has; others are told. Closing twice is allowed."""
        if not self.closed:
            self.home.now = now
            self.home.close_participant(self, now)
            self.home.finish()

    # --- What its domain, discovery and endpoints do -----------------------------------------------------

    def start(self, now: int) -> None:
        """It is there from now on."""
        if self.held:
            self.held = False
            self._announcer.change(self.data, now)  # with a number above that of the last farewell
        for peer in self.home.peers.values():
            self.meet(peer, now)
        self.home.agenda.at(self._announcer, now)

    def stop(self, now: int) -> None:
        """It is taken from the domain."""
        for local in self.locals():
            self.close_endpoint(local, now)
        if not self.held:
            self._announcer.leave()
        self.closed = True
        for prefix in tuple(self._discovery.known):
            self._discovery.part(prefix, Why.CLOSED, now)
        self._discovery.close()
        for timed in (self._announcer, self._welcome, self._automatic, self._manual):
            self.home.agenda.forget(timed)

    def discovery_of(self, prefix: GuidPrefix) -> Discovery | None:
        """Its discovery, if it has met somebody."""
        return self._discovery if prefix in self._discovery.known else None

    def knows_endpoints_of(self, prefix: GuidPrefix) -> bool:
        """Whether somebody has told of writers or readers."""
        known = self._discovery.known.get(prefix)
        return known is not None and bool(known.endpoints)

    def lead(self, now: int) -> None:
        """From now on it is the one that announces itself to those not known yet."""
        self._announcer.lead(now)
        self.home.agenda.at(self._announcer, now)

    def locals(self) -> list[LocalWriter | LocalReader]:
        """Its writers and readers."""
        return [*self._writers.values(), *self._readers.values()]

    def readdress(self, data: ParticipantData, now: int) -> None:
        """Its addresses have changed."""
        self._announcer.announce_to = self.home.addresses.announce_to
        self.data = data
        self._announcer.change(data, now)
        if not self.held:
            self.home.agenda.at(self._announcer, now)

    def is_own_announcement(self, payload: bytes) -> bool:
        """Whether it has said this itself."""
        return payload == self._announcer.content

    def say_farewell(self) -> None:
        """It has gone; tell those known again."""
        self._announcer.leave(again=True)
        self.home.finish()

    def meet(self, peer: Peer, now: int) -> None:
        """Somebody is there."""
        if self.held:
            return
        self.tell(ParticipantFound(peer.data))
        self._welcome.add(peer, now)
        self._discovery.meet(peer, now)

    def update(self, peer: Peer, before: ParticipantData | None, now: int) -> None:
        """Somebody says something else of itself (`before` is what it said), or is to be reached elsewhere."""
        if self.held:
            return
        if before is not None:
            self.tell(ParticipantChanged(peer.data, before))
        self._discovery.meet(peer, now)
        known = self._discovery.known[peer.prefix]
        for endpoint in known.endpoints.values():
            self.changed(endpoint, endpoint, peer, now)

    def part(self, peer: Peer, why: Why, now: int) -> None:
        """Somebody is there no more."""
        if self.held:
            return
        self._discovery.part(peer.prefix, why, now)
        self.tell(ParticipantLost(peer.data, why))

    def tell(self, event: ParticipantEvent) -> None:
        """An event for the owner."""
        if self.on_event is not None and not self.closed:
            self.home.news.append((self.on_event, event))

    def reporter(self, guid: Guid) -> Report:
        """What the core of the entity with this GUID reports to."""

        def report(problem: Problem, peer: Guid, number: int) -> None:
            self.tell(Trouble(guid, peer, problem, number))

        return report

    def found(self, endpoint: EndpointData, peer: Peer, now: int) -> None:
        """A writer or reader of somebody else is there."""
        self._topics.setdefault(endpoint.topic, {})[endpoint.guid] = endpoint
        for local in self._locals.get(endpoint.topic, ()):
            if isinstance(local, LocalReader) == endpoint.is_writer:
                self._compare(local, endpoint, peer, now)

    def changed(self, endpoint: EndpointData, before: EndpointData, peer: Peer, now: int) -> None:
        """One says something else of itself than before, or is to be reached elsewhere."""
        if endpoint is before:
            for local in self._locals.get(endpoint.topic, ()):
                if endpoint.guid in local.remotes:
                    self._join(local, endpoint, peer, now)
        else:
            self.found(endpoint, peer, now)

    def lost(self, endpoint: EndpointData, why: Why, now: int) -> None:
        """One has gone."""
        guid = endpoint.guid
        there = self._topics[endpoint.topic]
        del there[guid]
        if not there:
            del self._topics[endpoint.topic]
        for local in self._locals.get(endpoint.topic, ()):
            local.refused.pop(guid, None)
            if guid in local.remotes:
                self.separate(local, endpoint, why, now)

    def asserted(self, assertion: Assertion, now: int) -> None:
        """Somebody says that it, or what it speaks for, is alive."""
        for lease in self._leases.get(assertion.prefix, {}).values():
            if lease.kind == Liveliness.AUTOMATIC or (
                assertion.manual and lease.kind == Liveliness.MANUAL_BY_PARTICIPANT
            ):
                lease.touch(now)

    def assert_manual(self, now: int) -> None:
        """A user says that the participant is alive."""
        for writer in self._writers.values():
            if writer.qos.liveliness == Liveliness.MANUAL_BY_PARTICIPANT:
                writer.asserted(now)
        self._manual.asserted(now)

    def close_endpoint(self, local: LocalWriter | LocalReader, now: int) -> None:
        """A user takes away a writer or reader."""
        self.home.now = now
        data = local.data
        self.home.registry.remove(local, now)
        for remote in tuple(local.remotes.values()):
            self._separate(local, remote, now)
        local.stop()
        there = self._locals[data.topic]
        there.remove(local)
        if not there:
            del self._locals[data.topic]
        if isinstance(local, LocalWriter):
            del self._writers[local.entity]
            self.home.remove_writer(local)
            self._watch_own(now)
        else:
            del self._readers[local.entity]
        self._discovery.withdraw(data, now)

    # --- Matching ----------------------------------------------------------------------------------------

    def _open(self, local: LocalWriter | LocalReader, now: int) -> None:
        """A writer or reader was made."""
        data = local.data
        self._discovery.announce(data, now)
        self._locals.setdefault(data.topic, []).append(local)
        if isinstance(local, LocalWriter):
            self._watch_own(now)
        self.home.registry.add(local, now)
        for endpoint in tuple(self._topics.get(data.topic, {}).values()):
            if endpoint.is_writer == isinstance(local, LocalReader):
                self._compare(local, endpoint, self._discovery.known[endpoint.guid[:12]].peer, now)
        self.home.finish()

    def _compare(self, local: LocalWriter | LocalReader, remote: EndpointData, peer: Peer, now: int) -> None:
        """See whether one of ours and one of somebody else fit."""
        if isinstance(local, LocalWriter):
            reasons = _matching.mismatches(local.data, remote)
        else:
            reasons = _matching.mismatches(remote, local.data)
        self.compared(local, remote, reasons, peer, now)

    def compared(
        self,
        local: LocalWriter | LocalReader,
        remote: EndpointData,
        reasons: tuple[Mismatch, ...],
        peer: Peer | None,
        now: int,
    ) -> None:
        """Match the two, or not, or no longer; `peer` None = both are of this process."""
        guid = remote.guid
        before = local.remotes.get(guid)
        if not reasons:
            local.refused.pop(guid, None)
            self._join(local, remote, peer, now)
            if before is None:
                self.tell(Matched(local.guid, remote))
            return
        if before is not None:
            self.separate(local, before, Why.CHANGED, now)
        local.refused[guid] = reasons
        self.tell(Incompatible(local.guid, remote, reasons))

    def _join(
        self, local: LocalWriter | LocalReader, remote: EndpointData, peer: Peer | None, now: int
    ) -> None:
        """The two fit: let them talk (or, if they do, over other addresses)."""
        home = self.home
        places = (INSIDE,) if peer is None else peer.places(remote, home.hosts)
        if isinstance(local, LocalWriter):
            local.remotes[remote.guid] = remote
            home.add_reply_route(remote.guid, local)
            local.core.match(
                remote.guid,
                places,
                now,
                reliable=remote.qos.reliable,
                transient_local=remote.qos.durability >= Durability.TRANSIENT_LOCAL,
                expects_inline_qos=remote.expects_inline_qos
                or (peer is not None and peer.data.expects_inline_qos),
                patient=peer is not None and peer.kin,
            )
        else:
            local.add(remote)
            home.add_route(remote.guid, local)
            if peer is not None:
                self._watch(local, remote, peer, now)
            local.core.match_writer(
                remote.guid,
                places,
                now,
                reliable=remote.qos.reliable,
                hello_base=1 if peer is None else peer.hello_base,
                patient=peer is not None and peer.kin,
            )
        home.agenda.at(local, local.core.due)

    def separate(self, local: LocalWriter | LocalReader, remote: EndpointData, why: Why, now: int) -> None:
        """They are not matched any more; tell the owner."""
        self._separate(local, remote, now)
        self.tell(Unmatched(local.guid, remote, why))

    def _separate(self, local: LocalWriter | LocalReader, remote: EndpointData, now: int) -> None:
        """They do not talk any more."""
        guid = remote.guid
        if isinstance(local, LocalWriter):
            del local.remotes[guid]
            self.home.remove_reply_route(guid, local)
            local.core.unmatch(guid, now)
        else:
            local.drop(guid)
            self.home.remove_route(guid, local)
            local.core.unmatch_writer(guid)
            lease = self._lease(guid)
            if lease is not None:
                lease.readers.pop(local.guid, None)
                if not lease.readers:
                    self._forget_lease(lease)

    # --- Liveliness --------------------------------------------------------------------------------------

    def _watch(self, local: LocalReader, remote: EndpointData, peer: Peer, now: int) -> None:
        """Watch whether a writer is alive, if its lease ends."""
        guid, qos = remote.guid, remote.qos
        lease = self._lease(guid)
        period = max(qos.lease, self.home.settings.lease_least)
        if lease is not None and (lease.kind, lease.lease) != (qos.liveliness, period):
            readers = lease.readers
            self._forget_lease(lease)
            lease = None
        else:
            readers = {}
        if qos.lease >= INFINITE:
            return
        if lease is None:
            lease = WriterLease(guid, qos.liveliness, period, peer, self.home.agenda, self._alive_or_not, now)
            lease.readers.update(readers)
            self._leases.setdefault(peer.prefix, {})[guid] = lease
            self.home.add_lease(lease)
        lease.readers[local.guid] = None

    def _lease(self, writer: Guid) -> WriterLease | None:
        return self._leases.get(writer[:12], {}).get(writer)

    def _forget_lease(self, lease: WriterLease) -> None:
        leases = self._leases[lease.guid[:12]]
        del leases[lease.guid]
        if not leases:
            del self._leases[lease.guid[:12]]
        self.home.remove_lease(lease)
        self.home.agenda.forget(lease)

    def _alive_or_not(self, lease: WriterLease) -> None:
        """A writer of somebody else is alive again, or not any more."""
        for guid in lease.readers:
            self.alive_or_not(self._readers[split_guid(guid)[1]], lease.guid, lease.alive)

    def alive_or_not(self, reader: LocalReader, writer: Guid, alive: bool) -> None:
        """A writer that is matched with a reader of ours is alive again, or not any more."""
        if reader.owners is not None and not alive:
            reader.owners.release(writer)
        self.tell(LivelinessChanged(reader.guid, writer, alive))

    def _watch_own(self, now: int) -> None:
        """Writers of ours have come or gone: say as often as they need that they are alive."""
        for assertions, kind in (
            (self._automatic, Liveliness.AUTOMATIC),
            (self._manual, Liveliness.MANUAL_BY_PARTICIPANT),
        ):
            assertions.watch(
                (writer.qos.lease for writer in self._writers.values() if writer.qos.liveliness == kind), now
            )

    # --- Helpers -----------------------------------------------------------------------------------------

    def _entity(self, entity: EntityId | None, kind: EntityKind) -> EntityId:
        """A free entity id, or the one asked for if it is free."""
        if self.closed:
            raise ValueError("the participant is closed")
        if entity is not None:
            if is_builtin(entity) or not 0 <= entity <= 0xFFFFFFFF:
                raise ValueError(f"entity id 0x{entity:08x} is not a user's")
            if entity in self._writers or entity in self._readers:
                raise ValueError(f"entity id 0x{entity:08x} is in use")
            return entity
        for _ in range(LAST_KEY):
            entity = self._next_key << 8 | kind
            self._next_key = self._next_key + 1 if self._next_key < LAST_KEY else FIRST_KEY
            if entity not in self._writers and entity not in self._readers:
                return entity
        raise ValueError("the participant has no entity id left")


def _inline_qos(topic: str, qos: EndpointQos) -> bytes:
    """What a reader that expects inline QoS gets with every sample (8.7.2.1)."""
    builder = ParameterBuilder()
    builder.text(Pid.TOPIC_NAME, topic)
    write_qos(builder, qos)
    return builder.build()
