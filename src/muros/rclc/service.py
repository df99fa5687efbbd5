"""Services: servers and clients."""

from muros.compat import const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Context
    from muros.xrce._types import Buffer

_NEVER = const(1000000)
_TIMEOUT = 10.0


class Service:
    """Made by ``Node.service``. An executor calls ``callback(request)`` and sends the response that it returns.

    A callback that returns None answers later: it keeps ``service.identity`` and calls ``reply(identity, response)``.
    ``malformed`` counts samples that are no request of this type.
    """

    eager = True
    identity = b""
    malformed = 0

    def __init__(self, context: "Context", kind: "Any", callback: "Callable[[Any], Any]") -> None:
        self.context = context
        self.callback = callback
        self.entity: "Any" = None
        self._kind = kind
        self._waiting: "list[tuple[bytes, Any]]" = []
        self._answers: "list[tuple[bytes, Any]]" = []  # those for which the window had no room
        context.handles.append(self)

    def reply(self, identity: bytes, response: "Any") -> None:
        """Answers a request; one that cannot go out now goes with the next pass."""
        if self._answers or not self.entity.reply(identity, response):
            self._answers.append((identity, response))

    def deliver(self, identity: bytes, buf: "Buffer", off: int, n: int) -> None:
        """Takes a request of the middleware."""
        request = self._kind.Request()
        try:
            request.read(buf, off, n)
        except ValueError:
            self.malformed += 1
            return
        self._waiting.append((identity, request))

    def ready(self, now: int) -> bool:
        """Whether a request waits, or an answer."""
        return len(self._waiting) + len(self._answers) > 0

    def run(self, now: int) -> None:
        """Takes a request, calls the callback and answers."""
        while self._answers and self.entity.reply(self._answers[0][0], self._answers[0][1]):
            self._answers.pop(0)
        if self._waiting:
            identity, request = self._waiting.pop(0)
            self.identity = identity
            response = self.callback(request)
            if response is not None:
                self.reply(identity, response)

    def left(self, now: int) -> int:
        """It never becomes ready of its own accord."""
        return _NEVER

    def destroy(self) -> None:
        """Takes it away."""
        if self in self.context.handles:
            self.context.handles.remove(self)
        self.entity.destroy()


class Client:
    """Made by ``Node.client``. ``malformed`` counts replies that are no response of this type."""

    eager = True
    malformed = 0

    def __init__(self, context: "Context", kind: "Any") -> None:
        self.context = context
        self.entity: "Any" = None
        self._kind = kind
        self._asked: "dict[int, tuple[Any, int]]" = {}  # number: (on_reply, deadline)
        self._waiting: "list[tuple[Any, Any]]" = []
        context.handles.append(self)

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
            sent = sent or self.send(request, answers.append, timeout)
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
        """Takes it away."""
        if self in self.context.handles:
            self.context.handles.remove(self)
        self.entity.destroy()
