"""The door of the data space: what every engine offers, whatever it is made of.

Everything passes in CDR bytes. All calls come from one thread (that of the caller's event loop), return at
once and never wait. Callbacks run on that thread too: inside the call that caused them or inside
`Space.tick`, never one inside another. A callback that raises becomes a finding and harms nobody.

Time is the space's clock in nanoseconds. A space that is attached to an asyncio loop serves itself; without one,
whoever owns it calls `tick` when it asks for it.
"""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, Self, runtime_checkable

from muros.findings import Findings
from muros.space._graph import Graph
from muros.space._qos import Qos
from muros.space._values import CDR_LE, Reply, Request, Sample, Service, Topic

if TYPE_CHECKING:
    import asyncio

__all__ = [
    "ClosedError",
    "Entity",
    "Participant",
    "Reader",
    "Replier",
    "Requester",
    "Space",
    "SpaceError",
    "UnknownEngineError",
    "Writer",
]


class SpaceError(Exception):
    """Something was asked of a space that it cannot do; the text says what and what to do instead.

    SpaceError
    +- UnknownEngineError   a URL names an engine that is not there
    +- ClosedError          a closed space, participant, writer, requester or replier was used
    """


class UnknownEngineError(SpaceError, ValueError):
    """A URL names an engine that is not there."""


class ClosedError(SpaceError):
    """A closed space, participant, writer, requester or replier was used."""


@runtime_checkable
class Entity(Protocol):
    """What all things of a space have in common."""

    @property
    def closed(self) -> bool:
        """Whether it has been closed."""

    def close(self) -> None:
        """Take it out of the space, with everything made by it. Closing twice is allowed."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Writer(Entity, Protocol):
    """Writes samples of one topic."""

    @property
    def topic(self) -> Topic:
        """What it carries."""

    @property
    def qos(self) -> Qos:
        """What it offers or wants, as settled by the engine."""

    @property
    def gid(self) -> bytes:
        """16 bytes, unique in the space."""

    on_room: Callable[[], object] | None
    """Called when a write that was refused is worth trying again."""
    on_deadline: Callable[[], object] | None
    """Called when a deadline was missed."""

    @property
    def deadline_missed(self) -> int:
        """Periods of the deadline in which nothing was written."""

    @property
    def refused(self) -> int:
        """Calls of `write` that returned False."""

    @property
    def matched(self) -> tuple[bytes, ...]:
        """Gids of the readers it writes to."""

    @property
    def acknowledged(self) -> bool:
        """Whether all that was written has reached every matched reader that is reliable."""

    def write(
        self,
        data: bytes,
        *,
        source_time: int | None = None,
        related: bytes | None = None,
        representation: int = CDR_LE,
    ) -> bool:
        """Give `data` (kept, not copied) to all matched readers, each at most once and in order.

        False: a reliable reader that keeps all is full, nobody got the sample; write it again after
        `on_room`. A writer is refused for at most `max_blocking_time`; after that the reader that is still full
        loses the sample, which is counted and becomes a finding. `source_time` in ns, None = now; a lifespan counts
        from the call, for the clocks of boards may be wrong.
        `related`: identity of the request that is answered. ClosedError if closed.
        """


class Reader(Entity, Protocol):
    """Keeps the samples of one topic until they are taken."""

    @property
    def topic(self) -> Topic:
        """What it carries."""

    @property
    def qos(self) -> Qos:
        """What it offers or wants, as settled by the engine."""

    @property
    def gid(self) -> bytes:
        """16 bytes, unique in the space."""

    on_deadline: Callable[[], object] | None
    """Called when a deadline was missed."""

    @property
    def deadline_missed(self) -> int:
        """Periods of the deadline in which nothing came."""

    @property
    def lost(self) -> int:
        """Samples overwritten or dropped because they were not taken in time."""

    @property
    def expired(self) -> int:
        """Samples dropped because they were older than their lifespan."""

    @property
    def matched(self) -> tuple[bytes, ...]:
        """Gids of the writers it reads from."""

    @property
    def pending(self) -> int:
        """Samples that can be taken now."""

    def take(self) -> Sample | None:
        """The oldest sample, None if there is none (or the reader is closed)."""


class Requester(Entity, Protocol):
    """The client's side of a service."""

    @property
    def service(self) -> Service:
        """The service."""

    @property
    def qos(self) -> Qos:
        """What it offers or wants, as settled by the engine."""

    @property
    def gid(self) -> bytes:
        """Gid of the writer of its requests."""

    @property
    def servers(self) -> int:
        """Servers present."""

    @property
    def waiting(self) -> int:
        """Requests that wait for a server, or for room at one."""

    def send(
        self,
        data: bytes,
        *,
        source_time: int | None = None,
        representation: int = CDR_LE,
        wait: bool = True,
    ) -> int:
        """Send a request; returns its number, which its reply will carry.

        While no server is there, the last requests (as many as the QoS keeps) wait for `request_wait` and then
        become a finding. With `wait` false a request that cannot go at once is not sent: the number is 0, and
        that is a finding. ClosedError if closed.
        """

    def take(self) -> Reply | None:
        """The oldest reply, None if there is none."""


class Replier(Entity, Protocol):
    """The server's side of a service."""

    @property
    def service(self) -> Service:
        """The service."""

    @property
    def qos(self) -> Qos:
        """What it offers or wants, as settled by the engine."""

    @property
    def gid(self) -> bytes:
        """Gid of the writer of its replies."""

    @property
    def clients(self) -> int:
        """Clients present."""

    @property
    def pending(self) -> int:
        """Requests that can be taken now."""

    def take(self) -> Request | None:
        """The oldest request, None if there is none."""

    def reply(
        self,
        identity: bytes,
        data: bytes,
        *,
        source_time: int | None = None,
        representation: int = CDR_LE,
    ) -> bool:
        """Answer the request with this identity. Only its client gets the reply.

        False: that client is not (any longer) there, which is counted and becomes a finding. ClosedError if
        closed.
        """


class Participant(Entity, Protocol):
    """Somebody in a space: one node, with everything it writes, reads, asks and answers.

    `qos` None means the defaults of DDS: keep last 1, volatile; writers reliable, readers best effort; for
    services, reliable and keep last 10. `key` gives an entity a number of its own (0 to 0x7FFFFF, different
    among the participant's writers, readers, ...), which makes its gid the same in every life of a participant
    with a `key`. ValueError if the key is in use, ClosedError if the participant is closed.

    `on_data(reader)` is called when the first sample comes into an empty reader; it should take what it can.
    It is called again only after the reader was empty. What is there already when an entity is made (history,
    waiting requests) is announced after the call that made it has returned.
    """

    @property
    def gid(self) -> bytes:
        """16 bytes, unique in the space."""

    @property
    def name(self) -> str:
        """Name of the node, or empty."""

    @property
    def namespace(self) -> str:
        """Namespace of the node."""

    @property
    def domain(self) -> int:
        """Number of its domain."""

    @property
    def enclave(self) -> str:
        """Security enclave, carried for other nodes to see."""

    @property
    def owner(self) -> str:
        """Whom findings name."""

    def writer(self, topic: Topic, qos: Qos | None = None, *, key: int | None = None) -> Writer:
        """A new writer."""

    def reader(
        self,
        topic: Topic,
        qos: Qos | None = None,
        on_data: Callable[[Reader], object] | None = None,
        *,
        key: int | None = None,
    ) -> Reader:
        """A new reader."""

    def requester(
        self,
        service: Service,
        qos: Qos | None = None,
        on_reply: Callable[[int, bytes], object] | None = None,
        *,
        on_data: Callable[[Requester], object] | None = None,
        key: int | None = None,
    ) -> Requester:
        """A new client. Replies are handed to `on_reply(number, data)`, or announced by `on_data` to be taken."""

    def replier(
        self,
        service: Service,
        qos: Qos | None = None,
        on_request: Callable[[bytes, bytes], object] | None = None,
        *,
        on_data: Callable[[Replier], object] | None = None,
        key: int | None = None,
    ) -> Replier:
        """A new server. Requests are handed to `on_request(identity, data)`, or announced by `on_data`."""


class Space(Entity, Protocol):
    """Where everybody meets. Its domains are separate worlds."""

    @property
    def url(self) -> str:
        """What opened it."""

    @property
    def domain(self) -> int:
        """The domain of participants that name none."""

    @property
    def findings(self) -> Findings:
        """Where it reports."""

    @property
    def clock(self) -> Callable[[], int]:
        """Its clock, ns."""

    @property
    def graph(self) -> Graph:
        """Who is there and who meets whom."""

    def participant(
        self,
        name: str,
        *,
        namespace: str = "/",
        domain: int | None = None,
        enclave: str = "/",
        key: bytes | None = None,
        owner: str = "",
    ) -> Participant:
        """A new participant. An empty `name` means that it is no node.

        `key` (1 byte or more; 12 are used as they are) makes its gid the same in every life. `owner` is whom
        findings name, such as "client 0x1A2B0007"; default: the node's full name. ValueError if a living
        participant of the domain has the key, ClosedError if the space is closed.
        """

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """Serve the space on this loop from now on: sockets, timers, callbacks. Nobody needs to call `tick` then.

        To be called from the loop's thread, or before it runs. Attaching again to the same loop does nothing; a
        closed loop may be replaced. SpaceError if the space is attached to another loop, or the engine cannot
        work here (a port or network interface that is not to be had). ClosedError if the space is closed.
        """

    def tick(self) -> int | None:
        """Do what has become due. Returns when to call again (ns of the clock), None = when asked to."""

    def on_wake(self, callback: Callable[[], object] | None) -> None:
        """Call `callback` when `tick` is needed earlier than it said. It should arrange for a call of `tick`
        from the event loop, not call it itself."""
