"""Subscriptions: what has come waits here until an executor takes it."""

from muros.compat import const
from muros.rclc.executor import Handle

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Context
    from muros.xrce._types import Buffer


class Subscription(Handle):
    """Made by ``Node.subscription``. One message waits, on hosts as many as the depth of the QoS, see ``host.context``.

    When one more comes, an executor that only waits for new data has the oldest processed at once, so none is lost;
    with a trigger or LET the oldest is dropped and counted in ``lost``. ``malformed`` counts samples that are no
    message of this type.
    """

    lost = 0
    malformed = 0
    _waits = False

    if TYPE_CHECKING:
        refused: int  # samples beyond the rules for memory, where there are some, see ``memory``

    def __init__(self, context: "Context", kind: "Any", callback: "Callable[[Any], object] | None") -> None:
        self.context = context
        self.callback = callback
        self._message = kind()

    def take(self) -> "Any":
        """The oldest message that waits, or None."""
        if self._waits:
            self._waits = False
            return self._message
        return None

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a sample of the middleware."""
        if self._waits:
            if self.eager:
                self.run(0)
            else:
                self._waits = False
                self.lost += 1
        try:
            self._message.read(buf, off, n)
            self._waits = True
        except ValueError:
            self.malformed += 1

    def ready(self, now: int) -> bool:
        """Whether a message waits."""
        return self._waits

    def run(self, now: int) -> None:
        """Takes a message and calls the callback."""
        message = self.take()
        if self.callback is not None:
            self.callback(message)
