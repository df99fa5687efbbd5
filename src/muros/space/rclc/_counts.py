"""Counts of what a space tells of one writer or reader, from now on and as it stands: who met it, who does not fit."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from muros.findings import Finding
from muros.space._graph import GraphEvent, Incompatible, Matched, Unmatched

if TYPE_CHECKING:
    from muros.space import Space

__all__ = ["EndpointCounts"]

_SILENCE = ("writer-silent", "liveliness-lost")
"""Findings of a reader about its writers, and of a writer about itself."""


class EndpointCounts:
    """What happens to `end`, a writer or reader of a domain of `space`; `on_change()` is called at each change."""

    def __init__(self, space: Space, domain: int | None, end: Any, on_change: Callable[[], object]) -> None:
        self._gid, self._owner, self._topic = end.gid, end.owner, end.topic.name
        self._on_change = on_change
        self._stop = space.graph.watch(self._watch)
        self._deaf = space.findings.on_finding(self._hear)
        topic = space.graph.topic(self._topic, domain)
        misfits = (
            [m for m in topic.incompatible if self._gid in (m.writer.gid, m.reader.gid)] if topic else []
        )
        self.matched = len(end.matched)
        """How many it has met."""
        self.misfits = len(misfits)
        """How many it has met that do not fit."""
        self.silences = 0
        """How often a writer has not kept its liveliness."""
        self.why = "; ".join(misfits[-1].reasons) if misfits else ""
        """What did not fit last, in words."""

    def close(self) -> None:
        """Counts no more."""
        self._stop()
        self._deaf()

    def _watch(self, event: GraphEvent) -> None:
        """The graph has changed."""
        if not isinstance(event, Matched | Unmatched | Incompatible):
            return
        if self._gid not in (event.writer.gid, event.reader.gid):
            return
        if isinstance(event, Matched):
            self.matched += 1
        elif isinstance(event, Incompatible):
            self.misfits += 1
            self.why = "; ".join(event.reasons)
        self._on_change()

    def _hear(self, finding: Finding) -> None:
        """The space reports something: liveliness is told of in no other way."""
        if finding.code in _SILENCE and (finding.who, finding.subject) == (self._owner, self._topic):
            self.silences += finding.new
            self._on_change()
