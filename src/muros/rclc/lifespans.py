"""Lifespan: what has waited for longer than the QoS says is dropped and counted before a callback sees it.

A writer's lifespan ends a sample wherever it is in a data space; this one is the reader's own, for what waits in the
program: because a trigger does not let it through, or the executor is busy. Hosts, where more may wait, have theirs in
``host.expiry``.
"""

from muros.compat import const, ticks_diff
from muros.rclc.service import Service
from muros.rclc.subscription import Subscription

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Context
    from muros.xrce._types import Buffer


class ExpiringSubscription(Subscription):
    """A subscription whose QoS has a lifespan. ``expired`` counts what was dropped for that."""

    expired = 0
    _since = 0

    def __init__(
        self, context: "Context", kind: "Any", callback: "Callable[[Any], object] | None", lifespan: int
    ) -> None:
        super().__init__(context, kind, callback)
        self._lifespan = lifespan

    def take(self) -> "Any":
        """The message that waits, or None."""
        return super().take() if self.ready(self.context.clock()) else None

    def ready(self, now: int) -> bool:
        """Whether a message waits."""
        if self._waits and ticks_diff(now, self._since) >= self._lifespan:
            self._waits = False
            self.expired += 1
        return self._waits

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a sample of the middleware."""
        now = self.context.clock()
        self.ready(now)
        super().deliver(buf, off, n)
        self._since = now


class ExpiringService(Service):
    """A service whose QoS has a lifespan: requests that have waited for longer are not answered."""

    expired = 0

    def __init__(
        self, context: "Context", kind: "Any", callback: "Callable[[Any], Any]", lifespan: int
    ) -> None:
        super().__init__(context, kind, callback)
        self._lifespan = lifespan
        self._since: "list[int]" = []  # when each request that waits has come

    def ready(self, now: int) -> bool:
        """Whether a request can be taken, or an answer sent."""
        self.expired += drop(self._since, self._waiting, self._lifespan, now)
        return super().ready(now)

    def deliver(self, identity: bytes, buf: "Buffer", off: int, n: int) -> None:
        """Takes a request of the middleware."""
        now = self.context.clock()
        self.ready(now)
        super().deliver(identity, buf, off, n)
        if len(self._waiting) > len(self._since):
            self._since.append(now)


def expiring(handle: "Any", lifespan: int) -> "Any":
    """What makes handles of the class here that stands in place of ``Subscription`` or ``Service``."""
    made = ExpiringService if handle is Service else ExpiringSubscription
    return lambda context, kind, callback: made(context, kind, callback, lifespan)


def drop(since: "Any", waiting: "Any", lifespan: int, now: int) -> int:
    """Drops from ``waiting`` what has been there for ``lifespan`` ms or more, and returns how many.

    ``since`` has the ticks at which things have come, those of what was taken meanwhile first.
    """
    count = 0
    while len(since) > len(waiting):
        del since[0]
    while since and ticks_diff(now, since[0]) >= lifespan:
        del since[0]
        del waiting[0]
        count += 1
    return count
