"""How a space serves itself on an asyncio loop: one timer, and a call soon when it cannot wait for that."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from muros.space._door import SpaceError

if TYPE_CHECKING:
    import asyncio

__all__ = ["LoopDriver"]


class LoopDriver:
    """Calls `tick` when it is needed: at the time it returned last (ns of `clock`), and after `wake`.

    The timer is not moved with each tick: one that comes too early finds nothing to do, and costs less.
    """

    __slots__ = ("_clock", "_loop", "_soon", "_tick", "_timer", "_timer_at")

    def __init__(self, tick: Callable[[], int | None], clock: Callable[[], int]) -> None:
        self._tick = tick
        self._clock = clock
        self._loop: asyncio.AbstractEventLoop | None = None
        self._soon = False
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = 0

    @property
    def loop(self) -> asyncio.AbstractEventLoop | None:
        """The loop it runs on; None = none, or one that was closed."""
        if self._loop is not None and self._loop.is_closed():
            self.stop()
        return self._loop

    def attach(self, loop: asyncio.AbstractEventLoop) -> bool:
        """Run on `loop`; False if it did already. SpaceError if it runs on another one."""
        if self.loop is loop:
            return False
        if self._loop is not None:
            raise SpaceError("the space is attached to another event loop; close that loop first")
        self._loop = loop
        self.wake()
        return True

    def wake(self) -> None:
        """A tick is needed soon."""
        loop = self._loop
        if loop is None or self._soon or loop.is_closed():
            return
        self._soon = True
        loop.call_soon(self._run)

    def stop(self) -> None:
        """Call nothing any more, until attached again."""
        self._loop = None
        self._soon = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _run(self) -> None:
        """A call soon has come."""
        if self._soon:
            self._soon = False
            self._serve()

    def _time_has_come(self) -> None:
        self._timer = None
        self._serve()

    def _serve(self) -> None:
        due = self._tick()
        loop = self._loop
        if due is None or loop is None:
            return
        if self._timer is not None:
            if self._timer_at <= due:
                return
            self._timer.cancel()
        self._timer_at = due
        self._timer = loop.call_later(max(0, due - self._clock()) / 1e9, self._time_has_come)
