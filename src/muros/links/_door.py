"""The door of the room: what every link promises, and what it tells its owner.

A link moves whole messages between this host and peers. An *address* names a peer of one link: hashable, cheap to
make, meaningful to that link only (``link.describe(address)`` says it for people). The owner, an agent or a server,
hands in a `LinkEvents` when it opens the link; all calls, in both directions, happen on the thread of the asyncio
loop that ran at that moment. No link blocks the loop and none waits for a slow peer: what cannot be sent soon is
dropped, counted in `LinkCounters.dropped` and told through `LinkEvents.on_problem`.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple, Protocol, TypeAlias

Address: TypeAlias = Hashable
"""A peer of one link. (link, address) is unique among all links."""


class LinkError(Exception):
    """A link cannot be opened as asked: one readable line that says where, why and what to do.

    A local error: nothing a peer sends can cause it.
    """

    def __init__(self, where: str, why: str, remedy: str) -> None:
        super().__init__(f"{where}: {why}. {remedy}")
        self.where = where
        self.why = why
        self.remedy = remedy


class LinkEvents(Protocol):
    """What a link tells its owner, always from the loop's thread. A handler may call the link, also `close` it.

    What a handler raises goes to the loop's exception handler; the link goes on.
    """

    def on_message(self, link: Link, data: bytes, address: Address) -> None:
        """A whole message came. ``data`` is the receiver's to keep."""

    def on_up(self, link: Link, detail: str) -> None:
        """The link, or the port of it that ``detail`` names, has become usable."""

    def on_down(self, link: Link, reason: str) -> None:
        """The link or a port of it has gone, as ``reason`` says; the link tries by itself to get it back."""

    def on_gone(self, link: Link, address: Address, reason: str) -> None:
        """This peer cannot be reached any more: its connection closed, or the port it sat on went away."""

    def on_problem(self, link: Link, code: str, what: str, why: str, remedy: str, n: int) -> None:
        """Something was dropped, refused or does not work, ``n`` times. ``code`` is a stable slug for counting."""


class Cause(NamedTuple):
    """Why messages are dropped: a slug for counters, the reason in words, and what to do about it."""

    code: str
    why: str
    remedy: str


CLOSED = Cause("link-closed", "the link is not open", "Open the link first.")
NO_PEER = Cause("no-such-peer", "no such peer is connected", "Nothing: the peer comes back by itself.")
PORT_GONE = Cause("port-gone", "its port is not there", "Plug the device in again.")
QUEUE_FULL = Cause(
    "queue-full",
    "the peer or its line takes data more slowly than it is sent",
    "Send less or less often, use a faster line, or enlarge queue_bytes of the link.",
)
NETWORK = Cause("network-refused", "the network refused it", "Check the route and the firewall to the peer.")
TOO_LONG = Cause(
    "message-too-long", "it is longer than the link's mtu", "Use a reliable stream, which fragments."
)
EMPTY = Cause("empty-message", "a message of 0 B says nothing", "Check what else sends to this link.")


@dataclass(slots=True)
class LinkCounters:
    """What has passed through a link since it was made. Bytes are those of messages, without framing."""

    received: int = 0
    received_bytes: int = 0
    sent: int = 0
    """Messages handed to the system or to the link's own queue."""
    sent_bytes: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    """Messages lost at this host, by the code of their `Cause`."""
    framing: Counter[str] = field(default_factory=Counter)
    """Damage seen in byte streams: bad frames by kind, and bytes outside frames as ``garbage``."""


class Link(ABC):
    """A transport that moves whole messages. Made closed; `open` and `close` may alternate.

    ``mtu`` is the longest message in bytes. ``discovery_only`` marks a link on which only GET_INFO is answered.
    """

    kind: ClassVar[str] = "link"
    mtu: int = 65535
    discovery_only: bool = False

    def __init__(self) -> None:
        self.counters = LinkCounters()
        self.on_peer: Callable[[Address], object] | None = None
        """Called when somebody can be reached who has said nothing yet: a port was opened, a connection came."""
        self.on_room: Callable[[Address], object] | None = None
        """Called when what waited for a peer in the link's own queue has left, see `backlog`."""
        self._events: LinkEvents | None = None

    @property
    @abstractmethod
    def name(self) -> str:
        """The link in words: ``udp4 0.0.0.0:8888``, ``serial /dev/ttyUSB0 at 921600``."""

    @property
    def is_open(self) -> bool:
        """Between `open` and `close`; a port of the link may be away all the same."""
        return self._events is not None

    def open(self, events: LinkEvents) -> None:
        """Starts moving messages; an asyncio loop must be running. Raises `LinkError`, and is closed then."""
        if self._events is not None:
            raise LinkError(self.name, "is open already", "Close it first.")
        self._events = events
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Stops at once and frees what `open` took; no event comes after this. Closing twice is harmless."""
        self._events = None
        self._close()

    def send(self, message: bytes, address: Address) -> bool:
        """Sends one whole message. False: dropped, counted and told; never raises for what a network or peer does."""
        size = len(message)
        if self._events is None:
            return self._drop(CLOSED, size, address)
        if size > self.mtu:
            why = f"this link carries at most {self.mtu} B in a message"
            return self._drop(TOO_LONG._replace(why=why), size, address)
        cause = self._send(message, address)
        if cause is not None:
            return self._drop(cause, size, address)
        counters = self.counters
        counters.sent += 1
        counters.sent_bytes += size
        return True

    def backlog(self, address: Address) -> int:
        """Bytes that wait in the link's own queue for this peer; 0 where nothing waits, or nobody is."""
        return 0

    def describe(self, address: Address) -> str:
        """The address for people: ``192.168.1.23:50210``, ``/dev/ttyUSB0#1``."""
        return str(address)

    def locators(self) -> list[Locator]:
        """Where peers in the network reach this link, for discovery answers; empty for links without a network."""
        return []

    @abstractmethod
    def _open(self) -> None: ...

    @abstractmethod
    def _close(self) -> None: ...

    def _send(self, message: bytes, address: Address) -> Cause | None:
        """Sends a message that fits, on an open link; why it is dropped, or None. Not for links with a `send`."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}{'' if self.is_open else ', closed'}>"

    def _deliver(self, message: bytes, address: Address) -> None:
        events = self._events
        if events is None:
            return
        if not message:
            self._dropped_incoming(EMPTY, address)
            return
        counters = self.counters
        counters.received += 1
        counters.received_bytes += len(message)
        try:
            events.on_message(self, message, address)
        except Exception as error:
            self._owner_failed(error)

    def _peer(self, address: Address) -> None:
        """Somebody can be reached: told only to who asked for it."""
        if self.on_peer is None or self._events is None:
            return
        try:
            self.on_peer(address)
        except Exception as error:
            self._owner_failed(error)

    def _room(self, address: Address) -> None:
        """A peer's queue is empty: told only to who asked for it."""
        if self.on_room is None or self._events is None:
            return
        try:
            self.on_room(address)
        except Exception as error:
            self._owner_failed(error)

    def _up(self, detail: str) -> None:
        self._tell("on_up", detail)

    def _down(self, reason: str) -> None:
        self._tell("on_down", reason)

    def _gone(self, address: Address, reason: str) -> None:
        self._tell("on_gone", address, reason)

    def _problem(self, cause: Cause, what: str, n: int = 1) -> None:
        self._tell("on_problem", cause.code, what, cause.why, cause.remedy, n)

    def _tell(self, event: str, *details: object) -> None:
        if self._events is None:
            return
        try:
            getattr(self._events, event)(self, *details)
        except Exception as error:
            self._owner_failed(error)

    def _owner_failed(self, error: Exception) -> None:
        """A handler has raised: said loudly, yet the link goes on, and with it everybody else's messages."""
        context = {"message": f"{self.name}: a handler of its owner has failed", "exception": error}
        asyncio.get_running_loop().call_exception_handler(context)

    def _drop(self, cause: Cause, size: int, address: Address) -> bool:
        """Counts and tells a message that is not sent; answers False for `send` to return."""
        self.counters.dropped[cause.code] += 1
        self._problem(cause, f"message of {size} B to {self.describe(address)} not sent")
        return False

    def _dropped_incoming(self, cause: Cause, address: Address) -> None:
        self.counters.dropped[cause.code] += 1
        self._problem(cause, f"a message from {self.describe(address)} ignored")


class Locator(NamedTuple):
    """Where a link can be reached: an address of this host and a port."""

    family: int
    """4 or 6."""
    packed: bytes
    """The address, 4 or 16 bytes in network order."""
    port: int
