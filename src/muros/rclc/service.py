"""Services: servers and clients."""

from muros.compat import const, ticks_add, ticks_diff
from muros.rclc.executor import Handle

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Context
    from muros.xrce._types import Buffer

_NEVER = const(1000000)
_TIMEOUT = 10.0


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

    def __init__(self, context: "Context", kind: "Any", callback: "Callable[[Any], Any]") -> None:
        super().__init__(context)
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
        except ValueError:
            self.malformed += 1
            return
        self._waiting.append((identity, request))

    def ready(self, now: int) -> bool:
        """Whether a request can be taken, or an answer sent."""
        answers = len(self._answers)
        return (answers < self.depth and len(self._waiting) > 0) or (answers > 0 and self.entity.room())

    def run(self, now: int) -> None:
        """Takes a request, calls the callback and answers."""
        self._send()
        if self._waiting and len(self._answers) < self.depth:
            identity, request = self._waiting.pop(0)
            self.identity = identity
            response = self.callback(request)
            if response is not None:
                self.reply(identity, response)

    def destroy(self) -> None:
        """Takes it away, with all that waits."""
        super().destroy()
        self.depth = 0
        self._waiting = []
        self._answers = []

    def _send(self) -> None:
        """Sends what can be sent; an answer that is refused although there is room will never go."""
        answers = self._answers
        while answers and self.entity.room():
            identity, response = answers.pop(0)
            if not self.entity.reply(identity, response):
                self.lost += 1


class Client(Handle):
    """Made by ``Node.client``. ``malformed`` counts replies that are no response of this type."""

    malformed = 0

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

    def call(self, request: "Any", timeout: float = _TIMEOUT) -> "Any":
        """Sends a request and waits for its response; None when it does not come within ``timeout`` seconds.

        Not for callbacks: those run in an executor, where ``send`` belongs.
        """
        answers: "list[Any]" = []
        middleware = self.context.middleware
        end = ticks_add(self.context.clock(), int(timeout * 1000))
        sent = False
        while not answers:
            now = self.context.clock()
            left = ticks_diff(end, now)
            if left <= 0:
                return None
            middleware.spin_once(now)
            sent = sent or (self.entity.room() and self.send(request, answers.append, timeout))
            if self.ready(now):
                self.run(now)
            else:
                middleware.wait(min(left, middleware.deadline(now)))
        return answers[0]

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
        """Hands on a reply; ends the wait for requests that are too old."""
        if self._waiting:
            on_reply, response = self._waiting.pop(0)
            on_reply(response)
            return
        for number in list(self._asked):
            on_reply, end = self._asked[number]
            if ticks_diff(end, now) <= 0:
                del self._asked[number]
                on_reply(None)

    def left(self, now: int) -> int:
        """Milliseconds until the first request is too old."""
        left = _NEVER
        for number in self._asked:
            left = min(left, max(ticks_diff(self._asked[number][1], now), 0))
        return left

    def destroy(self) -> None:
        """Takes it away, with all that waits."""
        super().destroy()
        self._asked = {}
        self._waiting = []
