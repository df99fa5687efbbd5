"""Writers and readers of users: what a participant's owner holds in the hand.

They are ports (`_ports.py`): the state machines of `_writer.py` and `_reader.py`, with what DDS puts around them:
matching, deadline, liveliness, ownership, instances.

What a writer and all its readers have in one process needs no datagrams. While nothing lags, waits, or is kept for
those who come late, a sample is given to the readers by hand, and counts as sent and acknowledged; as soon as something
stands against that for one of them (it has not heard yet where the numbers begin, refuses, is elsewhere, wants
deadlines or instances kept) samples go the common way, in the same numbers, until all have everything again.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

from muros.rtps._constants import ENTITYID_UNKNOWN, StatusInfo, keyed
from muros.rtps._discovery_data import EndpointData
from muros.rtps._endpoint import Problem
from muros.rtps._events import Data
from muros.rtps._liveliness import OwnLease
from muros.rtps._news import DeadlineMissed, LivelinessLost, Mismatch, Trouble
from muros.rtps._parameters import Parameters, key_hash_of, status_info_of
from muros.rtps._parameters import inline_qos as build_inline_qos
from muros.rtps._parameters import parse_untrusted as parse_parameters
from muros.rtps._ports import ReaderPort, WriterPort
from muros.rtps._qos import EndpointQos, History, Liveliness, Ownership, ResourceLimits
from muros.rtps._reach import INSIDE
from muros.rtps._reader import ReaderCore
from muros.rtps._settings import ReaderSettings, WriterSettings
from muros.rtps._values import INFINITE, Guid
from muros.rtps._watch import Deadlines, Instances, Owners
from muros.rtps._writer import SENTINEL_SIZE, WriterCore

if TYPE_CHECKING:
    from muros.rtps._participant import ParticipantCore

__all__ = ["LocalReader", "LocalWriter", "OnSample", "Received"]

TIME_END: Final = 0xFFFFFFFF * 10**9
"""ns since 1970 from which on a time does not fit RTPS."""


class Received(NamedTuple):
    """A sample that has come, or news of an instance of a topic with a key."""

    writer: Guid
    sequence: int
    payload: bytes
    """Begins with its encapsulation; padding may follow. Empty when the instance is named by its key hash only."""
    source_time: int | None
    """When it was written, ns since 1970; None = not said."""
    inline_qos: Parameters | None
    status: int = 0
    """Whether the instance was disposed or unregistered (`StatusInfo`); always 0 on topics without a key. The payload
    then is empty or only the key."""
    instance: bytes = b""
    """Key hash of the instance, 16 bytes, where the writer sends it; empty = not said, or no key."""
    expires: int | None = None
    """When the sample's lifespan ends, on the clock of `now`, counted from its arrival; None = never."""


OnSample: TypeAlias = Callable[[Received], bool | None]
"""Takes a sample. False refuses it for now: it, and what is behind it, waits until `LocalReader.resume`.

Called while a datagram is handled: may write with any writer and close anything, but must not raise.
"""


class LocalWriter(WriterPort):
    """A writer of ours. Made by `ParticipantCore.writer`."""

    __slots__ = (
        "_changes", "_deadlines", "_domain", "_inline", "_inside", "_instances", "_lease", "_on_room", "_watched",
        "closed", "data", "guid", "owner", "refused", "rejected", "remotes",
    )  # fmt: skip

    def __init__(
        self,
        owner: "ParticipantCore",
        data: EndpointData,
        *,
        now: int,
        last: int,
        settings: WriterSettings,
        endpoint_qos: bytes,
        on_room: Callable[[], object] | None,
    ) -> None:
        qos = data.qos
        domain = owner.home
        super().__init__(
            WriterCore(
                data.guid,
                owner.gathered_send if settings.together else owner.send,
                reliable=qos.reliable,
                transient_local=qos.durability > 0,
                depth=None if qos.history == History.KEEP_ALL else max(1, qos.depth),
                lifespan=0 if qos.lifespan >= INFINITE else max(1, qos.lifespan),
                endpoint_qos=endpoint_qos,
                last=last,
                settings=settings,
                report=owner.reporter(data.guid),
                on_room=None if on_room is None else lambda: domain.later(on_room),
            )
        )
        self.guid: Final = data.guid
        self.data: EndpointData = data
        """What others are told of it."""
        self.closed = False
        self.remotes: dict[Guid, EndpointData] = {}
        """Matched readers."""
        self.refused: dict[Guid, tuple[Mismatch, ...]] = {}
        """Readers of its topic that do not match, and why."""
        self.owner = owner
        self._domain = domain
        self._deadlines: Deadlines | None = None
        self._lease: OwnLease | None = None
        if qos.deadline < INFINITE:
            self._deadlines = Deadlines(
                qos.deadline,
                domain.settings.instances,
                domain.agenda,
                lambda total, instance: owner.tell(DeadlineMissed(self.guid, total, instance)),
            )
        if qos.liveliness != Liveliness.AUTOMATIC and qos.lease < INFINITE:
            self._lease = OwnLease(
                max(qos.lease, domain.settings.lease_least),
                domain.agenda,
                self._alive_or_not,
                now,
            )
        self._on_room = on_room
        self.rejected = 0
        """Samples it had no room for: `write` returned 0."""
        self._instances = _instances(qos.limits if keyed(self.entity) else None)
        self._watched = self._deadlines is not None or qos.liveliness != Liveliness.AUTOMATIC
        self._inside: tuple[LocalReader, ...] = ()
        """All readers, where they may be given samples by hand; as of:"""
        self._changes = -1
        self._inline: tuple[bytes, Parameters | None] = b"", None
        """The inline QoS given last, and what it says."""

    @property
    def qos(self) -> EndpointQos:
        """As given when it was made."""
        return self.data.qos

    @property
    def matched(self) -> tuple[Guid, ...]:
        """Readers it writes to."""
        return tuple(self.remotes)

    @property
    def last(self) -> int:
        """Sequence number of the last sample written."""
        return self.core.last

    @property
    def acknowledged(self) -> bool:
        """Whether all reliable readers (but those set aside as stalled) have everything written so far."""
        return self.core.acknowledged >= self.core.last

    def write(
        self,
        payload: bytes | tuple[bytes, ...],
        now: int,
        *,
        source_time: int | None = None,
        inline_qos: bytes = b"",
        to: Guid | None = None,
        instance: bytes = b"",
    ) -> int:
        """Write a sample (encapsulation included; in pieces, if that saves copying); its sequence number, or 0 when
        there is no room now, as it keeps all or its resource limits say: `on_room` is called when writing is worth
        trying again. `Trouble` tells when the sample's instance is the reason: one too many (until one is
        unregistered), or full.

        source_time: ns since 1970. inline_qos: a little-endian parameter list (`muros.rtps.inline_qos`).
        to: only this matched reader gets it (the others learn that it is not for them). instance: key hash of 16
        bytes, for a topic with a key. ValueError: `to` is not matched, the inline QoS are too large, the time does
        not fit RTPS, or the writer is closed.
        """
        if self.closed:
            raise ValueError("the writer is closed")
        domain = self._domain
        domain.now = now
        if self._instances is not None and not self._instances.admits(instance):
            self._reject(Problem.INSTANCES_FULL, self._instances.most)
            domain.finish()
            return 0
        if instance:
            inline_qos = inline_qos[:-SENTINEL_SIZE] + build_inline_qos(key_hash=instance)
        core = self.core
        if core.changes != self._changes:
            self._look_around()
        if self._inside and core.rests and not domain.busy and not domain.inside:
            given = self._give(payload, now, source_time, inline_qos, to)
            if given:
                if domain.inside or domain.news or domain.gathered:
                    domain.settle()
                return given
        sequence = core.write(payload, now, source_time, inline_qos, instance=instance, to=to)
        if core.due < self.wake_at:
            domain.agenda.at(self, core.due)
        if sequence is None:
            self._refused(instance)
        elif self._watched:
            self._written(instance, now)
        if (domain.inside or domain.news or domain.gathered) and not domain.busy:
            domain.settle()
        return sequence or 0

    def dispose(
        self,
        instance: bytes,
        now: int,
        *,
        key: bytes = b"",
        source_time: int | None = None,
        unregister: bool = False,
    ) -> int:
        """The instance with this key hash is no more; returns as `write`.

        key: its serialized key, encapsulation included, where known. unregister: nor will it be written again.
        ValueError for a topic without a key, and as `write`.
        """
        status = StatusInfo.DISPOSED | StatusInfo.UNREGISTERED if unregister else StatusInfo.DISPOSED
        return self._end(instance, status, key, source_time, now)

    def unregister(
        self, instance: bytes, now: int, *, key: bytes = b"", source_time: int | None = None
    ) -> int:
        """The instance will not be written by this writer any more; returns and raises as `dispose`."""
        return self._end(instance, StatusInfo.UNREGISTERED, key, source_time, now)

    def assert_liveliness(self, now: int) -> None:
        """The writer is alive (manual liveliness). Writing says so, too."""
        if self.closed:
            return
        self._domain.now = now
        if self.qos.liveliness == Liveliness.MANUAL_BY_TOPIC:
            self.core.assert_liveliness(now)
        self._assert(now)
        self._domain.finish()

    def close(self, now: int) -> None:
        """Take it away; others are told. What they have not acknowledged is lost. Closing twice is allowed."""
        if not self.closed:
            self.owner.close_endpoint(self, now)
            self._domain.finish()

    def stop(self) -> None:
        """It is closed: nothing of it is woken any more. For its participant."""
        self.closed = True
        agenda = self._domain.agenda
        for timed in (self, self._deadlines, self._lease):
            if timed is not None:
                agenda.forget(timed)

    def asserted(self, now: int) -> None:
        """Its participant is alive, says its user. For its participant."""
        if self._lease is not None:
            self._lease.touch(now)

    def _end(self, instance: bytes, status: StatusInfo, key: bytes, source_time: int | None, now: int) -> int:
        if self.closed:
            raise ValueError("the writer is closed")
        if not keyed(self.entity):
            raise ValueError("the topic has no key, and so no instance that could end")
        if len(instance) != 16:
            raise ValueError(f"a key hash has 16 bytes, this one has {len(instance)}")
        self._domain.now = now
        sequence = self.core.write(
            key,
            now,
            source_time,
            build_inline_qos(key_hash=instance, status=status),
            key=True,
            instance=instance,
            last=bool(status & StatusInfo.UNREGISTERED),
        )
        if sequence is not None:
            if self._deadlines is not None:
                self._deadlines.end(instance)
            if self._instances is not None and status & StatusInfo.UNREGISTERED:
                self._instances.end(instance)
                if self._on_room is not None:
                    self._domain.later(self._on_room)
        self._domain.agenda.at(self, self.core.due)
        self._domain.finish()
        return sequence or 0

    def _look_around(self) -> None:
        """Whether all readers are of this process and take samples as they are."""
        self._changes = self.core.changes
        found = []
        if not keyed(self.entity):
            for proxy in self.core.readers:
                reader = self._domain.registry.get(proxy.guid)
                if (
                    proxy.places == (INSIDE,)
                    and not proxy.inline_qos
                    and isinstance(reader, LocalReader)
                    and reader.plain
                ):
                    found.append(reader)
        self._inside = tuple(found) if len(found) == len(self.core.readers) else ()

    def _give(
        self,
        payload: bytes | tuple[bytes, ...],
        now: int,
        source_time: int | None,
        inline_qos: bytes,
        to: Guid | None,
    ) -> int:
        """Give a sample to readers of this process by hand, without datagrams; its number, 0 = it cannot be done.

        What they do with it is done in a turn of the domain, as if a datagram had come.
        """
        core, guid, readers = self.core, self.guid, self._inside
        sequence = core.last + 1
        if source_time is not None and not 0 <= source_time < TIME_END:
            return 0
        if to is not None and to not in self.remotes:
            return 0
        for reader in readers:
            if not reader.core.awaits(guid, sequence):
                return 0
        inline = None
        if inline_qos:
            if inline_qos is not self._inline[0]:  # clients of services have one for all that they ask
                self._inline = inline_qos, parse_parameters(inline_qos)[0]
            inline = self._inline[1]
        whole = b"".join(payload) if isinstance(payload, tuple) else payload
        event = Data(
            self.prefix, None, source_time, ENTITYID_UNKNOWN, self.entity, sequence, whole, inline, False
        )
        core.give()
        domain = self._domain
        refused = []
        domain.busy = True
        try:
            for reader in readers:
                if reader.closed:
                    continue  # by one before it
                if to is not None and reader.guid != to:
                    reader.core.pass_by(guid, sequence)
                elif not reader.core.give(event, now):
                    refused.append(reader)
        finally:
            domain.busy = False
        if refused:
            if core.take_back(sequence):
                return 0  # those who have it know its number
            for reader in refused:
                reader.core.on_data(event, now)  # which keeps it
        if self._watched and not self.closed:
            self._written(b"", now)
        return sequence

    def _refused(self, instance: bytes) -> None:
        """The core has no room for a sample of this instance."""
        limit = self.core.settings.limit_of_one
        if limit and self.core.held_of(instance) >= limit:
            self._reject(Problem.INSTANCE_FULL, limit)
        else:
            self.rejected += 1

    def _reject(self, problem: Problem, limit: int) -> None:
        self.rejected += 1
        self.owner.tell(Trouble(self.guid, self.guid, problem, limit))

    def _written(self, instance: bytes, now: int) -> None:
        if self._deadlines is not None:
            self._deadlines.touch(instance, now)
        if self.qos.liveliness != Liveliness.AUTOMATIC:
            self._assert(now)

    def _alive_or_not(self, alive: bool, total: int) -> None:
        """It has not said in time that it is alive, or says so again: readers of this process are told here."""
        if not alive:
            self.owner.tell(LivelinessLost(self.guid, total))
        for guid in self.remotes:
            reader = self._domain.registry.get(guid)
            if isinstance(reader, LocalReader):
                reader.owner.alive_or_not(reader, self.guid, alive)

    def _assert(self, now: int) -> None:
        if self.qos.liveliness == Liveliness.MANUAL_BY_PARTICIPANT:
            self.owner.assert_manual(now)
        else:
            self.asserted(now)


class LocalReader(ReaderPort):
    """A reader of ours. Made by `ParticipantCore.reader`."""

    __slots__ = (
        "_deadlines", "_domain", "_dropped", "_instances", "_keyed", "_lifespans", "_on_sample", "closed", "data",
        "guid", "outranked", "owner", "owners", "plain", "refused", "remotes",
    )  # fmt: skip

    def __init__(
        self,
        owner: "ParticipantCore",
        data: EndpointData,
        on_sample: OnSample,
        *,
        settings: ReaderSettings,
    ) -> None:
        qos = data.qos
        domain = owner.home
        super().__init__(
            ReaderCore(
                data.guid,
                owner.gathered_send if settings.together else owner.send,
                self._deliver,
                reliable=qos.reliable,
                settings=settings,
                report=owner.reporter(data.guid),
            )
        )
        self.guid: Final = data.guid
        self.data: EndpointData = data
        """What others are told of it."""
        self.closed = False
        self.remotes: dict[Guid, EndpointData] = {}
        """Matched writers."""
        self.refused: dict[Guid, tuple[Mismatch, ...]] = {}
        """Writers of its topic that do not match, and why."""
        self.outranked = 0
        """Samples left out because a stronger writer owns their instance."""
        self.owners = Owners(domain.settings.instances) if qos.ownership == Ownership.EXCLUSIVE else None
        self.owner = owner
        self._domain = domain
        self._on_sample = on_sample
        self._keyed = keyed(self.entity)
        self._lifespans: dict[Guid, int] = {}
        self._deadlines: Deadlines | None = None
        if qos.deadline < INFINITE:
            self._deadlines = Deadlines(qos.deadline, domain.settings.instances, domain.agenda, self._missed)
        self._instances = _instances(qos.limits if self._keyed else None)
        self._dropped = 0
        self.plain = not self._keyed and self.owners is None and self._deadlines is None
        """Whether samples are handed on as they come."""

    @property
    def qos(self) -> EndpointQos:
        """As given when it was made."""
        return self.data.qos

    @property
    def rejected(self) -> int:
        """Samples for which its resource limits had no room. Those of reliable writers come again."""
        return self.core.rejected + self._dropped

    @property
    def matched(self) -> tuple[Guid, ...]:
        """Writers it reads from."""
        return tuple(self.remotes)

    def resume(self, now: int) -> None:
        """Offer again what was refused."""
        if not self.closed:
            domain = self._domain
            domain.now = now
            busy, domain.busy = domain.busy, True
            try:
                self.core.resume(now)
            finally:
                domain.busy = busy
            domain.agenda.at(self, self.core.due)
            domain.finish()

    def close(self, now: int) -> None:
        """Take it away; others are told. Closing twice is allowed."""
        if not self.closed:
            self.owner.close_endpoint(self, now)
            self._domain.finish()

    def stop(self) -> None:
        """It is closed: nothing of it is woken any more. For its participant."""
        self.closed = True
        self._domain.agenda.forget(self)
        if self._deadlines is not None:
            self._deadlines.stop()
            self._domain.agenda.forget(self._deadlines)

    def add(self, writer: EndpointData) -> None:
        """A writer is matched, or has changed. For its participant."""
        self.remotes[writer.guid] = writer
        if writer.qos.lifespan < INFINITE:
            self._lifespans[writer.guid] = writer.qos.lifespan
        else:
            self._lifespans.pop(writer.guid, None)
        if self.owners is not None:
            self.owners.add(writer.guid, writer.qos.strength)

    def drop(self, writer: Guid) -> None:
        """A writer is matched no more. For its participant."""
        del self.remotes[writer]
        self._lifespans.pop(writer, None)
        if self.owners is not None:
            self.owners.drop(writer)
        if not self.remotes and self._deadlines is not None:
            self._deadlines.stop()

    def _deliver(self, writer: Guid, event: Data) -> bool:
        """What the core hands over."""
        if self.closed:
            return True
        inline = event.inline_qos
        if self.plain and (inline is None or not status_info_of(inline)):
            status, instance = 0, b""
        else:
            status, instance = status_info_of(inline), b"" if not self._keyed else key_hash_of(inline)
            if not self._admit(writer, status, instance):
                return True
        if (event.key or not event.payload) and not status:
            return True  # says nothing
        lifespan = self._lifespans.get(writer) if self._lifespans else None
        expires = None if lifespan is None else self.core.arrived + lifespan
        received = Received(
            writer, event.sequence, event.payload, event.time, inline, status, instance, expires
        )
        return self._on_sample(received) is not False

    def _admit(self, writer: Guid, status: int, instance: bytes) -> bool:
        """Whether the sample is to be handed on."""
        if status and not self._keyed:
            return False  # there is nothing that could end
        if self.owners is not None and not self.owners.admits(writer, instance):
            self.outranked += 1
            return False
        if self._instances is not None:
            if status:
                self._instances.end(instance)
            elif not self._instances.admits(instance):
                self._dropped += 1
                self.owner.tell(Trouble(self.guid, writer, Problem.INSTANCES_FULL, self._instances.most))
                return False
        if status & StatusInfo.UNREGISTERED and self.owners is not None:
            self.owners.free(instance)
        if self._deadlines is not None:
            if status:
                self._deadlines.end(instance)
            else:
                self._deadlines.touch(instance, self._domain.now)
        return True

    def _missed(self, total: int, instance: bytes) -> None:
        if self.owners is not None:
            self.owners.free(instance)
        self.owner.tell(DeadlineMissed(self.guid, total, instance))


def _instances(limits: ResourceLimits | None) -> Instances | None:
    return Instances(limits.max_instances) if limits is not None and limits.max_instances > 0 else None
