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
        super().__init__(context)
        self._kind = kind
        self._asked: "dict[int, tuple[Any, int]]" = {}  # number: (on_reply, deadline)
        self._waiting: "list[tuple[Any, Any]]" = []

    def send(self, request: "Any", on_reply: "Callable[[Any], object]", timeout: float = _TIMEOUT) -> bool:
        """Sends a request; an executor calls ``on_reply(response)``, with None after ``timeout`` seconds.

        False when the request was not taken.
        """
        number = self.entity.send(request)
        if not number:
            return False
        self._asked[number] = (on_reply, ticks_add(self.context.clock(), int(timeout * 1000)))
        return True

    def deliver(self, number: int, buf: "Buffer", off: int, n: int) -> None:
        """Takes a reply of the middleware."""
        asked = self._asked.get(number)
        if asked is None:
            return  # it came too late, or twice
        response = self._kind.Response()
        try:
            response.read(buf, off, n)
        except ValueError:
            self.malformed += 1
            return
        del self._asked[number]
        self._waiting.append((asked[0], response))

    def ready(self, now: int) -> bool:
        """Whether a reply waits, or a request is too old."""
        return len(self._waiting) > 0 or self.left(now) == 0

    def run(self, now: int) -> None:
        """Hands on a reply, or ends the wait for a request that is too old."""
        if self._waiting:
            on_reply, response = self._waiting.pop(0)
            on_reply(response)
            return
        for number in self._asked:
            on_reply, end = self._asked[number]
            if ticks_diff(end, now) <= 0:
                del self._asked[number]
                on_reply(None)
                return

    def left(self, now: int) -> int:
        """Milliseconds until the first request is too old."""
        left = _NEVER
        for number in self._asked:
            left = min(left, max(ticks_diff(self._asked[number][1], now), 0))
        return left
