"""What a space tells of one writer or reader, as rclc wants it counted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from muros.rclc.host.events import COUNTS, DEADLINE_MISSED, MESSAGE_LOST
from muros.space.rclc._counts import EndpointCounts

if TYPE_CHECKING:
    from muros.space.rclc._middleware import SpaceMiddleware

__all__ = ["SpaceEvents"]

_NEVER = 1_000_000


class SpaceEvents:
    """Counts what happens to a writer or reader; see `muros.rclc.host.events.EventSource`."""

    def __init__(self, context: SpaceMiddleware, owner: Any, entity: Any) -> None:
        self._owner = owner
        self._end = entity.entity
        self._lock = context.ground.lock
        with self._lock:
            self._end.on_deadline = context.stir
            self._counts = EndpointCounts(context.ground.space, context.domain, self._end, context.stir)

    def count(self, name: str, now: int) -> int:
        """How many there were until now."""
        if name == DEADLINE_MISSED:
            return int(self._end.deadline_missed)
        if name == MESSAGE_LOST:
            return int(getattr(self._end, "lost", 0)) + int(getattr(self._owner, "lost", 0))
        return int(getattr(self._counts, COUNTS[name]))

    def current(self) -> int:
        """How many are matched now."""
        with self._lock:
            return len(self._end.matched)

    def why(self) -> str:
        """What did not fit last."""
        return self._counts.why

    def left(self, now: int) -> int:
        """The space wakes us."""
        return _NEVER

    def close(self) -> None:
        """Counts no more."""
        with self._lock:
            self._counts.close()
