"""What writers and readers of all engines have in common, and the watch over their deadlines."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Protocol, Self, TypeVar

from muros.space._core import Core
from muros.space._graph import Endpoint, ParticipantInfo, Role
from muros.space._qos import Qos, duration
from muros.space._timers import Timer
from muros.space._values import Topic

__all__ = ["Closing", "DeadlineWatch", "EngineEndpoint", "Home", "without"]

_T = TypeVar("_T")


class Closing:
    """`close()` at the end of a `with` block."""

    __slots__ = ()

    def close(self) -> None:
        """Take it out of the space."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Home(Protocol):
    """The participant of an endpoint, as far as the endpoint needs it."""

    core: Core
    owner: str

    def info(self) -> ParticipantInfo:
        """Itself as a value."""


class EngineEndpoint(Closing):
    """A writer or reader. Slots only: a fleet has thousands of them, most of them idle."""

    __slots__ = (
        "closed", "core", "deadline", "gid", "on_deadline", "participant", "qos", "service", "topic", "type_hash",
    )  # fmt: skip

    role: Role

    def __init__(self, participant: Home, topic: Topic, qos: Qos, gid: bytes, service: str = "") -> None:
        self.core: Core = participant.core
        self.participant = participant
        self.topic = topic
        self.qos = qos
        self.gid = gid
        self.service = service
        self.type_hash = ""
        self.closed = False
        self.on_deadline: Callable[[], object] | None = None
        self.deadline = DeadlineWatch(self) if qos.deadline else None

    @property
    def owner(self) -> str:
        """Whom findings name."""
        return self.participant.owner

    @property
    def endpoints(self) -> tuple[EngineEndpoint, ...]:
        """Itself, as a service's side has its reader and its writer."""
        return (self,)

    @property
    def deadline_missed(self) -> int:
        """Periods of the deadline that passed without a sample."""
        return 0 if self.deadline is None else self.deadline.missed

    @property
    def limit(self) -> int:
        """Samples it may hold."""
        limit = self.core.limits.resource_limit
        return limit if self.qos.keeps_all else min(self.qos.depth, limit)

    @property
    def carries_requests(self) -> bool:
        """Whether it is the request side of a service."""
        return False

    def detach(self) -> None:
        """It has been taken out of the space: let go of everything held."""
        self.closed = True
        if self.deadline is not None:
            self.deadline.stop()

    def info(self) -> Endpoint:
        """Itself as a value."""
        return Endpoint(
            gid=self.gid,
            role=self.role,
            topic=self.topic.name,
            type_name=self.topic.type_name,
            qos=self.qos,
            service=self.service,
            participant=self.participant.info(),
            type_hash=self.type_hash,
        )

    def __repr__(self) -> str:
        state = ", closed" if self.closed else ""
        return f"<{self.role.value} of {self.topic.name} by {self.owner}{state}>"


class DeadlineWatch:
    """Counts the periods in which an endpoint saw no sample.

    As in DDS the first sample starts it. A reader's watch rests while no writer is matched.
    """

    __slots__ = ("_base", "_endpoint", "_queued", "_timer", "missed")

    def __init__(self, endpoint: EngineEndpoint) -> None:
        self._endpoint = endpoint
        self._base = 0
        self._timer: Timer | None = None
        self._queued = False
        self.missed = 0

    def touch(self) -> None:
        """A sample was written or has come."""
        timers = self._endpoint.core.timers
        self._base = timers.now()
        if self._timer is None:
            self._timer = timers.at(self._base + self._endpoint.qos.deadline, self._check)

    def stop(self) -> None:
        """Watch no longer, until touched."""
        if self._timer is not None:
            self._endpoint.core.timers.cancel(self._timer)
            self._timer = None

    def _check(self) -> None:
        """A period may be over: the timer is not moved with every sample, so look when the last one came."""
        endpoint = self._endpoint
        self._timer = None
        core, period = endpoint.core, endpoint.qos.deadline
        periods = (core.timers.now() - self._base) // period
        self._base += periods * period
        self._timer = core.timers.at(self._base + period, self._check)
        if not periods:
            return
        self.missed += periods
        topic, role = endpoint.topic.name, endpoint.role.value
        core.report(
            f"{role}-deadline-missed",
            who=endpoint.owner,
            subject=topic,
            what=f"{{n}} deadline{{s}} of {topic} missed by the {role} of {endpoint.owner}",
            why=f"no sample came within {duration(period)}",
            remedy=f"Look at what should write {topic}, or allow a longer deadline",
            n=periods,
        )
        if endpoint.on_deadline is not None and not self._queued:
            self._queued = True
            core.post(self)

    def run(self) -> None:
        """Tell the endpoint's user."""
        self._queued = False
        endpoint = self._endpoint
        if endpoint.on_deadline is not None and not endpoint.closed:
            endpoint.core.call(endpoint.owner, endpoint.on_deadline)


def without(items: tuple[_T, ...], item: _T) -> tuple[_T, ...]:
    """`items` less `item`, which is among them."""
    i = items.index(item)
    return items[:i] + items[i + 1 :]
