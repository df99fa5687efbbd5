"""When what is due: one heap for everything in a domain that waits for a time.

A time that moves away stays in the heap and is looked at once more when it comes; one that moves nearer is put in
again. So a timer that is pushed back with every sample costs nothing for each sample.
"""

from heapq import heappop, heappush

from muros.rtps._endpoint import NEVER

__all__ = ["Agenda", "Timed"]


class Timed:
    """Something that waits for times. Only `Agenda` changes `wake_at`."""

    __slots__ = ("wake_at",)

    def __init__(self) -> None:
        self.wake_at = NEVER
        """When it will be woken, as far as asked for."""

    def wake(self, now: int) -> int:
        """Do what is due; returns when to be woken next, `NEVER` = when asked for."""
        raise NotImplementedError


class Agenda:
    """Wakes what is due, in order."""

    __slots__ = ("_heap", "_number")

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, Timed]] = []
        self._number = 0

    def __len__(self) -> int:
        """Entries, those that have become void included."""
        return len(self._heap)

    def at(self, item: Timed, at: int) -> None:
        """Wake `item` at this time, if it would not be woken earlier."""
        if at < item.wake_at:
            item.wake_at = at
            self._number += 1
            heappush(self._heap, (at, self._number, item))

    def forget(self, item: Timed) -> None:
        """Do not wake it any more."""
        item.wake_at = NEVER

    @property
    def next(self) -> int | None:
        """When something may be due next; None = nothing waits."""
        heap = self._heap
        while heap and heap[0][2].wake_at != heap[0][0]:
            heappop(heap)
        return heap[0][0] if heap else None

    def run(self, now: int) -> None:
        """Wake what is due, each at most once."""
        heap = self._heap
        again: list[tuple[Timed, int]] = []
        while heap and heap[0][0] <= now:
            at, _, item = heappop(heap)
            if item.wake_at == at:
                item.wake_at = NEVER
                next_at = item.wake(now)
                if next_at < NEVER:
                    again.append((item, next_at))
        for item, next_at in again:
            self.at(item, next_at)
