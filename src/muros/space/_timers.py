"""Timers of a space: what becomes due, in a heap, over a clock that may be set back.

A wall clock can jump. Forward, everything due in between is due at once; backward, the timers go on as if it
had not jumped (`now` never decreases), so that nobody waits longer than promised.
"""

from collections.abc import Callable
from heapq import heapify, heappop, heappush
from itertools import count
from typing import Final

__all__ = ["Timer", "Timers"]

MIN_STALE: Final = 64
"""Cancelled timers that may lie in the heap before it is worth cleaning."""


class Timer:
    """One thing that becomes due. `callback` is None once it has run or was cancelled."""

    __slots__ = ("callback", "when")

    def __init__(self, when: int, callback: Callable[[], None]) -> None:
        self.when = when
        self.callback: Callable[[], None] | None = callback


class Timers:
    """A heap of timers over `clock` (ns). `changed` is called when a timer becomes the earliest one."""

    def __init__(self, clock: Callable[[], int], changed: Callable[[int], None]) -> None:
        self._clock = clock
        self._changed = changed
        self._heap: list[tuple[int, int, Timer]] = []
        self._order = count()
        self._stale = 0
        self._last = clock()
        self._skew = 0

    def now(self) -> int:
        """Time in ns that never decreases."""
        time = self._clock() + self._skew
        if time < self._last:
            self._skew += self._last - time
            time = self._last
        self._last = time
        return time

    def at(self, when: int, callback: Callable[[], None]) -> Timer:
        """Call `callback` when `now` has reached `when`."""
        timer = Timer(when, callback)
        earliest = not self._heap or when < self._heap[0][0]
        heappush(self._heap, (when, next(self._order), timer))
        if earliest:
            self._changed(when - self._skew)
        return timer

    def move(self, timer: Timer | None, when: int | None, callback: Callable[[], None]) -> Timer | None:
        """Cancel `timer`, if there is one, and call `callback` at `when` instead, if that is not None."""
        if timer is not None:
            self.cancel(timer)
        return None if when is None else self.at(when, callback)

    def cancel(self, timer: Timer) -> None:
        """It will not run. Cancelling twice, or what has run, is allowed."""
        if timer.callback is None:
            return
        timer.callback = None
        self._stale += 1
        if self._stale > MIN_STALE and self._stale * 2 > len(self._heap):
            self._heap = [entry for entry in self._heap if entry[2].callback is not None]
            heapify(self._heap)
            self._stale = 0

    def run(self) -> None:
        """Run what is due, in order of time."""
        now = self.now()
        while self._heap and self._heap[0][0] <= now:
            timer = heappop(self._heap)[2]
            callback, timer.callback = timer.callback, None
            if callback is None:
                self._stale -= 1
            else:
                callback()

    def next(self) -> int | None:
        """When, by the clock, `run` has something to do."""
        while self._heap and self._heap[0][2].callback is None:
            heappop(self._heap)
            self._stale -= 1
        return self._heap[0][0] - self._skew if self._heap else None

    def __len__(self) -> int:
        return len(self._heap)
