"""Back-pressure: how a full reader makes writers wait, and for how long.

Only reliable readers that keep all do this. A writer that meets a full one is refused and stands in line; each
sample taken calls the next in line, an emptied cache calls all. Nobody is refused longer than
`max_blocking_time`: counted from the writer's first refusal, and from the reader's, so that a reader that has
stopped taking holds up nobody any more.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from muros.space._timers import Timer
    from muros.space.local._reader import LocalReader
    from muros.space.local._writer import LocalWriter

__all__ = ["Pressure"]


class Pressure:
    """The line of writers before one full reader."""

    __slots__ = ("_line", "_reader", "_since", "_timer")

    def __init__(self, reader: LocalReader) -> None:
        self._reader = reader
        self._since: int | None = None
        self._line: deque[LocalWriter] | None = None
        self._timer: Timer | None = None

    def refuses(self, writer: LocalWriter) -> bool:
        """Whether `writer` has to wait; if so it is in line."""
        reader = self._reader
        if not reader.full:
            return False
        reader.purge()
        if not reader.full:
            return False
        timers, patience = reader.core.timers, reader.core.limits.max_blocking_time
        now = timers.now()
        if self._since is None:
            self._since = now
        if writer.refused_since is None:
            writer.refused_since = now
        until = min(self._since, writer.refused_since) + patience
        if now >= until:
            return False
        if not writer.waiting:
            writer.waiting = True
            if self._line is None:
                self._line = deque()
            self._line.append(writer)
            if self._timer is None:
                self._timer = timers.at(until, self._time_is_up)
        return True

    def relieve(self) -> None:
        """A sample was taken: the next in line may try."""
        if self._since is None and not self._line:
            return
        self._since = None
        if not self._reader.cache:
            self.release()
        elif self._line:
            self._call(self._line.popleft())
            if not self._line:
                self.release()

    def release(self) -> None:
        """Everybody may try: there is plenty of room, or the reader has gone."""
        if self._timer is not None:
            self._reader.core.timers.cancel(self._timer)
            self._timer = None
        while self._line:
            self._call(self._line.popleft())

    def leave(self, writer: LocalWriter) -> None:
        """`writer` and the reader are no longer matched: it waits for nothing here."""
        if self._line is not None and writer in self._line:
            self._line.remove(writer)
            self._call(writer)

    def _time_is_up(self) -> None:
        self._timer = None
        self.release()

    def _call(self, writer: LocalWriter) -> None:
        writer.waiting = False
        self._reader.core.post(writer)
