"""The middleware of rclc on a space: what a session with an agent is for a board.

Everything runs in the thread of whoever uses the context. What comes is announced by the space while it is served,
and is handed on by `spin_once`: so callbacks never run inside the space, and what they raise reaches the executor.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Set
from typing import TYPE_CHECKING, Final

from muros.client import reasons
from muros.client.link import CONNECTED, WAITING
from muros.client.qos import profile
from muros.findings import Finding, Severity
from muros.rclc.errors import RclError
from muros.space._qos import Durability, History, Qos, Reliability
from muros.space.rclc._entities import (
    LONGEST_NAME,
    Node,
    Publisher,
    Reader,
    Receiver,
    Replier,
    Requester,
)
from muros.space.rclc._events import SpaceEvents
from muros.space.rclc._graph import SpaceGraph
from muros.space.rclc._problems import NOT_SCHEDULED, NOT_SPUN, code_of, line_of

if TYPE_CHECKING:
    from muros.client._types import OnData
    from muros.client.qos import AnyQos
    from muros.client.services import OnReply, OnRequest
    from muros.space.rclc._ground import Ground

__all__ = ["SpaceMiddleware"]

NOT_SPUN_AFTER: Final = 3.0
"""Seconds in which somebody should have."""

_NEVER = 1_000_000
_MS = 1_000_000


class SpaceMiddleware:
    """Carries the nodes of one context straight on a space; see `muros.rclc._types.Middleware`.

    The first `spin_once` or `wait` makes its state CONNECTED, `close` WAITING again. What the space reports about the
    context's nodes is given to `on_problem(code, text)`, or printed on standard error if it is a warning at least;
    what callbacks of states and problems raise comes out of `spin_once`.
    """

    longest_name = LONGEST_NAME
    """Longest name of a topic in DDS, in characters; sessions with an agent have less."""

    def __init__(self, ground: Ground, domain: int) -> None:
        self.ground = ground
        self.domain = domain
        self.state = WAITING
        self.on_state: Callable[[int], object] | None = None
        self.on_problem: Callable[[int, str], object] | None = None
        self.enclave = "/"
        """The security enclave of its nodes, for others to see."""
        self.nodes: list[Node] = []
        self.ready: deque[Receiver] = deque()
        """What has something to hand on."""
        self.findings: deque[Finding] = deque()
        """What is to be told."""
        self.bells: list[Callable[[], None]] = []
        """What is called when something has come, by any thread."""
        self.closed = False
        self._woken = False
        self._fresh = False
        self._made = time.monotonic()
        self._told = False
        self._server = ground.server
        ground.enter(self)

    @property
    def owners(self) -> Set[str]:
        """Whom findings about our nodes name."""
        return {node.participant.owner for node in self.nodes}

    @property
    def served(self) -> bool:
        """Whether the space can be waited for; else the running asyncio loop serves it, and `bells` ring there."""
        return self.ground.served

    @property
    def came(self) -> bool:
        """Whether there is something for `spin_once` to do."""
        return bool(self.ready or self.findings or self.closed or self._woken)

    # What is made

    def participant(self, name: str, domain: int = 0, /) -> Node:
        """A node. RclError if the context is closed, or its domain cannot be had here."""
        namespace, _, base = name.rpartition("/")
        with self.ground.lock:
            self.be_open()
            made = Node(self, base, namespace or "/", domain)
            self.nodes.append(made)
        return made

    def writer(self, participant: Node, topic: str, type_name: str, qos: AnyQos = "default", /) -> Publisher:
        """A writer."""
        with self.ground.lock:
            return Publisher(participant, topic, type_name, qos_of(qos))

    def reader(
        self,
        participant: Node,
        topic: str,
        type_name: str,
        qos: AnyQos = "default",
        on_data: OnData | None = None,
        /,
    ) -> Reader:
        """A reader."""
        with self.ground.lock:
            return Reader(participant, topic, type_name, qos_of(qos), on_data)

    def requester(
        self,
        participant: Node,
        name: str,
        type_name: str,
        on_reply: OnReply,
        qos: AnyQos = "services",
        /,
    ) -> Requester:
        """A client of a service."""
        with self.ground.lock:
            return Requester(participant, name, type_name, qos_of(qos), on_reply)

    def replier(
        self,
        participant: Node,
        name: str,
        type_name: str,
        on_request: OnRequest,
        qos: AnyQos = "services",
        /,
    ) -> Replier:
        """A server of a service."""
        with self.ground.lock:
            return Replier(participant, name, type_name, qos_of(qos), on_request)

    # What is done

    def spin_once(self, now: int | None = None, /) -> int:
        """Does what is due and hands on what has come; returns the number of samples, requests and replies.

        What a callback raises comes out here once everything else is done; what it was told counts as told.
        """
        if self.closed:
            return 0
        failure: Exception | None = None
        if self.state != CONNECTED:
            failure = self._enter(CONNECTED)
        if not self._fresh and self.ground.served:
            self._server.poll(self)
        self._fresh = self._woken = False
        taken = 0
        for _ in range(len(self.ready)):
            try:
                receiver = self.ready.popleft()
            except IndexError:
                break  # a callback, or another thread, has closed the context
            taken_here, error = receiver.hand_on()
            taken += taken_here
            failure = failure or error
        failure = self._tell() or failure
        if failure is not None:
            raise failure
        return taken

    def wait(self, timeout: int, /) -> None:
        """Waits until something may have come, at most `timeout` ms; once closed, for nothing and as long.

        RclError where the space is served by the asyncio loop that runs this very program.
        """
        if not self.ground.served:
            raise RclError(
                "waiting would stop the asyncio loop that serves this space, and other threads may not use it: have "
                "a task `await executor.spin_async()` (or spin_some_async), or give the context a space of its own"
            )
        if self.closed:
            time.sleep(timeout / 1000)
            return
        self._server.wait(self, timeout / 1000)
        self._fresh = True

    def deadline(self, now: int, /) -> int:
        """Milliseconds until `spin_once` is wanted."""
        return 0 if self.came and not self.closed else _NEVER

    def ping(self, timeout: int, clock: Callable[[], int], /) -> bool:
        """Whether we are in the graph: there is nobody else to ask."""
        return not self.closed

    def not_scheduled(self, who: str, why: str) -> None:
        """A finding: the system does not schedule some threads of this program as they should be."""
        with self.ground.lock:
            self.ground.space.findings.report(
                NOT_SCHEDULED,
                who=who,
                what="threads run, but not all are scheduled as they should be",
                why=why,
                remedy="Give the program the capability or limit that is named, or threads a policy that needs none",
                now=time.time(),
            )

    def wake(self) -> None:
        """Ends a wait; from any thread."""
        with self._server.lock:
            self.stir()

    def close(self) -> None:
        """Leaves the space, with every node; problems not told yet are told. Closing twice is allowed."""
        with self.ground.lock:
            if self.closed:
                return
            self.closed = True
            for node in list(self.nodes):
                node.destroy()
            self.ready.clear()
            self.ground.leave(self)
            self._server.wake(self)
        failure = self._enter(WAITING)
        failure = self._tell() or failure
        if failure is not None:
            raise failure

    def graph_source(self, participant: Node, on_change: Callable[[], object], /) -> SpaceGraph:
        """The graph as a node sees it; `on_change()` is called at changes, by whichever thread serves the space."""
        return SpaceGraph(self, participant.participant.domain, on_change)

    def event_source(self, owner: object, entity: Publisher | Reader, /) -> SpaceEvents:
        """Who counts what happens to a writer or reader, made for `owner`."""
        return SpaceEvents(self, owner, entity)

    # For entities

    def stir(self) -> None:
        """Something has happened: ends a wait. To be called with the lock held."""
        self._woken = True
        self._server.wake(self)

    def announce(self, receiver: Receiver) -> None:
        """Something has come for `receiver`, told by the space."""
        self.ready.append(receiver)
        self._server.wake(self)

    def problem(self, code: int, text: str) -> None:
        """Tell of something that the space does not report, at once."""
        if self.on_problem is not None:
            self.on_problem(code, text)
        else:
            reasons.say(text)

    def be_open(self) -> None:
        """RclError if it is closed."""
        if self.closed:
            raise RclError("the context is closed; make a new one")

    def be_spun(self, name: str) -> None:
        """Something was written although nobody has ever spun us: if nobody serves the space either, says so once."""
        if self._told or not self.ground.served:
            return
        if time.monotonic() - max(self._made, self._server.served) > NOT_SPUN_AFTER:
            self._told = True
            self.problem(
                NOT_SPUN,
                f"{name} is published, but nobody spins this context, so it finds nobody who listens. "
                "Have an Executor(context) spin, or call its spin_some() now and then.",
            )

    def _enter(self, state: int) -> Exception | None:
        """Be in a state and tell; what the callback raised."""
        if state == self.state:
            return None
        self.state = state
        if self.on_state is not None:
            try:
                self.on_state(state)
            except Exception as error:
                return error
        return None

    def _tell(self) -> Exception | None:
        """Tell what the space has reported; what a callback raised."""
        failure: Exception | None = None
        while self.findings:
            finding = self.findings.popleft()
            if self.on_problem is None and finding.severity is Severity.INFO:
                continue
            try:
                self.problem(code_of(finding), line_of(finding))
            except Exception as error:
                failure = error
        return failure


def qos_of(qos: AnyQos) -> Qos:
    """A profile or QoS of rclc as a space knows it. ValueError for an unknown profile."""
    asked = profile(qos)
    return Qos(
        Reliability.RELIABLE if asked.flags & 0x01 else Reliability.BEST_EFFORT,
        _durability(asked.flags),
        History.KEEP_LAST if asked.flags & 0x02 else History.KEEP_ALL,
        asked.depth,
        deadline=asked.deadline * _MS,
        lifespan=asked.lifespan * _MS,
    )


def _durability(flags: int) -> Durability:
    """The durability in the flags of the XRCE representation, as `Qos` of the client puts it there."""
    for durability in reversed(Durability):
        bits = (4 << durability) & ~4
        if bits and flags & bits:
            return durability
    return Durability.VOLATILE
