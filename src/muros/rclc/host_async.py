"""How executors wait in asyncio programs: the loop of the program goes on meanwhile."""

from __future__ import annotations

import asyncio
from typing import Any

_LOOK = 5.0
"""Milliseconds after which a transport is looked at again that says nothing of what has come."""


async def wait_async(middleware: Any, timeout: float) -> None:
    """Waits until something may have come, at most `timeout` ms, and lets others run in any case.

    A middleware that has `wait_async(timeout)` does it by itself. Of a session whose transport is a file or a socket
    the loop tells when something has come; of any other transport it is asked now and then.
    """
    if timeout <= 0:
        await asyncio.sleep(0)
        return
    own = getattr(middleware, "wait_async", None)
    if own is not None:
        await own(timeout)
        return
    file = getattr(getattr(middleware, "transport", None), "_file", None)
    if file is None or not getattr(middleware, "up", False):
        await asyncio.sleep(min(timeout, _LOOK) / 1000)
        return
    await readable(file, timeout)


async def readable(file: Any, timeout: float) -> None:
    """Waits until there is something to read from a file, at most `timeout` ms."""
    loop = asyncio.get_running_loop()
    came: asyncio.Future[None] = loop.create_future()
    number = file if isinstance(file, int) else file.fileno()
    try:
        loop.add_reader(number, _settle, came)
    except (NotImplementedError, PermissionError, ValueError):  # a loop, or a file, that cannot
        await asyncio.sleep(min(timeout, _LOOK) / 1000)
        return
    timer = loop.call_later(timeout / 1000, _settle, came)
    try:
        await came
    finally:
        timer.cancel()
        loop.remove_reader(number)


def _settle(came: asyncio.Future[None]) -> None:
    if not came.done():
        came.set_result(None)
