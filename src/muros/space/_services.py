"""The two sides of a service as all engines have them: requests that wait, replies that are handed over."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Protocol

from muros.space import _reports
from muros.space._cache import CachingReader
from muros.space._endpoint import Closing, EngineEndpoint
from muros.space._qos import Qos
from muros.space._timers import Timer
from muros.space._values import CDR_LE, Reply, Request, Sample, Service

__all__ = ["EngineReplier", "EngineRequester", "Parent"]


class Parent(Protocol):
    """The participant that made a requester or replier."""

    def close_child(self, child: Any) -> None:
        """Take one of its children out of the space, unless it is closed already."""


class _Side(Closing):
    """What the two sides of a service have in common. Subclasses make `writer` and `reader`, which calls `announce`."""

    __slots__ = ("_on_data", "_on_one", "_parent", "qos", "service")

    reader: CachingReader
    writer: EngineEndpoint

    def __init__(
        self,
        parent: Parent,
        service: Service,
        qos: Qos,
        on_one: Callable[[Any, bytes], object] | None,
        on_data: Callable[[Any], object] | None,
    ) -> None:
        self.service = service
        self.qos = qos
        self._parent = parent
        self._on_one = on_one
        """Told of each reply or request: whose it is, and its body."""
        self._on_data = on_data

    @property
    def announce(self) -> Callable[[CachingReader], None] | None:
        """What the reader calls."""
        return None if self._on_one is None and self._on_data is None else self._came

    @property
    def gid(self) -> bytes:
        """Gid of the writer."""
        return self.writer.gid

    @property
    def closed(self) -> bool:
        """Whether it has been closed."""
        return self.writer.closed

    @property
    def endpoints(self) -> tuple[EngineEndpoint, ...]:
        """What it is made of."""
        return (self.reader, self.writer)

    def take(self) -> Reply | Request | None:
        """The oldest that has come, None if there is none."""
        raise NotImplementedError

    def close(self) -> None:
        """Take it out of the space."""
        self._parent.close_child(self)

    def detach(self) -> None:
        """It has been taken out of the space."""
        self.writer.detach()
        self.reader.detach()

    def _came(self, reader: CachingReader) -> None:
        if self._on_data is not None:
            self._on_data(self)
            return
        while self._on_one is not None and (taken := self.take()) is not None:
            self.writer.core.call(self.writer.owner, self._on_one, taken[0], taken.data)


class EngineRequester(_Side):
    """The client's side of a service. See `muros.space.Requester`. An engine says how a request goes."""

    __slots__ = ("_timer", "_waiting")

    def __init__(
        self,
        parent: Parent,
        service: Service,
        qos: Qos,
        on_reply: Callable[[int, bytes], object] | None,
        on_data: Callable[[Any], object] | None,
    ) -> None:
        super().__init__(parent, service, qos, on_reply, on_data)
        self._waiting: deque[tuple[int, Sample]] | None = None
        self._timer: Timer | None = None

    @property
    def servers(self) -> int:
        """Servers present."""
        raise NotImplementedError

    @property
    def waiting(self) -> int:
        """Requests that wait for a server or for room."""
        return len(self._waiting or ())

    def sample(self, data: bytes, source_time: int | None, representation: int) -> Sample:
        """A request with a number of its own, not sent yet. ClosedError if closed."""
        raise NotImplementedError

    def admits(self) -> bool:
        """Whether the servers have room for a request now; if not, `flush` is called when they have."""
        raise NotImplementedError

    def deliver(self, request: Sample) -> bool:
        """Send it to the servers. False: there is no room after all, and `flush` is called when there is."""
        raise NotImplementedError

    def number_of(self, reply: Sample) -> int | None:
        """Number of the request that is answered; None if it is none of ours."""
        raise NotImplementedError

    def send(
        self,
        data: bytes,
        *,
        source_time: int | None = None,
        representation: int = CDR_LE,
        wait: bool = True,
    ) -> int:
        """Send a request; returns its number, 0 for one that should not wait and cannot go."""
        must_wait = not self.closed and (self._waiting or not self.servers or not self.admits())
        if must_wait and not wait:
            self._refuse()
            return 0
        request = self.sample(data, source_time, representation)
        if must_wait or not self.deliver(request):
            self._wait(request)
        return request.sequence

    def take(self) -> Reply | None:
        """The oldest reply, None if there is none."""
        while (sample := self.reader.take()) is not None:
            number = self.number_of(sample)
            if number is not None:
                return Reply(number, sample.data, sample)
        return None

    def flush(self) -> None:
        """Hand over the requests that wait, as long as servers take them."""
        waiting = self._waiting
        while waiting and self.servers and self.admits() and self.deliver(waiting[0][1]):
            waiting.popleft()
        self._schedule()

    def detach(self) -> None:
        """It has been taken out of the space."""
        self._waiting = None
        self._schedule()
        super().detach()

    def _refuse(self) -> None:
        core, who, name = self.writer.core, self.writer.owner, self.service.name
        tell = _reports.server_too_slow if self.servers else _reports.no_server
        code = "server-too-slow" if self.servers else "no-server"
        core.count(code, who, name, partial(tell, core, who, name))
        core.drain()

    def _wait(self, request: Sample) -> None:
        writer = self.writer
        core = writer.core
        if self._waiting is None:
            self._waiting = deque()
        if len(self._waiting) >= writer.limit:
            self._waiting.popleft()
            core.count("request-overwritten", writer.owner, self.service.name, self._tell_overwritten)
            core.drain()
        self._waiting.append((core.timers.now() + core.limits.request_wait, request))
        if self._timer is None:
            self._schedule()

    def _schedule(self) -> None:
        """Have the timer run when the oldest request has waited long enough."""
        until = self._waiting[0][0] if self._waiting else None
        self._timer = self.writer.core.timers.move(self._timer, until, self._give_up)

    def _give_up(self) -> None:
        core, waiting, n = self.writer.core, self._waiting, 0
        self._timer = None
        now = core.timers.now()
        while waiting and waiting[0][0] <= now:
            waiting.popleft()
            n += 1
        self._schedule()
        if n:
            told = _reports.server_too_slow if self.servers else _reports.no_server
            told(core, self.writer.owner, self.service.name, n, core.limits.request_wait)

    def _tell_overwritten(self, n: int) -> None:
        writer = self.writer
        _reports.request_overwritten(writer.core, writer.owner, self.service.name, writer.limit, n)


class EngineReplier(_Side):
    """The server's side of a service. See `muros.space.Replier`. An engine says how a reply goes."""

    __slots__ = ()

    @property
    def clients(self) -> int:
        """Clients present."""
        raise NotImplementedError

    @property
    def pending(self) -> int:
        """Requests that can be taken now."""
        return self.reader.pending

    def deliver(self, identity: bytes, data: bytes, source_time: int | None, representation: int) -> bool:
        """Send a reply to the client that `identity` names. False: it is not there. ClosedError if closed."""
        raise NotImplementedError

    def take(self) -> Request | None:
        """The oldest request, None if there is none."""
        sample = self.reader.take()
        return None if sample is None else Request(sample.identity, sample.data, sample)

    def reply(
        self, identity: bytes, data: bytes, *, source_time: int | None = None, representation: int = CDR_LE
    ) -> bool:
        """Answer the request with this identity; False if its client is not there."""
        if self.deliver(identity, data, source_time, representation):
            return True
        self.unmatched()
        return False

    def unmatched(self) -> None:
        """A reply was for nobody."""
        core, who, name = self.writer.core, self.writer.owner, self.service.name
        core.count("reply-unmatched", who, name, partial(_reports.reply_unmatched, core, who, name))
        core.drain()


def both_sides(one: Iterable[bytes], other: Iterable[bytes]) -> int:
    """How many of these and of those endpoints (gids) the same participants have: so many are servers, or clients."""
    left, right = Counter(gid[:12] for gid in one), Counter(gid[:12] for gid in other)
    return sum(min(n, right[prefix]) for prefix, n in left.items())
