"""How a participant learns of others' writers and readers, and tells of its own (DDSI-RTPS 2.3, 8.5.4).

Two topics carry this, one for writers and one for readers, and a third carries that somebody is alive (8.4.13); all
three are reliable, keep the last sample of each instance, and give it to those who come late. They stand on the same
cores as users' topics; who talks to whom follows from participant discovery alone.

What a peer says is bounded: in endpoints, in bytes, and in changes per time. What comes faster is refused for a
while, which a reliable writer bears.
"""

from typing import TYPE_CHECKING, Final

from muros.rtps._agenda import Timed
from muros.rtps._constants import (
    ENTITYID_PARTICIPANT_MESSAGE_READER,
    ENTITYID_PARTICIPANT_MESSAGE_WRITER,
    ENTITYID_SEDP_PUBLICATIONS_READER,
    ENTITYID_SEDP_PUBLICATIONS_WRITER,
    ENTITYID_SEDP_SUBSCRIPTIONS_READER,
    ENTITYID_SEDP_SUBSCRIPTIONS_WRITER,
    BuiltinEndpoint,
    StatusInfo,
)
from muros.rtps._discovery_data import Assertion, EndpointData, InvalidDiscoveryData, departure, key_untrusted
from muros.rtps._endpoint import MILLISECOND, NEVER
from muros.rtps._events import Data
from muros.rtps._news import DomainProblem, EndpointChanged, EndpointFound, EndpointLost, Why
from muros.rtps._parameters import InvalidParameters, status_info
from muros.rtps._peer import Budget, Peer
from muros.rtps._ports import ReaderPort, WriterPort
from muros.rtps._reader import Deliver, ReaderCore
from muros.rtps._values import EntityId, Guid, GuidPrefix, guid_of, split_guid
from muros.rtps._writer import WriterCore

if TYPE_CHECKING:
    from muros.rtps._participant import ParticipantCore

__all__ = ["Discovery"]

RESUME: Final = 100 * MILLISECOND
"""When a peer that has said too much at once is heard again."""

_GONE: Final = StatusInfo.DISPOSED | StatusInfo.UNREGISTERED

# Of each topic: our writer, with whom it talks, and which bits say that a peer has the counterparts (9.3.2, 8.5.4.2).
_WRITERS: Final = (
    (
        ENTITYID_SEDP_PUBLICATIONS_WRITER,
        ENTITYID_SEDP_PUBLICATIONS_READER,
        BuiltinEndpoint.PUBLICATIONS_ANNOUNCER,
        BuiltinEndpoint.PUBLICATIONS_DETECTOR,
    ),
    (
        ENTITYID_SEDP_SUBSCRIPTIONS_WRITER,
        ENTITYID_SEDP_SUBSCRIPTIONS_READER,
        BuiltinEndpoint.SUBSCRIPTIONS_ANNOUNCER,
        BuiltinEndpoint.SUBSCRIPTIONS_DETECTOR,
    ),
    (
        ENTITYID_PARTICIPANT_MESSAGE_WRITER,
        ENTITYID_PARTICIPANT_MESSAGE_READER,
        BuiltinEndpoint.PARTICIPANT_MESSAGE_WRITER,
        BuiltinEndpoint.PARTICIPANT_MESSAGE_READER,
    ),
)


class Known:
    """What one peer has said of its endpoints."""

    __slots__ = ("budget", "endpoints", "peer", "size", "sizes")

    def __init__(self, peer: Peer, budget: Budget) -> None:
        self.peer = peer
        self.budget = budget
        self.endpoints: dict[Guid, EndpointData] = {}
        self.sizes: dict[Guid, int] = {}
        self.size = 0


class Discovery(Timed):
    """The discovery of one participant: `known` are its peers and their endpoints.

    The owner is told of endpoints by `_found`, `_changed` and `_lost`, and of assertions by `_asserted`.
    """

    __slots__ = ("_domain", "_owner", "_paused", "_readers", "_writers", "known")

    def __init__(self, owner: "ParticipantCore") -> None:
        super().__init__()
        self._owner = owner
        self._domain = owner.home
        self.known: dict[GuidPrefix, Known] = {}
        self._writers: dict[EntityId, WriterPort] = {}
        self._readers: dict[EntityId, ReaderPort] = {}
        self._paused: dict[GuidPrefix, None] = {}
        settings = self._domain.settings
        send = owner.gathered_send
        lasts = self._domain.lasts(owner.prefix) or (0,) * len(_WRITERS)
        for (writer, reader, _, _), last in zip(_WRITERS, lasts, strict=True):
            writing = self._writers[writer] = WriterPort(
                WriterCore(
                    guid_of(owner.prefix, writer),
                    send,
                    transient_local=True,
                    last=last,
                    settings=settings.discovery_writer,
                    report=owner.reporter(guid_of(owner.prefix, writer)),
                )
            )
            self._domain.add_writer(writing)
            deliver: Deliver = (
                self._hear_assertion if writer == ENTITYID_PARTICIPANT_MESSAGE_WRITER else self._hear_endpoint
            )
            self._readers[writer] = ReaderPort(
                ReaderCore(
                    guid_of(owner.prefix, reader),
                    send,
                    deliver,
                    settings=settings.discovery_reader,
                    report=owner.reporter(guid_of(owner.prefix, reader)),
                )
            )

    # --- Peers -------------------------------------------------------------------------------------------

    def meet(self, peer: Peer, now: int) -> None:
        """Somebody is there, or can be reached elsewhere than before."""
        known = self.known.get(peer.prefix)
        elder = None
        if known is None:
            settings = self._domain.settings
            known = Known(peer, Budget(settings.changes_burst, settings.changes_per_second, now))
            if peer.kin:
                elder = self._domain.elder(self._owner, peer.prefix)
            self.known[peer.prefix] = known
        has = peer.data.builtin_endpoints
        for writer, reader, announcer, detector in _WRITERS:
            if has & detector:
                port, remote = self._writers[writer], guid_of(peer.prefix, reader)
                port.core.match(
                    remote, peer.discovery, now, reliable=True, transient_local=True, patient=peer.kin
                )
                self._domain.add_reply_route(remote, port)
                self._domain.agenda.at(port, port.core.due)
            if has & announcer:
                listener, remote = self._readers[writer], guid_of(peer.prefix, writer)
                listener.core.match_writer(
                    remote,
                    peer.discovery,
                    now,
                    reliable=True,
                    hello_base=peer.hello_base,
                    patient=peer.kin,
                    known=0 if elder is None else elder.known_from(remote),
                )
                self._domain.add_route(remote, listener)
                self._domain.agenda.at(listener, listener.core.due)
        if elder is not None:
            self._inherit(known, elder, now)

    def known_from(self, writer: Guid) -> int:
        """Everything up to this sample of somebody's writer of endpoints was heard; 0 = nothing to rely on."""
        entity = split_guid(writer)[1]
        if entity == ENTITYID_PARTICIPANT_MESSAGE_WRITER:
            return 0
        return self._readers[entity].core.known_from(writer)

    def is_heard_by(self, prefix: GuidPrefix) -> bool:
        """Whether somebody's reader of our writers has answered, and so knows of us."""
        core = self._writers[ENTITYID_SEDP_PUBLICATIONS_WRITER].core
        return core.is_heard_by(guid_of(prefix, ENTITYID_SEDP_PUBLICATIONS_READER))

    def part(self, prefix: GuidPrefix, why: Why, now: int) -> None:
        """Somebody is there no more, and so are its endpoints."""
        known = self.known.get(prefix)
        if known is None:
            return
        for guid in tuple(known.endpoints):
            self._forget(known, guid, why, now)
        del self.known[prefix]
        self._paused.pop(prefix, None)
        for writer, reader, _, _ in _WRITERS:
            port, listener = self._writers[writer], self._readers[writer]
            port.core.unmatch(guid_of(prefix, reader), now)
            self._domain.remove_reply_route(guid_of(prefix, reader), port)
            listener.core.unmatch_writer(guid_of(prefix, writer))
            self._domain.remove_route(guid_of(prefix, writer), listener)

    def close(self) -> None:
        """The participant has parted from all its peers."""
        self._domain.ended(self._owner.prefix, tuple(port.core.last for port in self._writers.values()))
        for port in self._writers.values():
            self._domain.remove_writer(port)
            self._domain.agenda.forget(port)
        for listener in self._readers.values():
            self._domain.agenda.forget(listener)
        self._domain.agenda.forget(self)

    # --- Ours --------------------------------------------------------------------------------------------

    def announce(self, endpoint: EndpointData, now: int) -> None:
        """Tell of a writer or reader of ours, or what has changed of it."""
        self._write(self._topic(endpoint), endpoint.payload(), b"", endpoint.guid, now)

    def withdraw(self, endpoint: EndpointData, now: int) -> None:
        """Tell that it is gone."""
        self._write(self._topic(endpoint), b"", departure(endpoint.guid), endpoint.guid, now)

    def say_alive(self, manual: bool, now: int) -> None:
        """Tell that our writers of a kind of liveliness are alive."""
        payload = Assertion(self._owner.prefix, manual).payload()
        self._write(self._writers[ENTITYID_PARTICIPANT_MESSAGE_WRITER], payload, b"", payload[:24], now)

    def _topic(self, endpoint: EndpointData) -> WriterPort:
        if endpoint.is_writer:
            return self._writers[ENTITYID_SEDP_PUBLICATIONS_WRITER]
        return self._writers[ENTITYID_SEDP_SUBSCRIPTIONS_WRITER]

    def _write(self, port: WriterPort, payload: bytes, inline_qos: bytes, instance: bytes, now: int) -> None:
        port.core.write(payload, now, inline_qos=inline_qos, instance=instance, last=not payload)
        self._domain.agenda.at(port, port.core.due)

    def _inherit(self, known: Known, elder: "Discovery", now: int) -> None:
        """Learn of a peer's endpoints what an older participant of this process has heard."""
        heard = elder.known[known.peer.prefix]
        for writer, is_writer in (
            (ENTITYID_SEDP_PUBLICATIONS_WRITER, True),
            (ENTITYID_SEDP_SUBSCRIPTIONS_WRITER, False),
        ):
            if elder.known_from(guid_of(known.peer.prefix, writer)):
                for guid, endpoint in tuple(heard.endpoints.items()):
                    if endpoint.is_writer == is_writer:
                        self._learn(known, endpoint, heard.sizes[guid], now)

    # --- Theirs ------------------------------------------------------------------------------------------

    def _hear_endpoint(self, writer: Guid, sample: Data) -> bool:
        """Somebody tells of an endpoint of its own; False = too much at once."""
        known = self.known.get(sample.source)
        if known is None:
            return True
        now = self._domain.now
        if not known.budget.take(now):
            if sample.source not in self._paused:
                self._paused[sample.source] = None
                self._domain.report(
                    DomainProblem.FLOOD, sample.source, self._domain.settings.changes_per_second
                )
            self._domain.agenda.at(self, now + RESUME)
            return False
        try:
            inline_qos = sample.inline_qos
            if (
                not sample.payload
                or sample.key
                or (inline_qos is not None and status_info(inline_qos) & _GONE)
            ):
                guid = key_untrusted(sample.payload, sample.inline_qos)
                if guid in known.endpoints:  # the first to hear it says so to all
                    self._domain.left(guid, sample, now)
                return True
            endpoint = self._domain.endpoint_data(sample.payload)
        except (InvalidDiscoveryData, InvalidParameters) as error:
            self._domain.refuse(DomainProblem.DISCOVERY_MALFORMED, sample.source, str(error))
            return True
        is_writer = split_guid(writer)[1] == ENTITYID_SEDP_PUBLICATIONS_WRITER
        if endpoint.guid[:12] != sample.source or endpoint.is_writer != is_writer:
            self._domain.refuse(DomainProblem.PREFIX_MISMATCH, sample.source, endpoint.guid.hex())
            return True
        self._learn(known, endpoint, len(sample.payload), now)
        return True

    def left(self, guid: Guid, sample: Data, now: int) -> None:
        """An endpoint has gone, as this participant or another of this process has heard.

        One that has inherited what others had heard might not be told itself any more. What it has heard of the
        endpoint after that sample holds.
        """
        known = self.known.get(sample.source)
        listener = self._readers.get(sample.writer)
        if (
            known is not None
            and listener is not None
            and guid in known.endpoints
            and listener.core.next_of(guid_of(sample.source, sample.writer)) <= sample.sequence
        ):
            self._forget(known, guid, Why.LEFT, now)

    def _learn(self, known: Known, endpoint: EndpointData, size: int, now: int) -> None:
        guid = endpoint.guid
        before = known.endpoints.get(guid)
        if before == endpoint:
            return
        settings = self._domain.settings
        if before is None and len(known.endpoints) >= settings.endpoints_per_peer:
            self._domain.refuse(
                DomainProblem.TOO_MANY_ENDPOINTS,
                known.peer.prefix,
                endpoint.topic,
                settings.endpoints_per_peer,
            )
            return
        grown = known.size + size - known.sizes.get(guid, 0)
        if grown > settings.memory_per_peer:
            self._domain.refuse(
                DomainProblem.DISCOVERY_TOO_LARGE, known.peer.prefix, endpoint.topic, settings.memory_per_peer
            )
            return
        if before is not None and before.topic != endpoint.topic:
            self._forget(known, guid, Why.CHANGED, now)
            before = None
        known.size = grown
        known.sizes[guid] = size
        known.endpoints[guid] = endpoint
        if before is None:
            self._owner.tell(EndpointFound(endpoint))
            self._owner.found(endpoint, known.peer, now)
        else:
            self._owner.tell(EndpointChanged(endpoint, before))
            self._owner.changed(endpoint, before, known.peer, now)

    def _forget(self, known: Known, guid: Guid, why: Why, now: int) -> None:
        endpoint = known.endpoints.pop(guid)
        known.size -= known.sizes.pop(guid)
        self._owner.lost(endpoint, why, now)
        self._owner.tell(EndpointLost(endpoint, why))

    def _hear_assertion(self, writer: Guid, sample: Data) -> bool:
        """Somebody tells that it, or what it speaks for, is alive."""
        if sample.payload and not sample.key:
            try:
                assertion = Assertion.parse_untrusted(sample.payload)
            except InvalidDiscoveryData as error:
                self._domain.refuse(DomainProblem.DISCOVERY_MALFORMED, sample.source, str(error))
                return True
            if assertion is not None and assertion.prefix == sample.source:
                self._owner.asserted(assertion, self._domain.now)
        return True

    def wake(self, now: int) -> int:
        """Hear again those who said too much at once."""
        self._paused.clear()
        for listener in self._readers.values():
            listener.core.resume(now)
            self._domain.agenda.at(listener, listener.core.due)
        return NEVER
