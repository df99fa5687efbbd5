"""Lifespan on hosts: what has waited longer than the QoS says is dropped and counted before a callback sees it.

A writer's lifespan ends a sample wherever it is in a data space; this one is the reader's own, for what waits in the
program: because a trigger does not let it through, or the executor is busy.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

from muros.client.qos import profile
from muros.rclc.host.entities import Service
from muros.rclc.host.handles import Subscription
from muros.rclc.lifespans import drop

if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.client.qos import Qos
    from muros.rclc.context import Context
    from muros.xrce._types import Buffer

__all__ = ["ExpiringService", "ExpiringSubscription"]


class ExpiringSubscription(Subscription):
    """A subscription whose QoS has a lifespan. ``expired`` counts what was dropped for that."""

    def __init__(
        self, context: Context, kind: Any, callback: Callable[[Any], object] | None, qos: str | Qos
    ) -> None:
        super().__init__(context, kind, callback, qos)
        self.expired = 0
        self._lifespan = profile(qos).lifespan
        self._since: deque[int] = deque()
        """When each message that waits has come."""

    def take(self) -> Any:
        """The oldest message that waits, or None."""
        self._drop(self.context.clock())
        return super().take()

    def ready(self, now: int) -> bool:
        """Whether a message waits."""
        self._drop(now)
        return super().ready(now)

    def run(self, now: int) -> None:
        """Takes a message, or None when nothing waits, and calls the callback."""
        self._drop(self.context.clock())
        super().run(now)

    def deliver(self, buf: Buffer, off: int, n: int) -> None:
        """Takes a sample of the middleware."""
        now = self.context.clock()
        self._drop(now)
        before = self.malformed
        super().deliver(buf, off, n)
        if self.malformed == before:
            self._since.append(now)

    def _drop(self, now: int) -> None:
        self.expired += drop(self._since, self._waiting, self._lifespan, now)


class ExpiringService(Service):
    """A service whose QoS has a lifespan: requests that have waited for longer are not answered."""

    def __init__(self, context: Context, kind: Any, callback: Callable[[Any], Any], qos: str | Qos) -> None:
        super().__init__(context, kind, callback)
        self.expired = 0
        self._lifespan = profile(qos).lifespan
        self._since: deque[int] = deque()

    def ready(self, now: int) -> bool:
        """Whether a request can be taken, or an answer sent."""
        self._drop(now)
        return super().ready(now)

    def run(self, now: int) -> None:
        """Takes a request, calls the callback and answers."""
        self._drop(self.context.clock())
        super().run(now)

    def deliver(self, identity: bytes, buf: Buffer, off: int, n: int) -> None:
        """Takes a request of the middleware."""
        now = self.context.clock()
        self._drop(now)
        before = len(self._waiting)
        super().deliver(identity, buf, off, n)
        if len(self._waiting) > before:
            self._since.append(now)

    def _drop(self, now: int) -> None:
        self.expired += drop(self._since, self._waiting, self._lifespan, now)
