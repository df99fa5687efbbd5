"""How executors wait in asyncio programs: the loop of the program goes on meanwhile.

Theory of operation. Middlewares are waited for by threads, and any thread may wake them. So each executor that is spun
in an asyncio program has a thread that does nothing but wait for it; callbacks and passes run in the loop's thread. A
space that the program's own loop serves needs no thread: it rings a bell when something has come.

Several executors of one context may be spun by tasks of one loop. What one of them has the middleware hand on may be
for another, which waits: so each, before it waits, rouses those that have something to do now.
"""

from __future__ import annotations

import queue
import threading
import weakref
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # asyncio is imported where it is used: programs that have no loop need not load it
    import asyncio

    from muros.rclc.host.executor import Executor

    Came = asyncio.Future[bool]  # done when a wait is over; whether the thread that waited has said so

_LONGEST = 1000.0
"""Milliseconds of one wait: a thread that was woken just before it went to sleep is wanted again so soon."""

_waiting: weakref.WeakKeyDictionary[Any, list[tuple[Executor, Came]]] = weakref.WeakKeyDictionary()
"""Who waits, by context."""


class Sleeper:
    """The thread that waits for an executor, from when it is first needed until the executor is gone."""

    def __init__(self, executor: Executor) -> None:
        self._orders: queue.SimpleQueue[tuple[asyncio.AbstractEventLoop, Any, float, Any, Came] | None]
        self._orders = queue.SimpleQueue()
        self._came: Came | None = None
        threading.Thread(target=_sleep, args=(self._orders,), daemon=True, name="muros asyncio").start()
        weakref.finalize(executor, self._orders.put, None)

    def wait(self, loop: asyncio.AbstractEventLoop, middleware: Any, timeout: float, came: Came) -> None:
        """Has `came` done when something may have come, after `timeout` ms at the latest, or sooner."""
        self._came = came
        self._orders.put((loop, middleware, min(timeout, _LONGEST), getattr(middleware, "seen", None), came))

    def rouse(self) -> None:
        """Ends the wait that goes on; from any thread."""
        came = self._came
        if came is not None:
            with suppress(RuntimeError):  # its loop is closed
                came.get_loop().call_soon_threadsafe(_settle, came, False)


async def pause(executor: Executor, timeout: float) -> None:
    """Waits until something may have come for an executor, at most `timeout` ms; lets others run in any case."""
    import asyncio

    context = executor.context
    _rouse(executor)
    if timeout <= 0:
        await asyncio.sleep(0)
        return
    middleware: Any = context.middleware
    if hasattr(middleware, "wait_async"):
        await middleware.wait_async(timeout)
        return
    loop = asyncio.get_running_loop()
    came: Came = loop.create_future()
    waiting = _waiting.setdefault(context, [])
    waiting.append((executor, came))
    try:
        if getattr(middleware, "served", True):
            if executor.sleeper is None:
                executor.sleeper = Sleeper(executor)
            executor.sleeper.wait(loop, middleware, timeout, came)
            by_thread = True
            try:
                by_thread = await came
            except asyncio.CancelledError:
                by_thread = False
                raise
            finally:
                if not by_thread:
                    executor.wake()  # the thread waits still
        else:
            await _ring(loop, middleware, timeout, came)
    finally:
        waiting.remove((executor, came))


async def wait_async(middleware: Any, timeout: float) -> None:
    """Lets `timeout` ms pass, for a middleware that has `wait_async` of its own and can only be looked at again."""
    import asyncio

    await asyncio.sleep(timeout / 1000)


async def _ring(loop: asyncio.AbstractEventLoop, middleware: Any, timeout: float, came: Came) -> None:
    """Waits for the bell of a middleware that the running loop serves."""

    def bell() -> None:
        loop.call_soon_threadsafe(_settle, came, True)

    timer = loop.call_later(timeout / 1000, _settle, came, True)
    middleware.bells.append(bell)
    try:
        if not middleware.came:
            await came
    finally:
        timer.cancel()
        middleware.bells.remove(bell)


def _rouse(executor: Executor) -> None:
    """Wakes the other executors of a context that have something to do now."""
    for other, came in _waiting.get(executor.context, ()):
        if other is not executor and not came.done():
            now = other.context.clock()
            if any(handle.ready(now) for handle in other.handles):
                came.set_result(False)


def _sleep(orders: queue.SimpleQueue[Any]) -> None:
    """What the thread does."""
    while (order := orders.get()) is not None:
        loop, middleware, timeout, seen, came = order
        error: BaseException | None = None
        try:
            if seen is not None:
                middleware.adopt(seen)
            if not came.done():
                middleware.wait(timeout if seen is None else max(1, int(timeout)))
        except BaseException as raised:
            error = raised
        with suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(_settle, came, True, error)
        del order, loop, middleware, came, error


def _settle(came: Came, by_thread: bool, error: BaseException | None = None) -> None:
    if came.done():
        return
    if error is None:
        came.set_result(by_thread)
    else:
        came.set_exception(error)
