"""One domain of the dds engine: who of this process is in it, and what is known of the others.

Theory of operation. Every participant hears of all others through RTPS. One of them, the *lead*, keeps the books for
the graph and reads `ros_discovery_info`, which tells of others' nodes; when it goes, the next one takes over and the
books are put right. Pairs that match are told by both ends when both are ours; `pairs` sees to it that watchers hear
of each pair once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeAlias

from muros import rtps
from muros.rtps import (
    DomainCore,
    DomainReport,
    EndpointChanged,
    EndpointData,
    EndpointFound,
    EndpointLost,
    ParticipantChanged,
    ParticipantData,
    ParticipantFound,
    ParticipantLost,
    Policy,
    Trouble,
    WriterSettings,
)
from muros.space import _reports
from muros.space._core import Core
from muros.space._graph import (
    Appeared,
    Endpoint,
    Incompatible,
    Matched,
    ParticipantInfo,
    Role,
    Unmatched,
    Vanished,
)
from muros.space._qos import Mismatch, duration, mismatches
from muros.space.dds._dialects import Dialect
from muros.space.dds._endpoints import DdsEndpoint, DdsReader, DdsWriter
from muros.space.dds._lingering import Lingering
from muros.space.dds._names import service_of, type_hash
from muros.space.dds._nodes import Nodes
from muros.space.dds._problems import report_domain
from muros.space.dds._remote import Remote
from muros.space.dds._wire_qos import from_wire

if TYPE_CHECKING:
    import asyncio

    from muros.space.dds._participant import DdsParticipant

__all__ = ["Carrier", "DdsDomain"]

LASTS_MOST: Final = 10_000
"""Writers whose last sequence number is remembered for another life."""

NAMES_KNOWN: Final = 500_000_000
"""ns after which the node of an endpoint that was met is known."""


class Carrier(Protocol):
    """A domain's RTPS and what carries it, such as `muros.rtps.net.Network`."""

    @property
    def core(self) -> DomainCore:
        """All participants of this process in the domain."""

    @property
    def clock(self) -> Callable[[], int]:
        """Monotonic time, ns, that the core is given."""

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Serve the core on this loop."""

    def poke(self) -> None:
        """The core was called: it may need its time earlier."""

    def close(self) -> None:
        """Close the core and all that carries it."""


class DdsDomain:
    """One domain, as one process is in it."""

    def __init__(
        self,
        number: int,
        core: Core,
        carrier: Callable[[Callable[[DomainReport], None]], Carrier],
        *,
        ros_distro: str | None = None,
        properties: tuple[tuple[str, str], ...] = (),
    ) -> None:
        self.number = number
        self.core = core
        self.carrier = carrier(self._report)
        self.now = self.carrier.clock
        self.properties = properties
        self.opened = False
        limits = core.limits
        self.writer_settings = WriterSettings(
            limit=limits.resource_limit, patience=max(limits.max_blocking_time, 1)
        )
        self.participants: dict[bytes, DdsParticipant] = {}
        self.endpoints: dict[bytes, DdsEndpoint] = {}
        """Ours, by gid."""
        self.remotes: dict[bytes, Remote] = {}
        """Participants of others, by prefix."""
        self.pairs: dict[tuple[bytes, bytes], None] = {}
        """Writers and readers that match, at least one of them ours."""
        self.lead: DdsParticipant | None = None
        self._distro = ros_distro
        self._lasts: dict[bytes, int] = {}
        self.nodes: Final = Nodes(self, ros_distro)
        self.lingering: Final = Lingering(self)
        self.closing = False
        self._making = 0
        self._postponed: deque[tuple[_Handler, DdsParticipant, rtps.ParticipantEvent]] = deque()

    # --- Time --------------------------------------------------------------------------------------------

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Go on the network."""
        self.carrier.open(loop)
        self.opened = True

    def run(self) -> None:
        """Give the core its time, unless its carrier does."""
        if not self.opened:
            self.carrier.core.tick(self.now())

    def next(self) -> int | None:
        """When it wants it, by the clock of the space."""
        deadline = None if self.opened else self.carrier.core.deadline
        return None if deadline is None else self.core.clock() + max(0, deadline - self.now())

    def poke(self) -> None:
        """The core was called."""
        if self.opened:
            self.carrier.poke()
        elif (due := self.next()) is not None:
            self.core.need(due)

    def close(self) -> None:
        """Everybody leaves, for good."""
        self.closing = True
        for participant in tuple(self.participants.values()):
            participant.close()
        self.lingering.close()
        self.carrier.close()

    def resume(self, reader: DdsReader) -> None:
        """There is room in a reader that had refused samples."""
        self.core.post(_Resume(self, reader))

    # --- Ours --------------------------------------------------------------------------------------------

    def join(self, participant: DdsParticipant) -> None:
        """A participant of ours has come."""
        self.participants[participant.gid[:12]] = participant
        self.nodes.join(participant)
        if self.lead is None:
            self._take_lead(participant)
        if self.core.watchers:
            self.core.tell(Appeared(participant.info()))
            self.core.settle()
        self.poke()

    def leave(self, participant: DdsParticipant, *, lingers: bool) -> None:
        """A participant of ours goes; its endpoints are out of the books already.

        lingers: they are withdrawn, too, and it may come again.
        """
        self.nodes.leave(participant, lingers=lingers)
        del self.participants[participant.gid[:12]]
        if self.core.watchers:
            self.core.tell(Vanished(participant.info()))
        if self.lead is participant:
            self.nodes.listen_no_more()
        if lingers:
            self.lingering.keep(participant)
        else:
            participant.rtps.close(self.now())
        if self.lead is participant:
            self.lead = None
            # The youngest: where all leave, in whatever order, the books pass on once or never.
            following = None if self.closing else next(reversed(self.participants.values()), None)
            if following is not None:
                self._take_lead(following)
            else:
                for prefix in tuple(self.remotes):
                    self._lose(prefix)
        self.poke()

    def forget(self, endpoint: DdsEndpoint) -> None:
        """An endpoint of ours goes."""
        gid = endpoint.gid
        if isinstance(endpoint, DdsWriter):
            self.remember(endpoint.participant, gid, endpoint.out.last)
        for other in endpoint.matched:
            self._end((gid, other) if isinstance(endpoint, DdsWriter) else (other, gid))
        del self.endpoints[gid]

    def remember(self, participant: DdsParticipant, gid: bytes, last: int) -> None:
        """Keep the last sequence number of a writer, if its gid may come again."""
        if participant.keyed and last:
            self._lasts.pop(gid, None)
            if len(self._lasts) >= LASTS_MOST:
                del self._lasts[next(iter(self._lasts))]
            self._lasts[gid] = last

    def recall(self, gid: bytes) -> int:
        """The last sequence number of an earlier life of a writer; 0 = there was none."""
        return self._lasts.get(gid, 0)

    def type_hash(self, type_name: str) -> str:
        """Hash of a type's definition, if it is known."""
        return type_hash(type_name, self._distro)

    # --- Others ------------------------------------------------------------------------------------------

    def dialect_of(self, gid: bytes) -> Dialect:
        """How the participant of an endpoint speaks in services."""
        remote = self.remotes.get(gid[:12])
        return Dialect.INLINE if remote is None else remote.dialect

    def name_of(self, gid: bytes) -> str:
        """What to call the owner of an endpoint."""
        own = self.participants.get(gid[:12])
        return own.owner if own is not None else self._info_of(gid).owner

    def shown(self, data: EndpointData) -> Endpoint:
        """An endpoint of others as a value."""
        hashed = rtps.user_values(data.user_data).get("typehash", "")
        return Endpoint(
            gid=data.guid,
            role=Role.WRITER if data.is_writer else Role.READER,
            topic=data.topic,
            type_name=data.type_name,
            qos=from_wire(data.qos),
            service=service_of(data.topic),
            participant=self._info_of(data.guid),
            type_hash=hashed,
        )

    def endpoint_shown(self, gid: bytes) -> Endpoint | None:
        """The writer or reader with this gid, ours or somebody else's."""
        own = self.endpoints.get(gid)
        if own is not None:
            return own.info()
        remote = self.remotes.get(gid[:12])
        data = None if remote is None else remote.endpoints.get(gid)
        return None if data is None else self.shown(data)

    def concerns(self, pair: tuple[bytes, bytes]) -> bool:
        """Whether one of the two is ours, so that it is known whether they match."""
        return pair[0] in self.endpoints or pair[1] in self.endpoints

    def remote_endpoints(self) -> Iterator[EndpointData]:
        """All writers and readers of others."""
        for remote in self.remotes.values():
            yield from remote.endpoints.values()

    def on_event(self, participant: DdsParticipant, event: rtps.ParticipantEvent) -> None:
        """RTPS tells a participant of ours something."""
        handle = _HANDLERS.get(type(event))
        if handle is None:
            return
        if self._making:
            self._postponed.append((handle, participant, event))
            return
        handle(self, participant, event)
        core = self.core
        core.settle()
        if core.queue:
            core.drain()

    @contextmanager
    def making(self) -> Iterator[None]:
        """What RTPS tells while an entity is being made is heard when it stands, and users hear of it later."""
        with self.core.hushed():
            self._making += 1
            try:
                yield
            finally:
                self._making -= 1
            while self._postponed and not self._making:
                handle, participant, event = self._postponed.popleft()
                handle(self, participant, event)

    def _participant_found(self, participant: DdsParticipant, event: ParticipantFound) -> None:
        self._find(event.participant)

    def _participant_changed(self, participant: DdsParticipant, event: ParticipantChanged) -> None:
        remote = self.remotes.get(event.participant.prefix)
        if remote is not None:
            remote.data = event.participant

    def _participant_lost(self, participant: DdsParticipant, event: ParticipantLost) -> None:
        if participant is self.lead:
            self._lose(event.participant.prefix)

    def _endpoint_found(self, participant: DdsParticipant, event: EndpointFound) -> None:
        if participant is self.lead:
            self._find_endpoint(event.endpoint)

    def _endpoint_changed(self, participant: DdsParticipant, event: EndpointChanged) -> None:
        remote = self.remotes.get(event.endpoint.guid[:12])
        if participant is self.lead and remote is not None and event.endpoint.guid in remote.endpoints:
            remote.endpoints[event.endpoint.guid] = event.endpoint

    def _endpoint_lost(self, participant: DdsParticipant, event: EndpointLost) -> None:
        if participant is self.lead:
            self._lose_endpoint(event.endpoint)

    def _matched(self, participant: DdsParticipant, event: rtps.Matched) -> None:
        local = self.endpoints.get(event.local)
        if local is None:
            return
        remote = event.remote
        pair = _pair(local, remote.guid)
        if pair not in self.pairs:
            self.pairs[pair] = None
            if self.core.watchers:
                self.core.tell(Matched(*_ordered(local, local.info(), self._shown_either(remote))))
        local.connected(remote.guid)

    def _unmatched(self, participant: DdsParticipant, event: rtps.Unmatched) -> None:
        local = self.endpoints.get(event.local)
        if local is not None:
            pair = _pair(local, event.remote.guid)
            if pair in self.pairs:
                del self.pairs[pair]
                if self.core.watchers:
                    shown = self._shown_either(event.remote)
                    self.core.tell(Unmatched(*_ordered(local, local.info(), shown)))
            local.disconnected(event.remote.guid)

    def _incompatible(self, participant: DdsParticipant, event: rtps.Incompatible) -> None:
        local = self.endpoints.get(event.local)
        other = self.endpoints.get(event.remote.guid)
        if local is None or (other is not None and isinstance(local, DdsWriter)):
            return  # the reader of a pair of ours tells for both
        writer, reader = _ordered(local, local.info(), self._shown_either(event.remote))
        reasons = self._reasons(writer, reader, event.mismatches)
        core = self.core
        if core.watchers:
            core.tell(Incompatible(writer, reader, tuple(str(reason) for reason in reasons)))
        told = partial(self._tell_mismatch, local, event.remote.guid, reasons)
        if other is not None:
            core.notices.append(told)
        else:
            core.timers.at(core.timers.now() + NAMES_KNOWN, told)

    def _tell_mismatch(self, local: DdsEndpoint, remote: bytes, reasons: tuple[Mismatch, ...]) -> None:
        """Two do not fit. Told when there was time to hear what the other's node is called."""
        names = (local.owner, self.name_of(remote))
        writer, reader = names if isinstance(local, DdsWriter) else names[::-1]
        _reports.mismatched(self.core, reader, writer, local.topic.name, reasons, who=local.owner)

    def _liveliness_lost(self, participant: DdsParticipant, event: rtps.LivelinessLost) -> None:
        local = self.endpoints.get(event.local)
        if local is not None:
            self.core.report(
                "liveliness-lost",
                who=local.owner,
                subject=local.topic.name,
                what=f"{{n}} time{{s}} the writer of {local.topic.name} of {local.owner} was taken for dead",
                why=f"it wrote nothing for longer than its lease of {duration(local.qos.lease)}",
                remedy="Write more often, or give it a longer lease or automatic liveliness",
            )

    def _liveliness_changed(self, participant: DdsParticipant, event: rtps.LivelinessChanged) -> None:
        local = self.endpoints.get(event.local)
        if local is not None and not event.alive:
            self.core.report(
                "writer-silent",
                who=local.owner,
                subject=local.topic.name,
                what=f"{{n}} time{{s}} a writer of {local.topic.name} was taken for dead by {local.owner}",
                why=f"{self.name_of(event.remote)} did not say in time that it is alive",
                remedy="Look at that writer, or at the network between",
            )

    def _report(self, report: DomainReport) -> None:
        """RTPS noticed something that concerns no endpoint of ours."""
        own = self.participants.get(report.prefix)
        remote = self.remotes.get(report.prefix)
        name = own.owner if own is not None else remote.infos[0].owner if remote is not None else ""
        if not name and report.prefix:
            name = f"participant {report.prefix.hex()}"
        self.core.notices.append(partial(report_domain, self.core, self.number, report, name))
        self.core.need(self.core.clock())

    def _trouble(self, participant: DdsParticipant, event: Trouble) -> None:
        local = self.endpoints.get(event.local)
        if local is not None:
            local.trouble(event.problem, event.remote, event.number)

    def _reasons(
        self, writer: Endpoint, reader: Endpoint, found: tuple[rtps.Mismatch, ...]
    ) -> tuple[Mismatch, ...]:
        """Why two do not fit, in the words of all engines; in those of RTPS for what other engines do not know."""
        if any(mismatch.policy is Policy.TYPE for mismatch in found):
            return (_reports.types_differ(writer.type_name, reader.type_name),)
        known = mismatches(writer.qos, reader.qos)
        return known or tuple(
            Mismatch(each.policy.value, "", "", f"Make the {each.policy.value} of both sides fit", each.text)
            for each in found
        )

    def _shown_either(self, data: EndpointData) -> Endpoint:
        own = self.endpoints.get(data.guid)
        return self.shown(data) if own is None else own.info()

    def _info_of(self, gid: bytes) -> ParticipantInfo:
        """The node, or at least the participant, that an endpoint belongs to."""
        own = self.participants.get(gid[:12])
        if own is not None:
            return own.info()
        remote = self.remotes.get(gid[:12])
        return Remote.unknown(gid, self.number) if remote is None else remote.info_of(gid)

    # --- The books of the lead ---------------------------------------------------------------------------

    def _take_lead(self, participant: DdsParticipant) -> None:
        """A participant keeps the books from now on: make them say what it knows."""
        self.lead = participant
        known = participant.rtps
        ours = {each.prefix for each in self.carrier.core.participants}
        there = {each.prefix: each for each in known.participants if each.prefix not in ours}
        for prefix in [prefix for prefix in self.remotes if prefix not in there]:
            self._lose(prefix)
        for participant_data in there.values():
            self._find(participant_data)
        endpoints = {each.guid: each for each in known.endpoints}
        for gone in [each for each in self.remote_endpoints() if each.guid not in endpoints]:
            self._lose_endpoint(gone)
        for each in endpoints.values():
            self._find_endpoint(each)
        self.nodes.listen(participant)

    def _find(self, data: ParticipantData) -> None:
        if data.prefix not in self.remotes and data.prefix not in self.participants:
            remote = self.remotes[data.prefix] = Remote(data, self.number)
            self.tell_all(Appeared, remote.infos)

    def _lose(self, prefix: bytes) -> None:
        remote = self.remotes.get(prefix)
        if remote is not None:
            for data in tuple(remote.endpoints.values()):
                self._lose_endpoint(data)
            self.tell_all(Vanished, remote.infos)
            del self.remotes[prefix]

    def _find_endpoint(self, data: EndpointData) -> None:
        remote = self.remotes.get(data.guid[:12])
        if remote is not None and data.guid not in remote.endpoints:
            remote.endpoints[data.guid] = data
            if self.core.watchers:
                self.core.tell(Appeared(self.shown(data)))

    def _lose_endpoint(self, data: EndpointData) -> None:
        remote = self.remotes.get(data.guid[:12])
        if remote is not None and remote.endpoints.pop(data.guid, None) is not None and self.core.watchers:
            self.core.tell(Vanished(self.shown(data)))

    def tell_all(self, event: type[Appeared] | type[Vanished], infos: tuple[ParticipantInfo, ...]) -> None:
        """Tell the watchers of each."""
        if self.core.watchers:
            for info in infos:
                self.core.tell(event(info))

    def _end(self, pair: tuple[bytes, bytes]) -> None:
        """A pair ends from our side."""
        if self.pairs.pop(pair, self) is self or not self.core.watchers:
            return
        writer, reader = (self.endpoint_shown(gid) for gid in pair)
        if writer is not None and reader is not None:
            self.core.tell(Unmatched(writer, reader))


class _Resume:
    """Fetches what RTPS holds back for a reader."""

    __slots__ = ("_home", "_reader")

    def __init__(self, home: DdsDomain, reader: DdsReader) -> None:
        self._home = home
        self._reader = reader

    def run(self) -> None:
        """Fetch."""
        if not self._reader.closed:
            self._reader.source.resume(self._home.now())
            self._home.poke()


def _pair(local: DdsEndpoint, remote: bytes) -> tuple[bytes, bytes]:
    return (local.gid, remote) if isinstance(local, DdsWriter) else (remote, local.gid)


def _ordered(local: DdsEndpoint, shown: Endpoint, other: Endpoint) -> tuple[Endpoint, Endpoint]:
    """The writer, then the reader."""
    return (shown, other) if isinstance(local, DdsWriter) else (other, shown)


_Handler: TypeAlias = Callable[[DdsDomain, "DdsParticipant", Any], None]

_HANDLERS: Final[dict[type, _Handler]] = {
    ParticipantFound: DdsDomain._participant_found,
    ParticipantChanged: DdsDomain._participant_changed,
    ParticipantLost: DdsDomain._participant_lost,
    EndpointFound: DdsDomain._endpoint_found,
    EndpointChanged: DdsDomain._endpoint_changed,
    EndpointLost: DdsDomain._endpoint_lost,
    rtps.Matched: DdsDomain._matched,
    rtps.Unmatched: DdsDomain._unmatched,
    rtps.Incompatible: DdsDomain._incompatible,
    Trouble: DdsDomain._trouble,
    rtps.LivelinessLost: DdsDomain._liveliness_lost,
    rtps.LivelinessChanged: DdsDomain._liveliness_changed,
}
