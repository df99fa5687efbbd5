"""Serving: how the contexts of a process run the spaces they stand on, whichever threads they are in.

Theory of operation. All spaces are attached to one private asyncio loop. Nothing runs it in the background: whoever
waits (`SpaceMiddleware.wait`) runs it until something has come for him or his time is over. So a program of one thread
has no other thread to hand things to and nothing to poll: it sleeps in the selector, and what comes wakes it.

With several threads, one lock guards the spaces and the loop. It is held while anything of them runs and let go by the
selector while it sleeps, so that others can publish meanwhile. The thread that runs the loop is the driver; others
that wait follow, and are told when something has come for them or when the driver has left and one of them is to drive.
A loop that sleeps must learn of calls and timers that others add: `_Loop` sees to that.

In an asyncio program the private loop runs inside the program's own, which stands still meanwhile, as it does in any
call that waits.
"""

from __future__ import annotations

import asyncio
import os
import select
import selectors
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from contextvars import Context
from typing import Any, Final, Protocol

from muros.rclc.errors import RclError

__all__ = ["Server", "Waiter", "server"]

PRECISE: Final = 0.2
"""Seconds; shorter waits are kept to the microsecond."""

JUST_NOW: Final = 200e-6
"""Seconds after which a loop that ran is looked at again by who does not wait: what some ten messages cost."""

_EPOLL = selectors.DefaultSelector is getattr(selectors, "EpollSelector", None)


class Waiter(Protocol):
    """Who waits for something to come."""

    bells: list[Callable[[], None]]
    """What else is called when something has come, by any thread and with the lock held."""

    @property
    def came(self) -> bool:
        """Whether something has come; asked with the lock held."""


class Server:
    """The loop and the lock of all spaces that contexts stand on."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self._changed = threading.Condition(self.lock)
        self._followers = 0
        self._driver: Waiter | None = None
        self._thread = 0
        self._end = 0.0
        self._uses = 0
        self._loop: _Loop | None = None
        self.served = time.monotonic()  # when the loop ran last
        self.asleep = False  # the driver is in its selector and does not hold the lock

    @property
    def loop(self) -> _Loop:
        """The loop, made when it is first needed."""
        if self._loop is None:
            self._loop = _Loop(self)
        return self._loop

    def use(self) -> None:
        """Somebody needs the loop from now on."""
        self._uses += 1

    def release(self) -> None:
        """Somebody needs it no more; the last one closes it."""
        self._uses -= 1
        self._tidy()

    def poll(self, waiter: Waiter) -> None:
        """Have the spaces do what is due and take what has come, without waiting.

        Nothing is done so soon after the last time that only what came in between could be missed.
        """
        with self.lock:
            loop = self._loop
            if self._driver is None and (
                loop is None or loop.posted or time.monotonic() - self.served > JUST_NOW
            ):
                self._drive(waiter, 0.0)

    def wait(self, waiter: Waiter, seconds: float) -> None:
        """Serve the spaces until something has come for `waiter`, at most so long.

        RclError from inside a callback of a space: what it waits for could not come.
        """
        end = time.monotonic() + seconds
        with self.lock:
            while not waiter.came:
                if self._driver is None:
                    self._drive(waiter, end)
                elif self._thread == threading.get_ident():
                    raise RclError("a callback of the space cannot wait: let it return, the executor goes on")
                else:
                    self._followers += 1
                    try:
                        self._changed.wait(max(0.0, end - time.monotonic()))
                    finally:
                        self._followers -= 1
                if time.monotonic() >= end:
                    return

    def wake(self, waiter: Waiter) -> None:
        """Something has come for `waiter`: end its wait. To be called with the lock held."""
        for bell in waiter.bells:
            bell()
        if self._driver is waiter and self._loop is not None:
            self._loop.end()
        elif self._followers:
            self._changed.notify_all()

    def left(self) -> float:
        """Seconds until the driver's time is over; not positive when it is."""
        return self._end - time.monotonic()

    def _drive(self, waiter: Waiter, end: float) -> None:
        """Run the loop until something has come for `waiter` or `end` is reached."""
        loop = self.loop
        outer = asyncio._get_running_loop()
        self._driver, self._end, self._thread = waiter, end, threading.get_ident()
        loop.posted = False
        if outer is not None:
            asyncio._set_running_loop(None)
        try:
            loop.run_forever()
        finally:
            if outer is not None:
                asyncio._set_running_loop(outer)
            self._driver = None
            self.served = time.monotonic()
            if self._followers:
                self._changed.notify_all()
            self._tidy()

    def _tidy(self) -> None:
        """Close the loop that nobody needs."""
        if not self._uses and self._driver is None and self._loop is not None:
            self._loop.close()
            self._loop = None


class _Loop(asyncio.SelectorEventLoop):
    """A loop that others may add to while it sleeps, as long as they hold the server's lock."""

    def __init__(self, owner: Server) -> None:
        self._owner = owner
        self.posted = False  # there are calls to make
        super().__init__(_Selector(owner, self))
        self.set_debug(False)  # its check of threads knows nothing of the lock

    def end(self) -> None:
        """End the run that goes on."""
        if self._owner.asleep:
            self.call_soon_threadsafe(self.stop)
        else:
            self.stop()

    def call_soon(  # type: ignore[override]
        self, callback: Callable[..., object], *args: Any, context: Context | None = None
    ) -> asyncio.Handle:
        """Call `callback` in the next round."""
        self.posted = True
        if self._owner.asleep:
            return self.call_soon_threadsafe(callback, *args, context=context)
        return super().call_soon(callback, *args, context=context)

    def call_at(  # type: ignore[override]
        self, when: float, callback: Callable[..., object], *args: Any, context: Context | None = None
    ) -> asyncio.TimerHandle:
        """Call `callback` at a time of the loop's clock."""
        handle = super().call_at(when, callback, *args, context=context)
        if self._owner.asleep:
            self.call_soon_threadsafe(_nothing)
        return handle


class _Selector(selectors.DefaultSelector):
    """A selector that sleeps no longer than the driver may wait, and without the lock."""

    def __init__(self, owner: Server, loop: _Loop) -> None:
        super().__init__()
        self._owner = owner
        self._loop = loop

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        owner = self._owner
        left = owner.left()
        if left <= 0:
            self._loop.stop()  # after this round
            return super().select(0)
        if timeout is not None and timeout <= 0:
            return super().select(0)
        owner.asleep = True
        owner.lock.release()
        try:
            ready = self._sleep(left if timeout is None else min(left, timeout))
        finally:
            owner.lock.acquire()
            owner.asleep = False
        return [event for event in map(self._now, ready) if event is not None]

    def _sleep(self, seconds: float) -> list[tuple[selectors.SelectorKey, int]]:
        """What is ready within a time. Python's epoll rounds it up to whole ms, so that timers would be late."""
        if _EPOLL and seconds < PRECISE:
            with suppress(ValueError):  # a descriptor that select cannot watch
                select.select((self.fileno(),), (), (), seconds)
                return super().select(0)
        return super().select(seconds)

    def _now(self, event: tuple[selectors.SelectorKey, int]) -> tuple[selectors.SelectorKey, int] | None:
        """An event as it is now that we have the lock again: others may have closed the socket meanwhile."""
        key, mask = event
        now = self.get_map().get(key.fd)
        return (now, mask & now.events) if now is not None and now.fileobj is key.fileobj else None


def _nothing() -> None:
    """Wakes the loop."""


def server() -> Server:
    """The server of this process."""
    return _server


def _begin_anew() -> None:
    """A child process has none of its parent's threads and must leave its sockets alone."""
    global _server
    _server = Server()


_server = Server()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_anew)
