"""Subscriptions: what has come waits here until an executor takes it."""

from muros.client.qos import profile
from muros.compat import MPY, const
from muros.rclc.executor import Handle

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client.qos import Qos
    from muros.rclc.context import Context
    from muros.xrce._types import Buffer


class Subscription(Handle):
    """Made by ``Node.subscription``. Up to ``depth`` messages wait: the QoS's depth on hosts, one on boards.

    When one more comes, an executor that only waits for new data has the oldest processed at once, so none is lost;
    with a trigger or LET the oldest is dropped and counted in ``lost``. ``malformed`` counts samples that are no
    message of this type.
    """

    lost = 0
    malformed = 0

    def __init__(
        self, context: "Context", kind: "Any", callback: "Callable[[Any], object] | None", qos: "str | Qos"
    ) -> None:
        super().__init__(context)
        self.callback = callback
        self.depth = 1 if MPY else profile(qos).depth or 1000
        self._kind = kind
        self._waiting: "list[Any]" = []
        self._message = kind()

    def take(self) -> "Any":
        """The oldest message that waits, or None."""
        return self._waiting.pop(0) if self._waiting else None

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a sample of the middleware."""
        waiting = self._waiting
        if len(waiting) >= self.depth:
            if self.eager:
                self.run(0)
            else:
                waiting.pop(0)
                self.lost += 1
        try:
            self._message.read(buf, off, n)
        except ValueError:
            self.malformed += 1
            return
        waiting.append(self._message)
        if not MPY:
            self._message = self._kind()

    def ready(self, now: int) -> bool:
        """Whether a message waits."""
        return len(self._waiting) > 0

    def run(self, now: int) -> None:
        """Takes a message and calls the callback."""
        message = self._waiting.pop(0)
        if self.callback is not None:
            self.callback(message)
