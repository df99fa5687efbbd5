"""Sending: which socket a datagram leaves through, what waits when that is full, and what is lost.

Nothing here raises: the protocol repairs what is lost, and who has to know why is told by a finding.
"""

import asyncio
import errno
import socket
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias

from muros.rtps._values import UDP4, Locator
from muros.rtps.net._environment import NetworkSettings
from muros.rtps.net._interfaces import Interface
from muros.rtps.net._sockets import multicast_sender

__all__ = ["NetworkCounters", "Notice", "Sender", "Tell"]

ROUTES: Final = 4096
"""Locators whose way out is remembered."""
RETRY_FULL: Final = 0.001
"""Seconds to wait after ENOBUFS: a full device queue does not tell when it has room."""


class Notice(NamedTuple):
    """What a finding tells."""

    code: str
    what: str
    why: str
    remedy: str


Tell: TypeAlias = Callable[[Notice, str, int], object]
"""Takes a notice, its subject, and how often."""


@dataclass(slots=True)
class NetworkCounters:
    """What a network has done since it was opened."""

    received: int = 0
    """Datagrams."""
    received_bytes: int = 0
    sent: int = 0
    """Datagrams; one that goes out through several interfaces counts for each."""
    sent_bytes: int = 0
    overflown: int = 0
    """Datagrams the kernel threw away because a receive buffer was full."""
    lost: Counter[str] = field(default_factory=Counter)
    """Datagrams not sent, by the code of the finding."""


class Sender:
    """All ways out of one network. `transmit` is the core's."""

    def __init__(self, settings: NetworkSettings, counters: NetworkCounters, tell: Tell) -> None:
        self._settings = settings
        self._counters = counters
        self._tell = tell
        self._routes: dict[Locator, tuple[tuple[_Send, _Address], ...]] = {}
        self._unicast: _Outlet | None = None
        self._multicast: dict[Interface, _Outlet] = {}

    def open(self, loop: asyncio.AbstractEventLoop, sock: socket.socket) -> None:
        """Sends through `sock` what is for one receiver. `sock` stays the caller's."""
        self._unicast = self._outlet(loop, sock)
        self._routes.clear()

    def set_interfaces(self, loop: asyncio.AbstractEventLoop, interfaces: Iterable[Interface]) -> None:
        """Sends multicast through these, and no longer through others."""
        wanted = {interface for interface in interfaces if interface.multicast}
        for interface in self._multicast.keys() - wanted:
            self._multicast.pop(interface).close(its_own=True)
        for interface in wanted - self._multicast.keys():
            try:
                sock = multicast_sender(interface, self._settings.hops)
            except OSError:  # gone since; the next look at the interfaces sees it
                continue
            self._multicast[interface] = self._outlet(loop, sock)
        self._routes.clear()

    def transmit(self, datagram: bytes, locator: Locator) -> None:
        """Sends one datagram, or counts why not."""
        route = self._routes.get(locator)
        if route is None:
            route = self._route(locator)
        for send, address in route:
            send(datagram, address)

    def close(self) -> None:
        """What waits gets one more chance, then it is lost."""
        if self._unicast is not None:
            self._unicast.close(its_own=False)
            self._unicast = None
        for outlet in self._multicast.values():
            outlet.close(its_own=True)
        self._multicast.clear()
        self._routes.clear()

    def abandon(self) -> None:
        """Lets go of what a forked child has inherited, without touching what it shares with its parent."""
        for outlet in self._multicast.values():
            outlet.socket.close()
        self._unicast = None
        self._multicast.clear()
        self._routes.clear()

    def _outlet(self, loop: asyncio.AbstractEventLoop, sock: socket.socket) -> "_Outlet":
        return _Outlet(loop, sock, self._settings.send_queue, self._counters, self._tell)

    def _route(self, locator: Locator) -> "tuple[tuple[_Send, _Address], ...]":
        """The way to a locator; no way for kinds and addresses that none leads to."""
        route: tuple[tuple[_Send, _Address], ...] = ()
        first = locator.address[12] if len(locator.address) == 16 else 0
        if locator.kind == UDP4 and 0 < locator.port < 65536 and 0 < first < 240:
            address = (locator.host, locator.port)
            if first >= 224:
                route = tuple((outlet.send, address) for outlet in self._multicast.values())
            elif self._unicast is not None:
                route = ((self._unicast.send, address),)
        if len(self._routes) >= ROUTES:  # locators come from peers
            self._routes.clear()
        self._routes[locator] = route
        return route


_Address: TypeAlias = tuple[str, int]
_Send: TypeAlias = Callable[[bytes, _Address], object]


class _Outlet:
    """One socket that sends; what it does not take at once waits in a bounded queue."""

    __slots__ = ("_counters", "_limit", "_loop", "_queue", "_queued", "_retry", "_sendto", "_tell", "socket")

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        sock: socket.socket,
        limit: int,
        counters: NetworkCounters,
        tell: Tell,
    ) -> None:
        self.socket = sock
        self._loop = loop
        self._limit = limit
        self._counters = counters
        self._tell = tell
        self._sendto = sock.sendto
        self._queue: deque[tuple[bytes, _Address]] = deque()
        self._queued = 0
        self._retry: asyncio.TimerHandle | None = None

    def send(self, datagram: bytes, address: _Address) -> None:
        if self._queue:
            self._enqueue(datagram, address)
            return
        try:
            self._sendto(datagram, address)
        except (BlockingIOError, InterruptedError):
            self._enqueue(datagram, address)
            self._loop.add_writer(self.socket, self._flush)
        except OSError as error:
            if error.errno == errno.ENOBUFS:
                self._enqueue(datagram, address)
                self._retry = self._loop.call_later(RETRY_FULL, self._flush)
            else:
                self._lose(_notice(error, len(datagram)), address)
        else:
            counters = self._counters
            counters.sent += 1
            counters.sent_bytes += len(datagram)

    def close(self, *, its_own: bool) -> None:
        if self._queue and not self._loop.is_closed():
            self._flush()
        if not self._loop.is_closed():
            self._loop.remove_writer(self.socket)
        if self._retry is not None:
            self._retry.cancel()
        if self._queue:
            self._counters.lost[QUEUE_FULL.code] += len(self._queue)
            self._queue.clear()
        if its_own:
            self.socket.close()

    def _enqueue(self, datagram: bytes, address: _Address) -> None:
        if self._queue and self._queued + len(datagram) > self._limit:
            self._lose(QUEUE_FULL, address)
            return
        self._queue.append((datagram, address))
        self._queued += len(datagram)

    def _flush(self) -> None:
        """Sends what waits until the socket is full again."""
        self._retry = None
        while self._queue:
            datagram, address = self._queue[0]
            try:
                self._sendto(datagram, address)
            except (BlockingIOError, InterruptedError):
                self._loop.add_writer(self.socket, self._flush)
                return
            except OSError as error:
                if error.errno == errno.ENOBUFS:
                    self._loop.remove_writer(self.socket)
                    self._retry = self._loop.call_later(RETRY_FULL, self._flush)
                    return
                self._lose(_notice(error, len(datagram)), address)
            else:
                self._counters.sent += 1
                self._counters.sent_bytes += len(datagram)
            self._queue.popleft()
            self._queued -= len(datagram)
        self._loop.remove_writer(self.socket)

    def _lose(self, notice: Notice, address: _Address) -> None:
        self._counters.lost[notice.code] += 1
        self._tell(notice, f"{address[0]}:{address[1]}", 1)


QUEUE_FULL: Final = Notice(
    "dds-send-queue-full",
    "{n} datagram{s} to {subject} lost",
    "they were sent faster than the network takes them",
    "Send less often or smaller samples; reliable samples are sent again.",
)

_UNREACHABLE = (errno.ENETUNREACH, errno.EHOSTUNREACH, errno.ENETDOWN, errno.EADDRNOTAVAIL)


def _notice(error: OSError, size: int) -> Notice:
    what = "{n} datagram{s} to {subject} not sent"
    if error.errno in _UNREACHABLE:
        remedy = "Check the cable, the address and the routes (ip route); nothing if the network comes back."
        return Notice("dds-unreachable", what, f"no network leads there ({error.strerror})", remedy)
    if error.errno in (errno.EPERM, errno.EACCES):
        remedy = "Allow UDP from and to the ports of the domain in the firewall of this host."
        return Notice("dds-send-forbidden", what, f"this host forbids it ({error.strerror})", remedy)
    if error.errno == errno.EMSGSIZE:
        why = f"{size} bytes are more than a datagram through this interface can have"
        return Notice("dds-datagram-too-large", what, why, "Choose a smaller fragment size.")
    if error.errno == errno.EINVAL:
        why = "it was to leave this host, from an address that is only known on this host"
        remedy = "Choose the discovery range SUBNET or name interfaces if other hosts are meant."
        return Notice("dds-bound-to-host", what, why, remedy)
    why = f"the network refused it ({error.strerror or error})"
    return Notice("dds-send-refused", what, why, "Check the network interfaces.")
