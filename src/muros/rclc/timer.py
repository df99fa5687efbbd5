"""Timers, in whole milliseconds of the steady clock."""

from muros.compat import const, ticks_add, ticks_diff
from muros.rclc.executor import Handle

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.rclc import handles
    from muros.rclc.context import Context

_NEVER = const(1000000)


class Timer(Handle):
    """Made by ``Node.timer``. Calls that come late do not shift the next: the phase is kept, whole periods that were
    missed are skipped. A period of 0 is always ready. ``since`` is the time from the last call to this one, in ms.
    """

    since = 0

    if TYPE_CHECKING:
        exchange_period = handles.exchange_period

    def __init__(
        self, context: "Context", period: float, callback: "Callable[[], object]", autostart: bool
    ) -> None:
        self.context = context
        self.callback = callback
        self.period = int(period * 1000 + 0.5)
        self.cancelled = not autostart
        self._last = now = context.clock()
        self._next = ticks_add(now, self.period)

    def cancel(self) -> None:
        """Stops it, until ``reset``."""
        self.cancelled = True

    def reset(self, now: "int | None" = None) -> None:
        """Starts a new period at the tick ``now``."""
        self.cancelled = False
        self._next = ticks_add(self.context.clock() if now is None else now, self.period)

    def run(self, now: int) -> None:
        """Calls the callback and sets the next time."""
        period = self.period
        self.since = ticks_diff(now, self._last)
        self._last = now
        self._next = ticks_add(now, period - ticks_diff(now, self._next) % (period or 1))
        self.callback()

    def left(self, now: int) -> int:
        """Milliseconds until its time comes."""
        return _NEVER if self.cancelled else max(ticks_diff(self._next, now), 0)
