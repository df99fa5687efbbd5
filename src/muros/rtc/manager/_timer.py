"""Tasks that come back: the manager's one thread for the name service, the other managers, and users' own tasks."""

from __future__ import annotations

import heapq
import itertools
import threading
import time
from collections.abc import Callable
from typing import Final

__all__ = ["Timer"]


class Timer:
    """Calls tasks in its thread, each after its period; one that is late is not made up for.

    `on_error(error)` hears of a task that raised; it goes on. The thread starts with the first task.
    """

    def __init__(
        self, on_error: Callable[[Exception], object], *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._on_error = on_error
        self._clock: Final = clock
        self._changed = threading.Condition()
        self._tasks: list[tuple[float, int, _Task]] = []
        self._numbers = itertools.count()
        self._thread: threading.Thread | None = None
        self._closed = False

    def every(self, period: float, task: Callable[[], object]) -> Callable[[], None]:
        """Call `task` every `period` seconds, for the first time after one. Returns what ends it."""
        return self._add(_Task(task, period), period)

    def after(self, delay: float, task: Callable[[], object]) -> Callable[[], None]:
        """Call `task` once, `delay` seconds from now. Returns what calls it off."""
        return self._add(_Task(task, None), delay)

    def close(self) -> None:
        """End the thread; a task that runs ends first, unless it is the one that calls."""
        with self._changed:
            self._closed = True
            self._tasks.clear()
            self._changed.notify_all()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join()

    def _add(self, task: _Task, delay: float) -> Callable[[], None]:
        if not delay >= 0 or (task.period is not None and not task.period > 0):
            raise ValueError("a task's period must be more than 0 seconds, its delay not less")
        with self._changed:
            if not self._closed:
                heapq.heappush(self._tasks, (self._clock() + delay, next(self._numbers), task))
                if self._thread is None:
                    self._thread = threading.Thread(target=self._run, name="rtc-timer", daemon=True)
                    self._thread.start()
                self._changed.notify_all()

        def cancel() -> None:
            task.cancelled = True

        return cancel

    def _run(self) -> None:
        while (task := self._next()) is not None:
            try:
                task.call()
            except Exception as error:
                self._on_error(error)
            if task.period is not None and not task.cancelled:
                self._add(task, task.period)

    def _next(self) -> _Task | None:
        with self._changed:
            while not self._closed:
                if not self._tasks:
                    self._changed.wait()
                    continue
                left = self._tasks[0][0] - self._clock()
                if left > 0:
                    self._changed.wait(left)
                    continue
                task = heapq.heappop(self._tasks)[2]
                if not task.cancelled:
                    return task
        return None


class _Task:
    __slots__ = ("call", "cancelled", "period")

    def __init__(self, call: Callable[[], object], period: float | None) -> None:
        self.call = call
        self.period = period
        self.cancelled = False
