"""Clients of services."""

from muros.compat import const, ticks_add, ticks_diff
from muros.rclc.executor import Handle

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc import handles
    from muros.rclc.context import Context
    from muros.xrce._types import Buffer

_NEVER = const(1000000)
_TIMEOUT = const(10)  # seconds


class Client(Handle):
    """Made by ``Node.client``. ``malformed`` counts replies that are no response of this type."""

    malformed = 0

    if TYPE_CHECKING:
        refused: int  # responses beyond the rules for memory, where there are some, see ``memory``
        call = handles.call
        wait_for_service = handles.wait_for_service

    def __init__(self, context: "Context", kind: "Any") -> None:
        self.context = context
        self._kind = kind
        self._asked: "list[list[Any]]" = []  # number, on_reply, deadline, None; 0 and the response once it is there

    def send(self, request: "Any", on_reply: "Callable[[Any], object]", timeout: float = _TIMEOUT) -> bool:
        """Sends a request; an executor calls ``on_reply(response)``, with None after ``timeout`` seconds.

        False when the request was not taken.
        """
        number = self.entity.send(request)
        if not number:
            return False
        end = ticks_add(self.context.clock(), int(timeout * 1000))
        self._asked.append([number, on_reply, end, None])
        return True

    def deliver(self, number: int, buf: "Buffer", off: int, n: int) -> None:
        """Takes a reply of the middleware; one that came too late is for nothing that is asked."""
        for asked in self._asked:
            if asked[0] == number:
                response = self._kind.Response()
                try:
                    response.read(buf, off, n)
                    asked[0], asked[3] = 0, response
                except ValueError:
                    self.malformed += 1

    def run(self, now: int) -> None:
        """Hands on the first reply, or ends the wait for a request that is too old."""
        for asked in self._asked:
            if asked[0] == 0 or ticks_diff(asked[2], now) <= 0:
                self._asked.remove(asked)
                asked[1](asked[3])
                return

    def left(self, now: int) -> int:
        """Milliseconds until a request is too old; none when a reply is there."""
        left = _NEVER
        for asked in self._asked:
            left = min(left, max(ticks_diff(asked[2], now), 0) if asked[0] else 0)
        return left
