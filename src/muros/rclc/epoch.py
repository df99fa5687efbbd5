"""The time since 1970: through an agent that of the agent, straight in a data space that of the computer.

epoch = Epoch(context)
epoch.sync()
log = node.logger(time=epoch.time)
"""

from muros.client.timesync import TimeSync
from muros.compat import MPY, borrow, const, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

_THOUSAND = const(1000)
_MILLION = const(1_000_000)
_BILLION = const(1_000_000_000)


class Epoch:
    """The time of a context. ``clock`` is the ``TimeSync`` of its session, None straight in a data space."""

    def __init__(self, context: "Any") -> None:
        self.context = context
        session: "Any" = context.middleware
        self.clock = TimeSync(session) if hasattr(session, "objects") else None

    def sync(self, timeout: float = 1.0) -> bool:
        """Asks the agent for its time; whether it has answered within ``timeout`` seconds. Not for callbacks.

        Asking again now and then keeps what is known exact; the best of the last answers counts.
        """
        clock = self.clock
        if clock is None:
            return True
        ticks = self.context.clock
        session = self.context.middleware
        start = ticks()
        left = most = int(timeout * _THOUSAND)
        asked = False
        while left > 0:
            session.spin_once(ticks())
            if not asked and session.up and not session.away:
                clock.request()
                asked = True
            elif asked and clock._asked is None:
                return clock.synchronized()
            session.wait(min(left, session.deadline(ticks())))
            left = most - ticks_diff(ticks(), start)
        return False

    @property
    def synchronized(self) -> bool:
        """Whether the time is known."""
        return self.clock is None or self.clock.synchronized()

    def time(self) -> "tuple[int, int]":
        """Seconds and nanoseconds; (0, 0) before they are known. What loggers and lifecycles take as their ``time``."""
        if self.clock is not None:
            return self.clock.time()
        if MPY:
            return (0, 0)
        now: "tuple[int, int]" = borrow("muros.rclc.host.logger").system_time()
        return now

    def millis(self) -> int:
        """The time in milliseconds, 0 before it is known."""
        seconds, nanoseconds = self.time()
        return seconds * _THOUSAND + nanoseconds // _MILLION

    def nanos(self) -> int:
        """The time in nanoseconds, 0 before it is known."""
        seconds, nanoseconds = self.time()
        return seconds * _BILLION + nanoseconds
