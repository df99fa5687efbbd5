"""Servers of services."""

from muros.compat import const
from muros.rclc.executor import Handle

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Context
    from muros.xrce._types import Buffer


class Service(Handle):
    """Made by ``Node.service``. An executor calls ``callback(request)`` and sends the response that it returns.

    A callback that returns None answers later: it keeps ``service.identity`` and calls ``reply(identity, response)``.
    At most ``depth`` requests wait to be taken, and as many answers to be sent; ``lost`` counts those that were dropped
    for that or could never be sent. ``malformed`` counts samples that are no request of this type.
    """

    depth = 10
    identity = b""
    lost = 0
    malformed = 0

    if TYPE_CHECKING:
        refused: int  # requests beyond the rules for memory, where there are some, see ``memory``

    def __init__(self, context: "Context", kind: "Any", callback: "Callable[[Any], Any]") -> None:
        self.context = context
        self.callback = callback
        self._kind = kind
        self._waiting: "list[tuple[bytes, Any]]" = []
        self._answers: "list[tuple[bytes, Any]]" = []  # those that cannot go out yet

    def reply(self, identity: bytes, response: "Any") -> None:
        """Answers a request; an answer that cannot go out now goes when the middleware has room for it."""
        if len(self._answers) < self.depth:
            self._answers.append((identity, response))
            self._send()
        else:
            self.lost += 1

    def deliver(self, identity: bytes, buf: "Buffer", off: int, n: int) -> None:
        """Takes a request of the middleware."""
        if len(self._waiting) >= self.depth:
            self.lost += 1
            return
        request = self._kind.Request()
        try:
            request.read(buf, off, n)
            self._waiting.append((identity, request))
        except ValueError:
            self.malformed += 1

    def ready(self, now: int) -> bool:
        """Whether a request can be taken, or an answer sent."""
        return bool(
            (self._waiting and len(self._answers) < self.depth) or (self._answers and self.entity.room())
        )

    def run(self, now: int) -> None:
        """Takes a request, calls the callback and answers."""
        self._send()
        if self._waiting:
            identity, request = self._waiting.pop(0)
            self.identity = identity
            response = self.callback(request)
            if response is not None:
                self.reply(identity, response)

    def _send(self) -> None:
        """Sends what can be sent; an answer that is refused although there is room will never go."""
        answers = self._answers
        while answers and self.entity.room():
            identity, response = answers.pop(0)
            if not self.entity.reply(identity, response):
                self.lost += 1
