"""Simulated time: what /clock says, and timers that go by it.

    time = RosTime(node)
    time.timer(0.1, step)                       # each tenth of a simulated second
    node.logger(time=time.now)

Timers of ``Node.timer``, timeouts and everything else go by the steady clock still.
"""

from muros.compat import const, ticks_add
from muros.rclc.timer import Timer

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Node

_NEVER = const(1000000)
_MILLION = const(1000000)
_DAYS = const(500000)  # seconds; further ahead boards cannot tell from back


class RosTime:
    """The time of /clock, which a simulator or the player of a recording publishes. 0 until something has come.

    ``known`` tells whether something has. When time jumps back, as where a recording begins again, or days ahead,
    timers begin a new period; ``jumps`` counts that. Made in the node's context, whose executor has to run
    ``subscription``.
    """

    def __init__(self, node: "Node", kind: "Any" = None) -> None:
        if kind is None:
            kind = clock_class()
        self.node = node
        self.known = False
        self.jumps = 0
        self.timers: "list[RosTimer]" = []
        self._seconds = 0
        self._nanoseconds = 0
        self._origin = 0  # seconds at which ticks are 0
        self.subscription = node.subscription(kind, "/clock", self._on_clock, "sensor_data")

    def now(self) -> "tuple[int, int]":
        """Seconds and nanoseconds."""
        return self._seconds, self._nanoseconds

    def ticks(self) -> int:
        """Milliseconds since time was first known; like all ticks they begin again some time on boards."""
        passed = (self._seconds - self._origin) * 1000 + self._nanoseconds // _MILLION
        return passed & ticks_add(0, -1)

    def timer(self, period: float, callback: "Callable[[], object]", autostart: bool = True) -> "RosTimer":
        """A timer that goes by this time; arguments as for ``Node.timer``."""
        made = RosTimer(self, period, callback, autostart)
        self.timers.append(made)
        self.node.context.handles.append(made)
        self.node.entities.append(made)
        return made

    def _on_clock(self, message: "Any") -> None:
        """Time goes on."""
        before = self.now()
        self._seconds, self._nanoseconds = message.clock.sec, message.clock.nanosec
        if not self.known:
            self.known = True
            self._origin = self._seconds
        elif self.now() >= before and self._seconds - before[0] < _DAYS:
            return
        else:
            self.jumps += 1
        for timer in self.timers:
            timer.begin_anew()


class RosTimer(Timer):
    """Made by ``RosTime.timer``; see ``Timer``. It is still until time is known."""

    def __init__(
        self, time: RosTime, period: float, callback: "Callable[[], object]", autostart: bool
    ) -> None:
        super().__init__(time.node.context, period, callback, autostart)
        self._time = time
        self.begin_anew()

    def begin_anew(self) -> None:
        """Begins a new period now, if it runs."""
        now = self._time.ticks()
        self._last = now
        self._next = ticks_add(now, self.period)

    def reset(self, now: "int | None" = None) -> None:
        """Starts a new period now."""
        self.cancelled = False
        self.begin_anew()

    def run(self, now: int) -> None:
        """Calls the callback and sets the next time."""
        super().run(self._time.ticks())

    def left(self, now: int) -> int:
        """Milliseconds until its time comes: what brings it is a message."""
        return 0 if self._time.known and super().left(self._time.ticks()) == 0 else _NEVER


def clock_class() -> "Any":
    """The class of what /clock says."""
    from muros.compat import MPY, borrow

    if MPY:
        return __import__("rosgraph_msgs.msg", None, None, ("Clock",)).Clock
    return borrow("muros.interfaces").message("rosgraph_msgs/msg/Clock")
