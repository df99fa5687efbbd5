"""Waiting on hosts: a context works until something holds. No callback runs meanwhile, and none may wait so."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from muros.client.link import CONNECTED
from muros.client.raw import Raw
from muros.compat import ticks_add, ticks_diff
from muros.rclc.host.outlet import body

if TYPE_CHECKING:
    from muros.rclc.context import Context

__all__ = ["publish_confirmed", "spin_until", "wait_confirmed"]

_LONG = 1_000_000
"""Milliseconds that one wait may take."""
_SOON = 2
"""Milliseconds until confirmations are looked for again: a space tells nobody when they come."""


def spin_until(
    context: Context, condition: Callable[[], object], timeout: float | None, longest: int = _LONG
) -> bool:
    """Lets the middleware of a context work until a condition holds; whether it does.

    At most ``timeout`` seconds, None: for ever, or until the context is closed. The condition is looked at whenever
    something has come, and after ``longest`` ms.
    """
    end = None if timeout is None else ticks_add(context.clock(), int(timeout * 1000))
    while not condition():
        middleware = context.middleware
        now = context.clock()
        left = _LONG if end is None else ticks_diff(end, now)
        if left <= 0 or not context.running:
            return False
        middleware.spin_once(now)
        if not condition():
            middleware.wait(min(left, longest, middleware.deadline(now)))
    return True


def publish_confirmed(context: Context, writer: Any, message: Any, timeout: float) -> bool:
    """Publishes a message when there is room for it, and waits until it is confirmed: ``timeout`` seconds in all.

    False when that takes longer; what was not taken by then is not sent, and told.
    """
    offer = getattr(writer, "offer", writer.publish)
    end = ticks_add(context.clock(), int(timeout * 1000))
    sample = message if hasattr(message, "piece") else Raw(body(message))
    taken: bool | None = None

    def offered() -> bool:
        nonlocal taken
        if taken is None:
            taken = offer(sample)
        return taken is not None

    if not spin_until(context, offered, timeout, _SOON):
        writer.publish(sample)
        return False
    left = ticks_diff(end, context.clock()) / 1000
    return bool(taken) and wait_confirmed(context, writer, left)


def wait_confirmed(context: Context, writer: Any, timeout: float) -> bool:
    """Waits until what a writer, or a side of a service, has sent is confirmed. Best effort counts as confirmed."""
    return spin_until(context, _confirmation(writer), timeout, _SOON)


def _confirmation(writer: Any) -> Callable[[], bool]:
    """Tells whether what was sent is confirmed."""
    session = getattr(writer, "session", None)
    if session is None:
        return lambda: bool(getattr(writer, "acknowledged", True))
    stream = session.reliable
    mark: int | None = None

    def acknowledged() -> bool:
        """Whether the agent has all that was in the stream; when a session begins anew, that is sent again."""
        nonlocal mark
        if session.state != CONNECTED or session.backlog is not None:
            mark = None
            return False
        if mark is None:
            mark = stream.next
        return bool(stream.first - mark & 0xFFFF < 0x8000)

    return acknowledged if writer.stream is stream else lambda: True
