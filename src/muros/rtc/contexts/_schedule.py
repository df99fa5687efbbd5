"""When passes are due: an absolute schedule, which late passes do not shift.

    schedule = Schedule(100.0)
    schedule.start(now)                  # the first pass is due at once
    ... wait until schedule.deadline ...
    schedule.begin(now); ...the pass...; schedule.end(now)

Pass n is due at origin + n / rate. A pass is missed when the one after it is due already before it could begin; missed
ones are left out, except for the last `catch_up`, which are run one right after the other. No clock: `now` is passed
in, in seconds, and never goes back.
"""

from __future__ import annotations

import math
from typing import Final

from muros.rtc.contexts._statistics import ContextStatistics, Spread, Window

__all__ = ["MOST_ANTICIPATED", "Anticipation", "Schedule"]

MOST_ANTICIPATED: Final = 200e-6
"""Seconds that a thread has itself woken too early at most: it spins for the rest, and others wait for it."""

_STEP: Final = 0.05
"""Share by which one wake-up corrects what is expected of the next."""
_LEAST_STEP: Final = 2e-6


class Schedule:
    """The passes of one context: due, run, missed.

    `rate` is in passes per second, more than 0; `catch_up`: missed passes that are made up for at most.
    """

    def __init__(self, rate: float, *, catch_up: int = 0, window: Window | None = None) -> None:
        if not is_rate(rate):
            raise ValueError(f"a rate of {rate!r}: it must be a number of passes per second, more than 0")
        if catch_up < 0:
            raise ValueError(f"catch_up is {catch_up}: it must be 0 or more")
        self.catch_up: Final = catch_up
        self.deadline = math.inf
        """When the next pass is due; never, while nobody is to be called."""
        self.rate = float(rate)
        """Passes per second wanted; changed by `set_rate`."""
        self._period = 1.0 / rate
        self._origin = 0.0
        self._index = 0
        self._begun = 0.0
        self._passes = 0
        self._missed = 0
        self._starts = window or Window()
        self._deviations = Window()
        self._durations = Window()

    @property
    def is_started(self) -> bool:
        """Whether passes are due at all."""
        return self.deadline != math.inf

    def start(self, now: float) -> None:
        """Passes are due from now on, the first at once. The rate reached is measured anew."""
        self._origin = self.deadline = now
        self._index = 0
        self._starts.clear()

    def stop(self) -> None:
        """No pass is due until the next `start`."""
        self.deadline = math.inf

    def set_rate(self, rate: float) -> None:
        """Another rate: the next pass is due one new period after the last one was."""
        if not is_rate(rate):
            raise ValueError(f"a rate of {rate!r}: it must be a number of passes per second, more than 0")
        if self.is_started:
            self._origin += max(0, self._index - 1) * self._period
            self._index = min(self._index, 1)
            self.deadline = self._origin + self._index / rate
        self.rate = float(rate)
        self._period = 1.0 / rate
        self._starts.clear()
        self._deviations.clear()

    def begin(self, now: float) -> None:
        """A pass begins."""
        self._begun = now
        self._starts.add(now)
        if self.is_started:
            self._deviations.add(now - self.deadline)

    def end(self, now: float) -> None:
        """The pass that began last is over: from now on, `deadline` is the next one's."""
        self._passes += 1
        self._durations.add(now - self._begun)
        if self.is_started:
            due = math.floor((now - self._origin) / self._period)
            following = max(self._index + 1, due - self.catch_up)
            self._missed += following - self._index - 1
            self._index = following
            self.deadline = self._origin + following * self._period

    def statistics(self, collapsed: int = 0) -> ContextStatistics:
        """What has been measured; callable from any thread."""
        starts = self._starts.values()
        span = starts[-1] - starts[0] if len(starts) > 1 else 0.0
        return ContextStatistics(
            passes=self._passes,
            missed=self._missed,
            collapsed=collapsed,
            rate=(len(starts) - 1) / span if span > 0 else 0.0,
            deviation=Spread.of(self._deviations.values()),
            duration=Spread.of(self._durations.values()),
        )


class Anticipation:
    """How late the system wakes a thread: the median of what it did lately, so that the thread can ask for it earlier.

    `seconds` says by how much; after half of the wake-ups a little time is left, which the thread spins away.
    """

    __slots__ = ("_known", "seconds")

    def __init__(self) -> None:
        self.seconds = 0.0
        self._known = False

    def learn(self, late: float) -> None:
        """A thread that was to be woken at some moment ran `late` seconds after it."""
        if self._known:
            step = self.seconds * _STEP + _LEAST_STEP
            wanted = self.seconds + (step if late > self.seconds else -step)
        else:
            wanted, self._known = late, True
        self.seconds = min(max(wanted, 0.0), MOST_ANTICIPATED)


def is_rate(rate: object) -> bool:
    """Whether contexts can run at it: a finite number of more than 0 passes per second."""
    return isinstance(rate, (int, float)) and math.isfinite(rate) and rate > 0 and math.isfinite(1.0 / rate)
