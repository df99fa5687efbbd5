"""Services of the cyclonedds engine: those of rmw_cyclonedds, whose payloads begin with who asks and the number.

rmw_fastrtps says that in inline QoS, which Cyclone neither sends nor shows. So its requests cannot be answered and its
servers cannot be asked: they are recognised by their vendor, left alone as far as possible, and told as a finding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final

from muros.rtps import vendor_name
from muros.rtps._constants import VENDOR_EPROSIMA
from muros.space import _reports
from muros.space._door import ClosedError
from muros.space._qos import Qos
from muros.space._services import EngineReplier, EngineRequester, both_sides
from muros.space._values import IDENTITY_SIZE, Sample, Service, Topic, identity_of, split_identity
from muros.space.cyclone._endpoints import CycloneReader, CycloneWriter
from muros.space.dds._dialects import HEADER_SIZE, client_id, header, split_header

if TYPE_CHECKING:
    from muros.space.cyclone._participant import CycloneParticipant

__all__ = ["CycloneReplier", "CycloneRequester"]

DEAF: Final = VENDOR_EPROSIMA
"""Vendor whose services cannot be spoken with."""


class CycloneRequester(EngineRequester):
    """The client's side of a service. See `muros.space.Requester`."""

    __slots__ = ("_next", "_several", "reader", "writer")

    def __init__(
        self,
        participant: CycloneParticipant,
        service: Service,
        qos: Qos,
        on_reply: Callable[[int, bytes], object] | None,
        on_data: Callable[[Any], object] | None,
    ) -> None:
        super().__init__(participant, service, qos, on_reply, on_data)
        self._next = 0
        self._several = False
        self.writer: CycloneWriter = _RequestWriter(participant, self)
        self.reader: CycloneReader = _ReplyReader(participant, self)

    @property
    def servers(self) -> int:
        """Servers present that can be spoken with."""
        return both_sides(_heard(self.writer.matched), self.reader.matched)

    def sample(self, data: bytes, source_time: int | None, representation: int) -> Sample:
        """A request, not sent yet."""
        if self.writer.closed:
            raise ClosedError(f"the client of {self.service.name} is closed; make a new one")
        self._next += 1
        time = self.writer.core.clock() if source_time is None else source_time
        return Sample(data, time, self.gid, self._next, None, representation)

    def admits(self) -> bool:
        """Whether the servers have room for it."""
        return self.writer.admits()

    def deliver(self, request: Sample) -> bool:
        """Give it to the servers."""
        head = header(client_id(self.gid), request.sequence, request.representation)
        return self.writer.put(head + request.data, request.source_time, request.representation)

    def number_of(self, reply: Sample) -> int | None:
        """Number of the request that is answered."""
        return None if reply.related is None else split_identity(reply.related)[1]

    def met(self) -> None:
        """Somebody matches: there may be a server."""
        writer, service = self.writer, self.service.name
        if any(gid[:2] == DEAF for gid in writer.matched):
            _cannot(writer, service, f"requests to {service} are not sent" if not self.servers else "")
        servers = self.servers
        if servers > 1 and not self._several:
            _reports.several_servers(writer.core, writer.owner, service, servers)
        self._several = servers > 1
        if servers and self._waiting:
            writer.core.post(writer)


class CycloneReplier(EngineReplier):
    """The server's side of a service. See `muros.space.Replier`."""

    __slots__ = ("_ids", "reader", "writer")

    def __init__(
        self,
        participant: CycloneParticipant,
        service: Service,
        qos: Qos,
        on_request: Callable[[bytes, bytes], object] | None,
        on_data: Callable[[Any], object] | None,
    ) -> None:
        super().__init__(participant, service, qos, on_request, on_data)
        self._ids: dict[bytes, int] = {}
        """Ids of clients, by the gid of the writer of their requests."""
        topic = Topic(service.reply_topic, service.reply_type)
        self.writer: CycloneWriter = CycloneWriter(participant, topic, qos, service.name)
        self.reader: CycloneReader = _RequestReader(participant, self)

    @property
    def clients(self) -> int:
        """Clients present."""
        return both_sides(_heard(self.reader.matched), self.writer.matched)

    def deliver(self, identity: bytes, data: bytes, source_time: int | None, representation: int) -> bool:
        """Give a reply to its client."""
        if self.writer.closed:
            raise ClosedError(f"the server of {self.service.name} is closed; make a new one")
        if len(identity) != IDENTITY_SIZE:
            return False
        gid, sequence = split_identity(identity)
        client = self._ids.get(gid)
        if client is None or gid not in self.reader.matched:
            return False
        # A full client is not waited for; it is the one who asked.
        self.writer.put(header(client, sequence, representation) + data, source_time, representation)
        return True

    def asked(self, sample: Sample) -> Sample | None:
        """A request has come: who asks, and with which number, stands before the body."""
        gid = sample.writer_gid
        ids = split_header(sample.data, sample.representation)
        if ids is None or gid[:2] == DEAF:
            self.deaf_to("a request to {} was not understood")
            return None
        self._ids[gid], sample.sequence = ids
        sample.data = sample.data[HEADER_SIZE:]
        return sample

    def deaf_to(self, what: str) -> None:
        """Say what of the service `{}` cannot be read."""
        _cannot(self.writer, self.service.name, what.format(self.service.name))

    def left(self, gid: bytes) -> None:
        """A client is gone."""
        self._ids.pop(gid, None)


class _RequestWriter(CycloneWriter):
    """Writes the requests of one client."""

    __slots__ = ("_requester",)

    def __init__(self, participant: CycloneParticipant, requester: CycloneRequester) -> None:
        service = requester.service
        topic = Topic(service.request_topic, service.request_type)
        super().__init__(participant, topic, requester.qos, service.name)
        self._requester = requester

    @property
    def carries_requests(self) -> bool:
        """Whether it is a client's."""
        return True

    def run(self) -> None:
        """There is room, or a server."""
        if not self.closed:
            self._requester.flush()

    def connected(self, gid: bytes) -> None:
        """A reader of requests matches."""
        self._requester.met()

    def disconnected(self, gid: bytes) -> None:
        """A reader of requests matches no more."""
        self._requester.met()


class _ReplyReader(CycloneReader):
    """Reads the replies to one client; those to others are not kept."""

    __slots__ = ("_requester",)

    def __init__(self, participant: CycloneParticipant, requester: CycloneRequester) -> None:
        service = requester.service
        topic = Topic(service.reply_topic, service.reply_type)
        super().__init__(participant, topic, requester.qos, requester.announce, service.name)
        self._requester = requester

    def sample(self, sample: Sample) -> Sample | None:
        """A reply to one of our requests."""
        ids = split_header(sample.data, sample.representation)
        if ids is None or ids[0] != client_id(self._requester.gid) or sample.writer_gid[:2] == DEAF:
            return None
        sample.related = identity_of(self._requester.gid, ids[1])
        sample.data = sample.data[HEADER_SIZE:]
        return sample

    def connected(self, gid: bytes) -> None:
        """A writer of replies matches."""
        self._requester.met()


class _RequestReader(CycloneReader):
    """Reads the requests to one server."""

    __slots__ = ("_replier",)

    def __init__(self, participant: CycloneParticipant, replier: CycloneReplier) -> None:
        service = replier.service
        topic = Topic(service.request_topic, service.request_type)
        super().__init__(participant, topic, replier.qos, replier.announce, service.name)
        self._replier = replier

    @property
    def carries_requests(self) -> bool:
        """Whether it is a server's."""
        return True

    def sample(self, sample: Sample) -> Sample | None:
        """A request."""
        return self._replier.asked(sample)

    def connected(self, gid: bytes) -> None:
        """A client is there. Said at once if it cannot be understood: its first request may come before the match."""
        super().connected(gid)
        if gid[:2] == DEAF:
            self._replier.deaf_to("requests to {} from a client are not understood")

    def disconnected(self, gid: bytes) -> None:
        """A client is gone."""
        super().disconnected(gid)
        self._replier.left(gid)


def _heard(gids: Iterable[bytes]) -> Iterator[bytes]:
    """Those that can be spoken with."""
    return (gid for gid in gids if gid[:2] != DEAF)


def _cannot(writer: CycloneWriter, service: str, what: str) -> None:
    """Say that services of the other dialect are out of reach."""
    writer.core.report(
        "service-dialect",
        who=writer.owner,
        subject=service,
        what=what or f"requests to {service} also reach a server that cannot read them",
        why=f"{vendor_name(DEAF)} peers (rmw_fastrtps) say who asks in inline QoS, which Cyclone DDS does not carry",
        remedy="Use dds: instead of cyclonedds:, it speaks with both kinds at once",
    )
