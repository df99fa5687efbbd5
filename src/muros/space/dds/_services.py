"""Services of the dds engine, in both dialects at once (see `_dialects`).

A client writes one request for all servers while they speak one dialect, else one DATA for each. At the door a
request is known by its client's writer and its number; `shifted` keeps the numbers of requests that went out with
another sequence number, because they had to wait or went out more than once.

A server answers the reader that asked, and lets those hear it that merely listen. A reply to a client whose reader
of replies is not known yet (discovery has told one side before the other) waits for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from muros.rtps import Received, guid_of
from muros.space import _reports
from muros.space._door import ClosedError
from muros.space._qos import Qos
from muros.space._services import EngineReplier, EngineRequester, both_sides
from muros.space._timers import Timer
from muros.space._values import (
    GID_SIZE,
    IDENTITY_SIZE,
    Sample,
    Service,
    Topic,
    identity_of,
    split_identity,
)
from muros.space.dds._dialects import (
    HEADER_SIZE,
    Dialect,
    client_id,
    header,
    inline_reply,
    inline_request,
    split_header,
)
from muros.space.dds._endpoints import DdsReader, DdsWriter, encapsulated

if TYPE_CHECKING:
    from muros.space.dds._participant import DdsParticipant

__all__ = ["DdsReplier", "DdsRequester"]

SHIFTED_MOST: Final = 1000
"""Requests remembered whose reply carries another number than the door gave them."""

OPEN_MOST: Final = 1000
"""Requests remembered that are not answered yet."""

SILENCE_MOST: Final = 300_000_000
"""ns after which a server of Cyclone DDS is taken to hear us, though it has said nothing."""

LISTEN_EVERY: Final = 5_000_000
"""ns between two looks whether it has."""


class DdsRequester(EngineRequester):
    """The client's side of a service. See `muros.space.Requester`."""

    __slots__ = ("_client_id", "_inline", "_number", "_open", "_servers", "_shifted", "reader", "writer")

    def __init__(
        self,
        participant: DdsParticipant,
        service: Service,
        qos: Qos,
        writer_gid: bytes,
        reader_gid: bytes,
        on_reply: Callable[[int, bytes], object] | None,
        on_data: Callable[[Any], object] | None,
    ) -> None:
        super().__init__(participant, service, qos, on_reply, on_data)
        self.reader: _ReplyReader = _ReplyReader(participant, self, qos, reader_gid)
        self.writer: _RequestWriter = _RequestWriter(participant, self, qos, writer_gid)
        self._inline = inline_request(reader_gid)
        self._client_id = client_id(writer_gid)
        self._number = 0
        self._open: dict[int, tuple[bytes, ...]] = {}
        """Readers of requests that were given a request which is not answered yet, by its number."""
        self._shifted: dict[int, int] = {}
        self._servers = 0

    @property
    def servers(self) -> int:
        """Servers present: who reads requests and writes replies."""
        return 0 if self.writer.closed else self._servers

    def sample(self, data: bytes, source_time: int | None, representation: int) -> Sample:
        """A request, not sent yet."""
        writer = self.writer
        if writer.closed:
            raise ClosedError(f"the writer of {writer.topic.name} is closed; make a new one")
        self._number = max(self._number, writer.out.last) + 1
        time = writer.core.clock() if source_time is None else source_time
        return Sample(data, time, writer.gid, self._number, None, representation)

    def admits(self) -> bool:
        """Whether the servers have room for it: only writing tells."""
        return True

    def deliver(self, request: Sample) -> bool:
        """Send it: once when all readers speak one dialect, else to each of them."""
        writer = self.writer
        readers = writer.matched
        home = writer.participant.home
        if len(self._open) >= OPEN_MOST:
            del self._open[next(iter(self._open))]
        self._open[request.sequence] = readers  # before it goes: a server in this process may answer at once
        dialects = [home.dialect_of(gid) for gid in readers]
        if dialects and dialects.count(dialects[0]) == len(dialects):
            sent = self._put(request, dialects[0], None)
        else:
            put = [self._put(request, dialect, gid) for gid, dialect in zip(readers, dialects, strict=True)]
            sent = any(put)
        if not sent:
            self._open.pop(request.sequence, None)
        return sent

    def number_of(self, reply: Sample) -> int | None:
        """Number of the request that is answered."""
        return None if reply.related is None else split_identity(reply.related)[1]

    def identity_in(self, received: Received, payload: bytes) -> tuple[int, int] | None:
        """Number of our request that a reply answers and where its body begins; None if it is somebody else's."""
        home = self.writer.participant.home
        if home.dialect_of(received.writer) is Dialect.HEADER:
            ids = split_header(payload[4:], payload[0] << 8 | payload[1])
            if ids is None or ids[0] != self._client_id:
                return None
            self._open.pop(ids[1], None)
            return ids[1], 4 + HEADER_SIZE
        related = self.reader.related(received)
        if related is None:
            return None
        gid, sequence = split_identity(related)
        if gid not in (self.reader.gid, self.writer.gid):
            return None
        number = self._shifted.get(sequence, sequence)
        self._open.pop(number, None)
        return number, 4

    def met(self) -> None:
        """Somebody matches the writer or the reader: there may be a server now."""
        before, servers = self._servers, both_sides(self.writer.ready, self.reader.matched)
        self._servers = servers
        if servers > 1 >= before:
            writer = self.writer
            _reports.several_servers(writer.core, writer.owner, self.service.name, servers)
        if servers and self._waiting:
            self.flush()

    def left(self) -> None:
        """A reader of requests has gone: what was given to it, and to nobody else who is there, stays unanswered."""
        here = set(self.writer.matched)
        lost = [number for number, readers in self._open.items() if here.isdisjoint(readers)]
        for number in lost:
            del self._open[number]
        if lost:
            writer = self.writer
            _reports.request_unanswered(writer.core, writer.owner, self.service.name, len(lost))
        self.met()

    def _put(self, request: Sample, dialect: Dialect, to: bytes | None) -> bool:
        data, inline = request.data, self._inline
        if dialect is Dialect.HEADER:
            data = header(self._client_id, request.sequence, request.representation) + data
            inline = b""
        payload = encapsulated(data, request.representation)
        sequence = self.writer.put(payload, request.source_time, inline, to)
        if sequence and sequence != request.sequence and dialect is Dialect.INLINE:
            if len(self._shifted) >= SHIFTED_MOST:
                del self._shifted[next(iter(self._shifted))]
            self._shifted[sequence] = request.sequence
        return sequence != 0


class _Client(NamedTuple):
    """Who has asked, and how to answer."""

    dialect: Dialect
    named: bytes
    """The gid its requests name, which its replies carry."""
    id: int
    """Its id in headers."""

    @property
    def reader(self) -> bytes | None:
        """The reader it waits with; None when only its participant is known."""
        return self.named if self.dialect is Dialect.INLINE and self.named[15] & 4 else None


class _Late(NamedTuple):
    """A reply that waits for its client's reader."""

    until: int
    client: bytes
    payload: bytes
    source_time: int | None
    inline_qos: bytes


class DdsReplier(EngineReplier):
    """The server's side of a service. See `muros.space.Replier`."""

    __slots__ = ("_clients", "_gone", "_late", "_timer", "reader", "writer")

    def __init__(
        self,
        participant: DdsParticipant,
        service: Service,
        qos: Qos,
        writer_gid: bytes,
        reader_gid: bytes,
        on_request: Callable[[bytes, bytes], object] | None,
        on_data: Callable[[Any], object] | None,
    ) -> None:
        super().__init__(participant, service, qos, on_request, on_data)
        self._clients: dict[bytes, _Client] = {}
        self._gone: deque[bytes] = deque(maxlen=64)
        self._late: deque[_Late] | None = None
        self._timer: Timer | None = None
        self.writer: _ReplyWriter = _ReplyWriter(participant, self, qos, writer_gid)
        self.reader: _RequestReader = _RequestReader(participant, self, qos, reader_gid)

    @property
    def clients(self) -> int:
        """Clients present: who writes requests and reads replies."""
        return both_sides(self.reader.matched, self.writer.matched)

    def deliver(self, identity: bytes, data: bytes, source_time: int | None, representation: int) -> bool:
        """Send a reply to its client, or keep it until the client's reader is known."""
        writer = self.writer
        if writer.closed:
            raise ClosedError(f"the writer of {writer.topic.name} is closed; make a new one")
        client = self._clients.get(bytes(identity[:GID_SIZE])) if len(identity) == IDENTITY_SIZE else None
        if client is None:
            return False
        gid, sequence = split_identity(identity)
        inline_qos = b""
        if client.dialect is Dialect.HEADER:
            data = header(client.id, sequence, representation) + data
        else:
            inline_qos = inline_reply(client.named, sequence)
        reply = _Late(0, gid, encapsulated(data, representation), source_time, inline_qos)
        if self._send(reply, client):
            return True
        if client.reader in self._gone:
            return False
        self._keep(reply)
        return True

    def asked(self, received: Received, payload: bytes) -> tuple[int, int]:
        """A request has come: remember its client. Returns its number at the door and where its body begins."""
        gid = received.writer
        home = self.writer.participant.home
        if home.dialect_of(gid) is Dialect.HEADER:
            ids = split_header(payload[4:], payload[0] << 8 | payload[1])
            if ids is not None:
                self._clients[gid] = _Client(Dialect.HEADER, gid, ids[0])
                return ids[1], 4 + HEADER_SIZE
        if gid not in self._clients:
            related = self.reader.related(received)
            named = gid if related is None else related[:GID_SIZE]
            # Whoever names somebody else's reader would have us answer there.
            self._clients[gid] = _Client(Dialect.INLINE, named if named[:12] == gid[:12] else gid, 0)
        return received.sequence, 4

    def left(self, gid: bytes) -> None:
        """A writer of requests is gone."""
        self._clients.pop(gid, None)

    def reader_came(self, gid: bytes) -> None:
        """A reader of replies matches."""
        if gid in self._gone:
            self._gone.remove(gid)
        self.retry()

    def retry(self) -> None:
        """Send the replies that wait for their client's reader, or for room."""
        late, self._late = self._late, None
        for reply in late or ():
            client = self._clients.get(reply.client)
            if client is None:
                self.unmatched()
            elif not self._send(reply, client):
                self._late = self._late or deque()
                self._late.append(reply)
        self._schedule()

    def reader_left(self, gid: bytes) -> None:
        """A reader of replies matches no more."""
        self._gone.append(gid)

    def detach(self) -> None:
        """It has been taken out of the space."""
        super().detach()
        self._late = None
        self._clients.clear()
        self._schedule()

    def _send(self, reply: _Late, client: _Client) -> bool:
        """Write it for its client, and for those that only listen; False while its reader is not known, or full."""
        writer = self.writer
        matched = writer.matched
        if client.reader is not None:
            targets = [client.reader] if client.reader in matched else []
        else:
            targets = [gid for gid in matched if gid[:12] == reply.client[:12]]
        if not targets:
            return False
        if len(matched) > len(targets):
            asking = {gid[:12] for gid in self.reader.matched}
            targets += [gid for gid in matched if gid[:12] not in asking]
        sent = [
            writer.put(
                reply.payload, reply.source_time, reply.inline_qos, target if len(matched) > 1 else None
            )
            for target in targets
        ]
        return sent[0] != 0

    def _keep(self, reply: _Late) -> None:
        core = self.writer.core
        if self._late is None:
            self._late = deque()
        if len(self._late) >= core.limits.resource_limit:
            self._late.popleft()
            self.unmatched()
        self._late.append(reply._replace(until=core.timers.now() + core.limits.request_wait))
        self._schedule()

    def _schedule(self) -> None:
        until = self._late[0].until if self._late else None
        self._timer = self.writer.core.timers.move(self._timer, until, self._give_up)

    def _give_up(self) -> None:
        self._timer = None
        now = self.writer.core.timers.now()
        while self._late and self._late[0].until <= now:
            self._late.popleft()
            self.unmatched()
        self._schedule()


class _RequestWriter(DdsWriter):
    """Writes the requests of one client.

    A reader of Cyclone DDS takes the first HEARTBEAT that it hears as the end of what was before it. A request that
    goes out when we have matched it, but it not us, would be lost for it: it is a server when it has spoken to us.
    """

    __slots__ = ("_ready", "_requester", "_silent", "_timer")

    def __init__(self, participant: DdsParticipant, requester: DdsRequester, qos: Qos, gid: bytes) -> None:
        service = requester.service
        topic = Topic(service.request_topic, service.request_type)
        super().__init__(participant, topic, qos, gid, service.name)
        self._requester = requester
        self._ready: set[bytes] = set()
        self._silent: dict[bytes, int] = {}
        """Those that have not spoken, and when that is overlooked."""
        self._timer: Timer | None = None

    @property
    def carries_requests(self) -> bool:
        """Whether it is a client's."""
        return True

    @property
    def ready(self) -> tuple[bytes, ...]:
        """The matched readers to which a request may go."""
        return tuple(gid for gid in self.matched if gid in self._ready)

    def run(self) -> None:
        """There is room again."""
        if not self.closed:
            self._requester.flush()

    def connected(self, remote: bytes) -> None:
        """A reader of requests matches."""
        if self.participant.home.dialect_of(remote) is Dialect.HEADER and self.out.qos.reliable:
            self._silent[remote] = self.core.timers.now() + SILENCE_MOST
            self._listen()
        else:
            self._ready.add(remote)
            self._requester.met()

    def disconnected(self, remote: bytes) -> None:
        """A reader of requests matches no more."""
        self._silent.pop(remote, None)
        self._ready.discard(remote)
        self._requester.left()

    def detach(self) -> None:
        """Let go of everything held."""
        super().detach()
        self._silent.clear()
        self._timer = self.core.timers.move(self._timer, None, self._listen)

    def _listen(self) -> None:
        """See who has spoken since, or been silent for long enough."""
        timers = self.core.timers
        now = timers.now()
        heard = {guid_of(*proxy.key) for proxy in self.out.core.readers if proxy.count is not None}
        for remote, until in list(self._silent.items()):
            if remote in heard or until <= now:
                del self._silent[remote]
                self._ready.add(remote)
        self._timer = timers.move(self._timer, now + LISTEN_EVERY if self._silent else None, self._listen)
        self._requester.met()


class _ReplyReader(DdsReader):
    """Reads the replies to one client; those to others are not taken in."""

    __slots__ = ("_requester",)

    def __init__(self, participant: DdsParticipant, requester: DdsRequester, qos: Qos, gid: bytes) -> None:
        service = requester.service
        topic = Topic(service.reply_topic, service.reply_type)
        super().__init__(participant, topic, qos, gid, requester.announce, service.name)
        self._requester = requester

    def sample(self, received: Received, payload: bytes) -> Sample | None:
        """A reply to one of our requests, its `related` as the door names the request."""
        found = self._requester.identity_in(received, payload)
        sample = None if found is None else super().sample(received, payload)
        if found is None or sample is None:
            return None
        number, body = found
        sample.data = sample.data[body - 4 :]
        sample.related = identity_of(self._requester.gid, number)
        return sample

    def relation(self, received: Received) -> None:
        """That is told by `sample`."""

    def connected(self, remote: bytes) -> None:
        """A writer of replies matches."""
        self._requester.met()

    def disconnected(self, remote: bytes) -> None:
        """A writer of replies matches no more."""
        super().disconnected(remote)
        self._requester.met()


class _RequestReader(DdsReader):
    """Reads the requests to one server."""

    __slots__ = ("_replier",)

    def __init__(self, participant: DdsParticipant, replier: DdsReplier, qos: Qos, gid: bytes) -> None:
        service = replier.service
        topic = Topic(service.request_topic, service.request_type)
        super().__init__(participant, topic, qos, gid, replier.announce, service.name)
        self._replier = replier

    @property
    def carries_requests(self) -> bool:
        """Whether it is a server's."""
        return True

    def sample(self, received: Received, payload: bytes) -> Sample | None:
        """A request; its number is the one that the client's reply has to carry."""
        sample = super().sample(received, payload)
        if sample is not None:
            sample.sequence, body = self._replier.asked(received, payload)
            sample.data = sample.data[body - 4 :]
        return sample

    def relation(self, received: Received) -> None:
        """Where a reply is to go is nothing for users."""

    def disconnected(self, remote: bytes) -> None:
        """A writer of requests matches no more."""
        super().disconnected(remote)
        self._replier.left(remote)


class _ReplyWriter(DdsWriter):
    """Writes the replies of one server."""

    __slots__ = ("_replier",)

    def __init__(self, participant: DdsParticipant, replier: DdsReplier, qos: Qos, gid: bytes) -> None:
        service = replier.service
        topic = Topic(service.reply_topic, service.reply_type)
        super().__init__(participant, topic, qos, gid, service.name)
        self._replier = replier

    def run(self) -> None:
        """There is room again."""
        if not self.closed:
            self._replier.retry()

    def connected(self, remote: bytes) -> None:
        """A reader of replies matches."""
        self._replier.reader_came(remote)

    def disconnected(self, remote: bytes) -> None:
        """A reader of replies matches no more."""
        self._replier.reader_left(remote)
