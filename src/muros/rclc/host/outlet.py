"""Where what a thread publishes goes: out, or to the task of LET whose callback it runs. For hosts.

`Publisher.publish`, `Service.reply` and `Client.send` ask `outlet.task`, which is None unless this thread runs a
callback of an executor with logical execution time (see `let` and `host.let`).
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from muros.rclc.host.let import HostTask


LOG_TOPIC = "/rosout"
"""What is logged is no output: it leaves at once."""


class Outlet(threading.local):
    """What each thread has of its own."""

    task: HostTask | None = None
    """Who holds back what this thread publishes."""


outlet = Outlet()


def body(message: Any) -> bytes:
    """A message as it is now, serialised."""
    serialize = getattr(message, "serialize", None)
    if serialize is not None:
        data: bytes = serialize()
        return data
    buf = bytearray(message.size())
    message.write(buf, 0)
    return bytes(buf)
