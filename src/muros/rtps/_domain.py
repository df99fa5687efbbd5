"""All participants of this process in one domain: what a datagram goes through, and what leaves.

Theory of operation. A datagram is parsed once. Its events are handed to those they are for by two tables: what a
writer of somebody else says, to the readers of ours that are matched with it; what a reader says, to the writer of
ours that is named, or, where no participant is named, to those matched with that reader. What nobody is matched with
is dropped and counted. Announcements of participants are heard once for all of ours (`_others.py`).

Participants of this process know each other without discovery (`_registry.py`), and what they say to each other does
not leave: it waits in `inside` until the call that caused it has done its work, and so do events for owners, in `news`.
Therefore nothing here is ever called from within itself, but for what users do while they take a sample. Discovery
with others leaves at the end of a call, too, gathered by place (`_gather.py`).

What comes from outside with the prefix of a participant of ours is an echo (multicast comes back) and dropped.
"""

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Final

from muros.rtps._agenda import Agenda
from muros.rtps._constants import ENTITYID_SPDP_WRITER
from muros.rtps._discovery import Discovery
from muros.rtps._discovery_data import EndpointData, InvalidDiscoveryData, ParticipantData
from muros.rtps._domain_settings import DOMAIN_DEFAULTS, NOWHERE, Addresses, DomainSettings, Transmit
from muros.rtps._endpoint import MILLISECOND, SECOND, Send
from muros.rtps._events import AckNack, Data, Event, InfoReply, InvalidMessage, NackFrag
from muros.rtps._farewell import Farewell
from muros.rtps._gather import SIZE, Gather
from muros.rtps._liveliness import WriterLease
from muros.rtps._news import DomainProblem, DomainReport, ParticipantEvent, Why
from muros.rtps._others import Others
from muros.rtps._participant import ParticipantCore
from muros.rtps._ports import FOR_READERS, ReaderPort, Route, WriterPort
from muros.rtps._reach import INSIDE, Hosts
from muros.rtps._registry import Registry
from muros.rtps._values import EntityId, Guid, GuidPrefix, Locator, split_guid
from muros.rtps._wire import info_dst, message, parse_untrusted

__all__ = ["DomainCore"]

TELL_AGAIN: Final = 10 * SECOND
"""The same problem with the same participant is reported once in this time."""

TOLD_MOST: Final = 256
"""Problems remembered as reported."""

LIVES_MOST: Final = 4096
"""Participants of this process remembered that have ended."""

PARSED_MOST: Final = 2048
"""Announcements of endpoints remembered as parsed, since every participant of ours hears them."""

PREFIX_SIZE: Final = 12

_Key = tuple[GuidPrefix, EntityId]


class DomainCore:
    """All participants of this process in one domain.

    transmit: sends a datagram. addresses: where this process listens, may change. report: told of problems that are
    not one participant's. Times (`now`) are ns of one monotonic clock. Everything is called from one thread.

    After any call, `deadline` says when `tick` is needed.
    """

    def __init__(
        self,
        domain: int,
        transmit: Transmit,
        addresses: Addresses = NOWHERE,
        *,
        settings: DomainSettings = DOMAIN_DEFAULTS,
        report: Callable[[DomainReport], object] | None = None,
    ) -> None:
        self.domain: Final = domain
        self.settings: Final = settings
        self.addresses = addresses
        self.counters: Counter[str] = Counter()
        """``datagrams`` and ``sent``; of what came, ``malformed``, ``echoes``, ``foreign`` (domain), ``unmatched``
        (events nobody wants), ``refused`` (discovery data, for a `DomainProblem`); ``dropped`` inside."""
        self.closed = False
        # From here on: for what stands in this room.
        self.now = 0
        self.busy = False
        self.hosts = Hosts(addresses)
        self.agenda = Agenda()
        self.others: Final = Others(self)
        self.peers: Final = self.others.peers
        self.registry = Registry()
        self.inside: deque[bytes] = deque()
        self.news: deque[tuple[Callable[[Any], object], Any]] = deque()
        self._transmit = transmit
        self._gather = Gather(self._count_and_transmit)
        self.gathered: Final = self._gather.pending
        self._report = report
        self._participants: dict[GuidPrefix, ParticipantCore] = {}
        self._routes: dict[_Key, Route] = {}
        self._writers: dict[_Key, WriterPort] = {}
        self._replies: dict[_Key, tuple[WriterPort, ...]] = {}
        self._reply: tuple[GuidPrefix, Locator] | None = None
        self._farewells: dict[GuidPrefix, Farewell] = {}
        self._lead: ParticipantCore | None = None
        self._soon = False
        self._number = 0
        self._lives: dict[GuidPrefix, tuple[int, ...]] = {}
        self._parsed: dict[bytes, EndpointData] = {}
        self._told: dict[tuple[DomainProblem, GuidPrefix], int] = {}

    # --- What its owner does -----------------------------------------------------------------------------

    @property
    def deadline(self) -> int | None:
        """When `tick` is needed next (ns on the clock of `now`, may lie in the past); None = not by itself."""
        return self.now if self.inside and not self.busy else self.agenda.next

    @property
    def participants(self) -> tuple[ParticipantCore, ...]:
        """Those of this process."""
        return tuple(self._participants.values())

    def find(self, prefix: GuidPrefix) -> ParticipantCore | None:
        """The one of this process with this prefix."""
        return self._participants.get(prefix)

    def participant(
        self,
        prefix: GuidPrefix,
        *,
        now: int,
        name: str = "",
        user_data: bytes = b"",
        properties: tuple[tuple[str, str], ...] = (),
        lease: int | None = None,
        on_event: Callable[[ParticipantEvent], object] | None = None,
    ) -> ParticipantCore:
        """A new participant. lease: others forget it when silent for so long; None = as the settings say.

        ValueError: `prefix` is not 12 bytes or in use here, or the domain is closed.
        """
        if self.closed:
            raise ValueError("the domain is closed")
        if len(prefix) != PREFIX_SIZE or not any(prefix):
            raise ValueError(
                f"a GUID prefix has {PREFIX_SIZE} bytes and not all are 0; this one is {prefix.hex()}"
            )
        if prefix in self._participants:
            raise ValueError(f"GUID prefix {prefix.hex()} is in use")
        self.now = now
        if prefix in self.peers:
            self.others.lose(self.peers[prefix], Why.LEFT, now)  # an earlier life of it, elsewhere
        data = self._addressed(
            ParticipantData(
                prefix=prefix,
                lease=self.settings.lease if lease is None else lease,
                name=name,
                user_data=user_data,
                properties=properties,
                domain=self.domain,
                domain_tag=self.settings.domain_tag,
            )
        )
        made = ParticipantCore(self, data, on_event, now)
        self._participants[prefix] = made
        if prefix in self._farewells:
            made.held = True
        else:
            self._start(made, now)
        self.finish()
        return made

    def receive(self, datagram: bytes, source: Locator | None, now: int) -> None:
        """A datagram has come. Never raises for what is in it; counts."""
        self.now = now
        self.counters["datagrams"] += 1
        self.busy = True
        try:
            self._hear(datagram, source, now)
            if self._soon:
                # What readers of our discovery miss leaves before users write to those that were just matched.
                self._soon = False
                self.agenda.run(now)
        finally:
            self.busy = False
        if self.inside or self.news or self.gathered:
            self.settle()

    def set_addresses(self, addresses: Addresses, now: int) -> None:
        """Interfaces came or went: tell everybody, and choose anew where to send."""
        self.now = now
        self.addresses = addresses
        self.hosts = Hosts(addresses)
        self.others.relocate(now)
        for participant in self._participants.values():
            participant.readdress(self._addressed(participant.data), now)
        self.finish()

    def tick(self, now: int) -> int | None:
        """Do what is due; returns the new `deadline`."""
        self.now = now
        if not self.busy:
            self.busy = True
            try:
                self.agenda.run(now)
            finally:
                self.busy = False
            self.finish()
        return self.deadline

    def close(self, now: int) -> None:
        """Close all participants."""
        self.now = now
        for participant in tuple(self._participants.values()):
            self.close_participant(participant, now)
        self.closed = True
        self.finish()

    # --- What its participants do ------------------------------------------------------------------------

    def finish(self) -> None:
        """The work of a call is done: hand over what has gathered."""
        if (self.inside or self.news or self.gathered) and not self.busy:
            self.settle()

    def settle(self) -> None:
        """Hand over events and what participants of this process have sent each other, as far as a turn goes."""
        inside, news, turn = self.inside, self.news, self.settings.turn
        self.busy = True
        try:
            while True:
                if self.gathered:
                    self._gather.flush()  # discovery goes before what users write when they learn of it
                elif news:
                    callback, event = news.popleft()
                    callback(event)
                elif inside and turn:
                    turn -= 1
                    self._hear(inside.popleft(), INSIDE, self.now)
                else:
                    break
        finally:
            self.busy = False

    def _count_and_transmit(self, datagram: bytes, place: Locator) -> None:
        self.counters["sent"] += 1
        self._transmit(datagram, place)

    def later(self, callback: Callable[[], object]) -> None:
        """Call this when the work of the present call is done."""
        self.news.append((lambda _: callback(), None))

    def sender(self, prefix: GuidPrefix) -> Send:
        """What the cores of a participant send through."""
        head, transmit, inside, counters = message(prefix), self._transmit, self.inside, self.counters

        def send(submessages: list[bytes], destination: GuidPrefix | None, place: Any) -> None:
            if destination is None:
                datagram = b"".join((head, *submessages))
            else:
                datagram = b"".join((head, info_dst(destination), *submessages))
                if self._reply is not None and self._reply[0] == destination:
                    place = self._reply[1]
            if place is not INSIDE:
                counters["sent"] += 1
                transmit(datagram, place)
            elif len(inside) < self.settings.queue:
                inside.append(datagram)
            else:
                counters["dropped"] += 1
                self.report(DomainProblem.QUEUE_FULL, prefix, counters["dropped"])

        return send

    def gatherer(self, prefix: GuidPrefix, send: Send) -> Send:
        """What discovery of a participant sends through, where `send` would send at once."""
        gather, others = self._gather, self.others

        def collect(submessages: list[bytes], destination: GuidPrefix | None, place: Any) -> None:
            if place is INSIDE or (self._reply is not None and self._reply[0] == destination):
                send(submessages, destination, place)
            else:
                kin = others.kin.get(place)
                size = SIZE if kin is None else kin.size
                gather.add(prefix, submessages, destination, place, kin is not None, size)

        return collect

    def ended(self, prefix: GuidPrefix, lasts: tuple[int, ...]) -> None:
        """A participant ends: remember the numbers of the last samples of its discovery, to go on with if it returns.

        Those who have missed its farewell would else take what it says then for old.
        """
        self._lives.pop(prefix, None)
        if len(self._lives) >= LIVES_MOST:
            del self._lives[next(iter(self._lives))]
        self._lives[prefix] = lasts

    def lasts(self, prefix: GuidPrefix) -> tuple[int, ...]:
        """What `ended` was told of this one; nothing where it was not here yet."""
        return self._lives.get(prefix, ())

    def elder(self, participant: ParticipantCore, prefix: GuidPrefix) -> "Discovery | None":
        """The discovery of another participant of this process that has met the one with this prefix."""
        others = (other for other in self._participants.values() if other is not participant)
        return next((found for other in others if (found := other.discovery_of(prefix)) is not None), None)

    def left(self, guid: Guid, sample: Data, now: int) -> None:
        """One of our participants has heard that an endpoint has gone: so it has for all."""
        for participant in tuple(self._participants.values()):
            if (discovery := participant.discovery_of(sample.source)) is not None:
                discovery.left(guid, sample, now)

    def number(self) -> int:
        """The number of a new announcement.

        A participant may come back, even in another process, with the GUID of an earlier one, and peers then wait for
        a number above that of its farewell: so numbers follow the clock.
        """
        self._number = max(self._number + 1, self.now // MILLISECOND)
        return self._number

    def add_writer(self, port: WriterPort) -> None:
        """Events for this writer are handed to it from now on."""
        self._writers[port.prefix, port.entity] = port

    def remove_writer(self, port: WriterPort) -> None:
        """It is there no more."""
        self._writers.pop((port.prefix, port.entity), None)

    def add_reply_route(self, reader: Guid, port: WriterPort) -> None:
        """This reader of somebody else is matched with a writer of ours."""
        key = split_guid(reader)
        ports = self._replies.get(key, ())
        if port not in ports:
            self._replies[key] = (*ports, port)

    def remove_reply_route(self, reader: Guid, port: WriterPort) -> None:
        """They are not matched any more."""
        key = split_guid(reader)
        left = tuple(other for other in self._replies.get(key, ()) if other is not port)
        if left:
            self._replies[key] = left
        else:
            self._replies.pop(key, None)

    def add_route(self, writer: Guid, port: ReaderPort) -> None:
        """This writer of somebody else is matched with a reader of ours."""
        route = self._route(writer)
        if port not in route.ports:
            route.set((*route.ports, port))

    def remove_route(self, writer: Guid, port: ReaderPort) -> None:
        """They are not matched any more."""
        route = self._route(writer)
        route.set(tuple(other for other in route.ports if other is not port))
        self._tidy(writer, route)

    def add_lease(self, lease: WriterLease) -> None:
        """The lease wants to know when something comes from its writer."""
        route = self._route(lease.guid)
        route.leases = (*route.leases, lease)

    def remove_lease(self, lease: WriterLease) -> None:
        """Not any more."""
        route = self._route(lease.guid)
        route.leases = tuple(other for other in route.leases if other is not lease)
        self._tidy(lease.guid, route)

    def endpoint_data(self, payload: bytes) -> EndpointData:
        """The endpoint in a payload; the same value for the same payload. `InvalidDiscoveryData`."""
        data = self._parsed.get(payload)
        if data is None:
            data = EndpointData.parse_untrusted(payload)
            if len(self._parsed) >= PARSED_MOST:
                del self._parsed[next(iter(self._parsed))]
            self._parsed[payload] = data
        return data

    def close_participant(self, participant: ParticipantCore, now: int) -> None:
        """Its owner takes it away."""
        prefix = participant.prefix
        was_there = not participant.held
        participant.stop(now)
        del self._participants[prefix]
        if was_there:
            self._choose_lead(now)
            if self.peers:
                farewell = Farewell(participant.say_farewell, partial(self._come_back, prefix), now)
                self._farewells[prefix] = farewell
                self.agenda.at(farewell, farewell.begin)

    def refuse(
        self, problem: DomainProblem, prefix: GuidPrefix, text: str, number: int | None = None
    ) -> None:
        """Something that was said in discovery is left out."""
        self.counters["refused"] += 1
        self.counters[problem.value] += 1
        self.report(problem, prefix, self.counters[problem.value] if number is None else number, text)

    def report(
        self,
        problem: DomainProblem,
        prefix: GuidPrefix,
        number: int,
        text: str = "",
        source: Locator | None = None,
    ) -> None:
        """Tell the owner, unless it was told a short while ago."""
        if self._report is None:
            return
        key = problem, prefix
        told = self._told.pop(key, None)
        if told is not None and self.now - told < TELL_AGAIN:
            self._told[key] = told
            return
        if len(self._told) >= TOLD_MOST:
            del self._told[next(iter(self._told))]
        self._told[key] = self.now
        if source is None and prefix in self.peers:
            source = self.peers[prefix].source
        self.news.append((self._report, DomainReport(problem, prefix, source, number, text)))

    # --- Hearing -----------------------------------------------------------------------------------------

    def _hear(self, datagram: bytes, source: Locator | None, now: int) -> None:
        """Hand the events in a datagram to those they are for."""
        try:
            content = parse_untrusted(datagram)
        except InvalidMessage as error:
            self._malformed(b"", str(error), source)
            return
        prefix = content.prefix
        outside = source is not INSIDE
        if outside and prefix in self._participants:
            self._echo(prefix, content.submessages, source)
            return
        if content.trouble:
            self._malformed(prefix, content.trouble, source)
        peer = self.peers.get(prefix)
        if peer is not None:
            peer.seen = now
        routes, agenda = self._routes, self.agenda
        event: Any  # of many kinds, told apart by `kind`
        for event in content.submessages:
            said_by, kind = event.source, type(event)
            if outside and said_by is not prefix:
                if said_by in self._participants:
                    self.counters["echoes"] += 1
                    continue
                if (other := self.peers.get(said_by)) is not None:
                    other.seen = now
            handle = FOR_READERS.get(kind)
            if handle is not None:
                route = routes.get((said_by, event.writer))
                if route is None:
                    if event.writer == ENTITYID_SPDP_WRITER and kind is Data and outside:
                        self.others.announced(event, source, now)
                    else:
                        self.counters["unmatched"] += 1
                    continue
                destination, reader = event.destination, event.reader
                for port in route.ports if destination is None else route.of(destination):
                    if reader == 0 or reader == port.entity:
                        core = port.core
                        handle(core, event, now)
                        if core.due < port.wake_at:
                            agenda.at(port, core.due)
                if route.leases:
                    self._alive(route, event, now)
            elif kind is InfoReply:
                self._reply_to(event)
            else:
                self._answered(event, now)
        self._reply = None

    def _answered(self, event: AckNack | NackFrag, now: int) -> None:
        """A reader says something to a writer of ours."""
        if event.destination is not None:
            port = self._writers.get((event.destination, event.writer))
            ports: tuple[WriterPort, ...] = () if port is None else (port,)
        else:
            ports = self._replies.get((event.source, event.reader), ())
        handled = False
        for port in ports:
            if port.entity == event.writer:
                handled = True
                if isinstance(event, AckNack):
                    port.core.on_acknack(event, now)
                else:
                    port.core.on_nack_frag(event, now)
                if port.core.due < port.wake_at:
                    self.agenda.at(port, port.core.due)
                self._soon |= port.core.due <= now
        if not handled:
            self.counters["unmatched"] += 1

    def _alive(self, route: Route, event: Event, now: int) -> None:
        """Something came from a writer: does it say that the writer is alive?"""
        if getattr(event, "liveliness", type(event) is Data):
            for lease in route.leases:
                lease.touch(now)

    def _reply_to(self, event: InfoReply) -> None:
        """Answers to what follows in this datagram go elsewhere than usual."""
        places = self.hosts.choose(event.unicast, None)
        self._reply = (event.source, places[0]) if places else None

    def _echo(self, prefix: GuidPrefix, events: list[Event], source: Locator | None) -> None:
        """A datagram has the prefix of one of ours: it has come back, or somebody else has the same prefix."""
        self.counters["echoes"] += 1
        for event in events:
            if (
                type(event) is Data
                and event.writer == ENTITYID_SPDP_WRITER
                and event.payload
                and not self._participants[prefix].is_own_announcement(event.payload)
            ):
                try:
                    stranger = ParticipantData.parse_untrusted(event.payload)
                except InvalidDiscoveryData:
                    continue
                if stranger.metatraffic_unicast != self.addresses.metatraffic_unicast:
                    self.counters["prefix-taken"] += 1
                    self.report(
                        DomainProblem.PREFIX_TAKEN, prefix, self.counters["prefix-taken"], source=source
                    )

    def _malformed(self, prefix: GuidPrefix, text: str, source: Locator | None) -> None:
        self.counters["malformed"] += 1
        self.report(
            DomainProblem.MALFORMED,
            prefix if prefix in self.peers else b"",
            self.counters["malformed"],
            text,
            source,
        )

    # --- Helpers -----------------------------------------------------------------------------------------

    def _start(self, participant: ParticipantCore, now: int) -> None:
        participant.start(now)
        self._choose_lead(now)

    def _come_back(self, prefix: GuidPrefix, now: int) -> None:
        """The farewell of a participant is over: if it is here again, others may see it."""
        del self._farewells[prefix]
        participant = self._participants.get(prefix)
        if participant is not None:
            self._start(participant, now)

    def _choose_lead(self, now: int) -> None:
        """The participant that has been here longest announces itself to those not known yet."""
        lead = next((each for each in self._participants.values() if not each.held), None)
        if lead is not self._lead:
            self._lead = lead
            if lead is not None:
                lead.lead(now)

    def _addressed(self, data: ParticipantData) -> ParticipantData:
        """With the addresses of this process."""
        at = self.addresses
        return replace(
            data,
            metatraffic_unicast=at.metatraffic_unicast,
            metatraffic_multicast=at.metatraffic_multicast,
            default_unicast=at.default_unicast,
            default_multicast=at.default_multicast,
        )

    def _route(self, writer: Guid) -> Route:
        key = split_guid(writer)
        route = self._routes.get(key)
        if route is None:
            route = self._routes[key] = Route()
        return route

    def _tidy(self, writer: Guid, route: Route) -> None:
        if not route.ports and not route.leases:
            self._routes.pop(split_guid(writer), None)
