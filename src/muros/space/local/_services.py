"""Services of the local space, made of ordinary writers and readers of the request and reply topics.

A request's identity is its writer's gid and its sequence number. A reply names it (`related`); reply writers
keep the readers of replies by the client's gid and give each reply to the one it names.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from muros.space import _reports
from muros.space._endpoint import Closing
from muros.space._qos import Qos
from muros.space._timers import Timer
from muros.space._values import CDR_LE, Reply, Request, Sample, Service, Topic, split_identity
from muros.space.local._reader import LocalReader
from muros.space.local._writer import LocalWriter

if TYPE_CHECKING:
    from muros.space.local._participant import LocalParticipant

__all__ = ["LocalReplier", "LocalRequester"]


class LocalRequester(Closing):
    """The client's side of a service. See `muros.space.Requester`."""

    __slots__ = ("_on_data", "_on_reply", "_timer", "_waiting", "qos", "reader", "service", "writer")

    def __init__(
        self,
        participant: LocalParticipant,
        service: Service,
        qos: Qos,
        writer_gid: bytes,
        reader_gid: bytes,
        on_reply: Callable[[int, bytes], object] | None,
        on_data: Callable[[LocalRequester], object] | None,
    ) -> None:
        self.service = service
        self.qos = qos
        self._on_reply = on_reply
        self._on_data = on_data
        self._waiting: deque[tuple[int, Sample]] | None = None
        self._timer: Timer | None = None
        self.reader = _ReplyReader(
            participant,
            Topic(service.reply_topic, service.reply_type),
            qos,
            reader_gid,
            None if on_reply is None and on_data is None else self._came,
            service.name,
            writer_gid,
        )
        self.writer = _RequestWriter(
            participant, Topic(service.request_topic, service.request_type), qos, writer_gid, self
        )
        self.writer.on_room = self.flush

    @property
    def gid(self) -> bytes:
        """Gid of the writer of its requests."""
        return self.writer.gid

    @property
    def closed(self) -> bool:
        """Whether it has been closed."""
        return self.writer.closed

    @property
    def servers(self) -> int:
        """Servers present."""
        return sum(1 for reader in self.writer.readers if reader.service)

    @property
    def waiting(self) -> int:
        """Requests that wait for a server or for room."""
        return len(self._waiting or ())

    def send(
        self,
        data: bytes,
        *,
        source_time: int | None = None,
        representation: int = CDR_LE,
        wait: bool = True,
    ) -> int:
        """Send a request; returns its number, 0 for one that should not wait and cannot go."""
        writer = self.writer
        must_wait = not writer.closed and (self._waiting or not self.servers or not writer.admits())
        if must_wait and not wait:
            self._refuse()
            return 0
        sample = writer.sample(data, source_time, None, representation)
        if must_wait:
            self._wait(sample)
        else:
            self.writer.deliver(sample)
        return sample.sequence

    def take(self) -> Reply | None:
        """The oldest reply, None if there is none."""
        while (sample := self.reader.take()) is not None:
            if sample.related is not None:
                return Reply(split_identity(sample.related)[1], sample.data, sample)
        return None

    def flush(self) -> None:
        """Hand over the requests that wait, as long as servers take them."""
        writer, waiting = self.writer, self._waiting
        while waiting and self.servers and writer.admits():
            writer.deliver(waiting.popleft()[1])
        self._schedule()

    def close(self) -> None:
        """Take it out of the space."""
        if not self.closed:
            self.writer.participant.remove(self)
            self.writer.core.settle()

    def detach(self) -> None:
        """It has been taken out of the space."""
        self._waiting = None
        self._schedule()
        self.writer.detach()
        self.reader.detach()

    def _came(self, reader: LocalReader) -> None:
        if self._on_data is not None:
            self._on_data(self)
            return
        while self._on_reply is not None and (reply := self.take()) is not None:
            self.writer.core.call(self.writer.owner, self._on_reply, reply.sequence, reply.data)

    def _refuse(self) -> None:
        writer = self.writer
        tell = _reports.server_too_slow if self.servers else _reports.no_server
        code = "server-too-slow" if self.servers else "no-server"
        writer.core.count(
            code, writer.owner, self.service.name, partial(tell, writer.core, writer.owner, self.service.name)
        )
        writer.core.drain()

    def _wait(self, sample: Sample) -> None:
        writer = self.writer
        core = writer.core
        if self._waiting is None:
            self._waiting = deque()
        if len(self._waiting) >= writer.limit:
            self._waiting.popleft()
            core.count("request-overwritten", writer.owner, self.service.name, self._tell_overwritten)
            core.drain()
        self._waiting.append((core.timers.now() + core.limits.request_wait, sample))
        if self._timer is None:
            self._schedule()

    def _schedule(self) -> None:
        """Have the timer run when the oldest request has waited long enough."""
        timers = self.writer.core.timers
        if self._timer is not None:
            timers.cancel(self._timer)
            self._timer = None
        if self._waiting:
            self._timer = timers.at(self._waiting[0][0], self._give_up)

    def _give_up(self) -> None:
        writer, waiting, n = self.writer, self._waiting, 0
        self._timer = None
        now = writer.core.timers.now()
        while waiting and waiting[0][0] <= now:
            waiting.popleft()
            n += 1
        self._schedule()
        if n:
            told = _reports.server_too_slow if self.servers else _reports.no_server
            told(writer.core, writer.owner, self.service.name, n, writer.core.limits.request_wait)

    def _tell_overwritten(self, n: int) -> None:
        writer = self.writer
        _reports.request_overwritten(writer.core, writer.owner, self.service.name, writer.limit, n)


class LocalReplier(Closing):
    """The server's side of a service. See `muros.space.Replier`."""

    __slots__ = ("_on_data", "_on_request", "qos", "reader", "service", "writer")

    def __init__(
        self,
        participant: LocalParticipant,
        service: Service,
        qos: Qos,
        writer_gid: bytes,
        reader_gid: bytes,
        on_request: Callable[[bytes, bytes], object] | None,
        on_data: Callable[[LocalReplier], object] | None,
    ) -> None:
        self.service = service
        self.qos = qos
        self._on_request = on_request
        self._on_data = on_data
        self.writer = LocalWriter(
            participant, Topic(service.reply_topic, service.reply_type), qos, writer_gid, service.name
        )
        self.reader = LocalReader(
            participant,
            Topic(service.request_topic, service.request_type),
            qos,
            reader_gid,
            None if on_request is None and on_data is None else self._came,
            service.name,
        )

    @property
    def gid(self) -> bytes:
        """Gid of the writer of its replies."""
        return self.writer.gid

    @property
    def closed(self) -> bool:
        """Whether it has been closed."""
        return self.writer.closed

    @property
    def clients(self) -> int:
        """Clients present."""
        return len(self.writer.clients or ())

    @property
    def pending(self) -> int:
        """Requests that can be taken now."""
        return self.reader.pending

    def take(self) -> Request | None:
        """The oldest request, None if there is none."""
        sample = self.reader.take()
        return None if sample is None else Request(sample.identity, sample.data, sample)

    def reply(
        self, identity: bytes, data: bytes, *, source_time: int | None = None, representation: int = CDR_LE
    ) -> bool:
        """Answer the request with this identity; False if its client is not there."""
        writer = self.writer
        sample = writer.sample(data, source_time, identity, representation)
        if writer.deliver(sample):
            return True
        writer.core.count("reply-unmatched", writer.owner, self.service.name, self._tell_unmatched)
        writer.core.drain()
        return False

    def close(self) -> None:
        """Take it out of the space."""
        if not self.closed:
            self.writer.participant.remove(self)
            self.writer.core.settle()

    def detach(self) -> None:
        """It has been taken out of the space."""
        self.writer.detach()
        self.reader.detach()

    def _came(self, reader: LocalReader) -> None:
        if self._on_data is not None:
            self._on_data(self)
            return
        while self._on_request is not None and (request := self.take()) is not None:
            self.writer.core.call(self.writer.owner, self._on_request, request.identity, request.data)

    def _tell_unmatched(self, n: int) -> None:
        _reports.reply_unmatched(self.writer.core, self.writer.owner, self.service.name, n)


class _ReplyReader(LocalReader):
    """Reads the replies to one client."""

    __slots__ = ("_client_gid",)

    def __init__(
        self,
        participant: LocalParticipant,
        topic: Topic,
        qos: Qos,
        gid: bytes,
        on_data: Callable[[LocalReader], object] | None,
        service: str,
        client_gid: bytes,
    ) -> None:
        super().__init__(participant, topic, qos, gid, on_data, service)
        self._client_gid = client_gid

    @property
    def client_gid(self) -> bytes:
        """The gid its requests are written with."""
        return self._client_gid


class _RequestWriter(LocalWriter):
    """Writes the requests of one client; hands over what waits when a server comes."""

    __slots__ = ("_requester",)

    def __init__(
        self, participant: LocalParticipant, topic: Topic, qos: Qos, gid: bytes, requester: LocalRequester
    ) -> None:
        super().__init__(participant, topic, qos, gid, requester.service.name)
        self._requester = requester

    @property
    def carries_requests(self) -> bool:
        """Whether it is a client's."""
        return True

    def connect(self, reader: LocalReader) -> None:
        """A reader of requests has come."""
        super().connect(reader)
        if not reader.service:
            return
        requester = self._requester
        if requester.servers == 2:
            self.core.notices.append(self._report_several)
        if requester.waiting:
            self.core.post(self)

    def _report_several(self) -> None:
        _reports.several_servers(self.core, self.owner, self.service, self._requester.servers)
