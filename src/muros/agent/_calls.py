"""Calls that become due: a heap by time, from which a call can be taken back."""

from collections.abc import Callable
from heapq import heapify, heappop, heappush
from itertools import count

__all__ = ["Call", "Calls"]

_STALE_MIN = 64
"""Calls taken back that may lie in the heap before it is worth cleaning."""


class Call:
    """One call to come; ``function`` is None once it was made or taken back."""

    __slots__ = ("function",)

    def __init__(self, function: Callable[[], object]) -> None:
        self.function: Callable[[], object] | None = function


class Calls:
    """Calls by the tick (ms) at which they are due. What was taken back is not kept for long."""

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, Call]] = []
        self._order = count()
        self._stale = 0

    def at(self, tick: int, function: Callable[[], object]) -> Call:
        """Has ``function`` called by the first ``run`` at or after ``tick``."""
        call = Call(function)
        heappush(self._heap, (tick, next(self._order), call))
        return call

    def cancel(self, call: Call) -> None:
        """It is not called. Cancelling twice, or what was called, is allowed."""
        if call.function is None:
            return
        call.function = None
        self._stale += 1
        if self._stale > _STALE_MIN and 2 * self._stale > len(self._heap):
            self._heap = [entry for entry in self._heap if entry[2].function is not None]
            heapify(self._heap)
            self._stale = 0

    def run(self, now: int) -> None:
        """Calls what is due at ``now``, in order of time. What these calls ask for at ``now`` may wait for the next."""
        for _ in range(len(self._heap)):
            heap = self._heap
            if not heap or heap[0][0] > now:
                return
            call = heappop(heap)[2]
            function, call.function = call.function, None
            if function is None:
                self._stale -= 1
            else:
                function()

    def next(self) -> int | None:
        """When ``run`` has something to do."""
        while self._heap and self._heap[0][2].function is None:
            heappop(self._heap)
            self._stale -= 1
        return self._heap[0][0] if self._heap else None

    def __len__(self) -> int:
        return len(self._heap)
