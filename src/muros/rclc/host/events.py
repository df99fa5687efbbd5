"""What becomes of the quality of service of publishers and subscriptions: callbacks that executors run. For hosts.

    node.on_events(subscription, deadline_missed=lambda event: print(event.total), matched=print)

Straight in a data space the space tells. Through an agent deadlines and lost messages are counted here; whom a
publisher or subscription has met is told by the agent of muros, see ``agent_events``, and by no other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from muros.rclc.executor import _NEVER, Handle
from muros.rclc.host.checks import WrongTypeError, be_callable
from muros.rclc.host.entities import Publisher
from muros.rclc.host.handles import take_away
from muros.rclc.subscription import Subscription

if TYPE_CHECKING:
    from muros.rclc.host.agent_events import News, NewsReader
    from muros.rclc.host.context import Node
    from muros.xrce._types import Buffer

__all__ = ["Event", "EventSource", "Events", "SessionEvents", "make"]

DEADLINE_MISSED, INCOMPATIBLE_QOS, LIVELINESS_LOST, MATCHED, MESSAGE_LOST = NAMES = (
    "deadline_missed",
    "incompatible_qos",
    "liveliness_lost",
    "matched",
    "message_lost",
)
COUNTS = {INCOMPATIBLE_QOS: "misfits", LIVELINESS_LOST: "silences", MATCHED: "matched"}
"""What only a space knows, which an agent may tell, and what the number of it is called there."""


@dataclass(frozen=True, slots=True)
class Event:
    """What a callback is given."""

    name: str
    """deadline_missed, incompatible_qos, liveliness_lost, matched or message_lost."""
    total: int
    """How many there were: periods without a message, others that do not fit, silences, matches, messages lost."""
    change: int
    """How many of them are new."""
    current: int = 0
    """How many are matched now."""
    why: str = ""
    """What does not fit, in words."""


class EventSource(Protocol):
    """Who counts what happens to one entity."""

    def count(self, name: str, now: int) -> int:
        """How many there were until now."""

    def current(self) -> int:
        """How many are matched now."""

    def why(self) -> str:
        """What did not fit last."""

    def left(self, now: int) -> int:
        """Milliseconds until something may be counted without a message."""

    def close(self) -> None:
        """Counts no more."""


class Events(Handle):
    """Made by ``Node.on_events``. An executor calls the callbacks; ``destroy()`` ends that."""

    def __init__(
        self, node: Node, source: EventSource, callbacks: dict[str, Callable[[Event], object]]
    ) -> None:
        super().__init__(node.context)
        self._source = source
        self._callbacks = callbacks
        now = node.context.clock()
        past = (MATCHED, INCOMPATIBLE_QOS)  # what was there before is told as well
        self._told = {name: 0 if name in past else source.count(name, now) for name in callbacks}
        self._present = 0
        self.home = node.entities
        node.entities.append(self)

    def ready(self, now: int) -> bool:
        """Whether there is something to tell."""
        return any(self._news(name, now) for name in self._callbacks)

    def run(self, now: int) -> None:
        """Tells it."""
        for name, callback in self._callbacks.items():
            if self._news(name, now):
                total = self._source.count(name, now)
                change = total - self._told[name]
                self._told[name] = total
                current = 0
                if name == MATCHED:
                    current = self._present = self._source.current()
                why = self._source.why() if name == INCOMPATIBLE_QOS else ""
                callback(Event(name, total, change, current, why))

    def left(self, now: int) -> int:
        """Milliseconds until something may be told without a message."""
        return self._source.left(now)

    def destroy(self) -> None:
        """Tells no more."""
        self._source.close()
        take_away(self)

    def _news(self, name: str, now: int) -> bool:
        if name == MATCHED and self._source.current() != self._present:
            return True
        return self._source.count(name, now) != self._told[name]


class SessionEvents:
    """Counts what becomes of an entity at an agent: its deadline, what was lost here, and what the agent tells."""

    def __init__(self, node: Node, owner: Any, entity: Any, names: Iterable[str]) -> None:
        self._owner = owner
        self._period: int = entity.qos[2]
        self._clock = node.context.clock
        self._news: NewsReader | None = None
        if not COUNTS.keys().isdisjoint(names):
            from muros.rclc.host.agent_events import NewsReader

            self._news = NewsReader(node.context, node.participant, entity)
        self._missed = 0
        self._base: int | None = None  # the tick of the last message, or of the last period that was missed
        self._entity = entity
        if isinstance(owner, Subscription):
            self._deliver = entity.deliver
            entity.deliver = self._take
        else:
            self._publish = entity.publish
            entity.publish = self._send

    def count(self, name: str, now: int) -> int:
        """How many there were until now."""
        if name == MESSAGE_LOST:
            return int(getattr(self._owner, "lost", 0))
        if name == DEADLINE_MISSED:
            self._look(now)
            return self._missed
        return int(getattr(self._told(now), COUNTS[name]))

    def current(self) -> int:
        """How many are matched now, as far as the agent tells."""
        return self._told(self._clock()).current

    def why(self) -> str:
        """What did not fit last."""
        return self._told(self._clock()).why

    def left(self, now: int) -> int:
        """Milliseconds until the deadline, or until an agent has been silent for too long."""
        left = _NEVER if self._news is None else self._news.left(now)
        if self._base is None or not self._period:
            return left
        return min(left, max(self._base + self._period - now, 0))

    def close(self) -> None:
        """Counts no more."""
        self._period = 0
        if self._news is not None:
            self._news.close()

    def _told(self, now: int) -> News:
        assert self._news is not None
        return self._news.look(now)

    def _take(self, buf: Buffer, off: int, n: int) -> None:
        self._touch()
        self._deliver(buf, off, n)

    def _send(self, message: Any) -> bool:
        taken: bool = self._publish(message)
        if taken:
            self._touch()
        return taken

    def _touch(self) -> None:
        """A message: the first one starts the watch (DDS 1.4, 2.2.3.7)."""
        now = self._clock()
        self._look(now)
        self._base = now

    def _look(self, now: int) -> None:
        if self._base is not None and self._period:
            periods = int((now - self._base) // self._period)
            self._missed += periods
            self._base += periods * self._period


def make(node: Node, owner: Any, callbacks: dict[str, Callable[[Event], object]]) -> Events:
    """The events of a publisher or subscription of a node; see ``Node.on_events``."""
    for name, callback in callbacks.items():
        if name not in NAMES:
            raise WrongTypeError(f"there is no event {name!r}: {', '.join(NAMES)}")
        be_callable(callback, f"the callback of {name}")
    if isinstance(owner, Publisher):
        entity: Any = owner._writer
    elif isinstance(owner, Subscription):
        entity = owner.entity
    else:
        raise WrongTypeError(f"publishers and subscriptions have events, not {owner!r}")
    open_source = getattr(node.context.middleware, "event_source", None)
    source: EventSource
    if open_source is None:
        source = SessionEvents(node, owner, entity, callbacks)
    else:
        source = open_source(owner, entity)
    return Events(node, source, callbacks)
