"""What a space tells of one writer or reader, as rclc wants it counted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from muros.findings import Finding
from muros.rclc.host.events import DEADLINE_MISSED, INCOMPATIBLE_QOS, LIVELINESS_LOST, MATCHED, MESSAGE_LOST
from muros.space._graph import GraphEvent, Incompatible, Matched, Unmatched

if TYPE_CHECKING:
    from muros.space.rclc._middleware import SpaceMiddleware

__all__ = ["SpaceEvents"]

_NEVER = 1_000_000
_SILENCE = ("writer-silent", "liveliness-lost")
"""Findings of a reader about its writers, and of a writer about itself."""


class SpaceEvents:
    """Counts what happens to a writer or reader; see `muros.rclc.host.events.EventSource`."""

    names: tuple[str, ...] = (DEADLINE_MISSED, INCOMPATIBLE_QOS, LIVELINESS_LOST, MATCHED, MESSAGE_LOST)

    def __init__(self, context: SpaceMiddleware, owner: Any, entity: Any) -> None:
        self._context = context
        self._owner = owner
        self._end = entity.entity
        self._lock = context.ground.server.lock
        with self._lock:
            self._end.on_deadline = context.stir
            self._stop = context.ground.space.graph.watch(self._watch)
            self._deaf = context.ground.space.findings.on_finding(self._hear)
            matched = len(self._end.matched)
            gid, topic = self._end.gid, context.ground.space.graph.topic(self._end.topic.name, context.domain)
            misfits = [m for m in topic.incompatible if gid in (m.writer.gid, m.reader.gid)] if topic else []
        self._counts = {INCOMPATIBLE_QOS: len(misfits), MATCHED: matched, LIVELINESS_LOST: 0}
        self._why = "; ".join(misfits[-1].reasons) if misfits else ""

    def count(self, name: str, now: int) -> int:
        """How many there were until now."""
        if name == DEADLINE_MISSED:
            return int(self._end.deadline_missed)
        if name == MESSAGE_LOST:
            return int(getattr(self._end, "lost", 0)) + int(getattr(self._owner, "lost", 0))
        return self._counts[name]

    def current(self) -> int:
        """How many are matched now."""
        with self._lock:
            return len(self._end.matched)

    def why(self) -> str:
        """What did not fit last."""
        return self._why

    def left(self, now: int) -> int:
        """The space wakes us."""
        return _NEVER

    def close(self) -> None:
        """Counts no more."""
        with self._lock:
            self._stop()
            self._deaf()

    def _watch(self, event: GraphEvent) -> None:
        """The graph has changed; called with the lock held."""
        if not isinstance(event, Matched | Unmatched | Incompatible):
            return
        if self._end.gid not in (event.writer.gid, event.reader.gid):
            return
        if isinstance(event, Matched):
            self._counts[MATCHED] += 1
        elif isinstance(event, Incompatible):
            self._counts[INCOMPATIBLE_QOS] += 1
            self._why = "; ".join(event.reasons)
        self._context.stir()

    def _hear(self, finding: Finding) -> None:
        """The space reports something: liveliness is told of in no other way."""
        if finding.code in _SILENCE and (finding.who, finding.subject) == (
            self._end.owner,
            self._end.topic.name,
        ):
            self._counts[LIVELINESS_LOST] += finding.new
            self._context.stir()
