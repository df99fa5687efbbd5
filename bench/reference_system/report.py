"""What the reference system is judged by, and how it is said."""

import math
from dataclasses import dataclass, field

from bench.reference_system.message import Message
from bench.reference_system.topology import HOT_PATH, HOT_PATH_ROOTS, HOT_PATH_SINK, PLANNER

__all__ = ["WARM_UP", "Measures", "Statistic"]

WARM_UP = 10
"""The first sample of a command node that counts."""

_MS = 1e6


@dataclass
class Statistic:
    """Values one by one: the last, least, greatest, average and deviation (Welford's way, of n - 1)."""

    count: int = 0
    last: float = 0.0
    least: float = math.inf
    greatest: float = -math.inf
    average: float = 0.0
    _squares: float = 0.0

    def add(self, value: float) -> None:
        """Takes a value."""
        self.count += 1
        self.last = value
        self.least = min(self.least, value)
        self.greatest = max(self.greatest, value)
        off = value - self.average
        self.average += off / self.count
        self._squares += off * (value - self.average)

    @property
    def deviation(self) -> float:
        """The standard deviation; 0 of fewer than two values."""
        return math.sqrt(self._squares / (self.count - 1)) if self.count > 1 else 0.0

    def line(self, unit: str = "", digits: int = 3) -> str:
        """``LAST [min=..., max=..., average=..., deviation=...]``, each with its unit."""
        if not self.count:
            return "no samples"

        def said(value: float) -> str:
            return f"{value:.{digits}f}".rstrip("0").rstrip(".") + unit

        return (
            f"{said(self.last)} [min={said(self.least)}, max={said(self.greatest)}, "
            f"average={said(self.average)}, deviation={said(self.deviation)}]"
        )


@dataclass
class Measures:
    """What came of a run. Times in ms."""

    latency: Statistic = field(default_factory=Statistic)
    """From the newest lidar sample to the estimate of collisions."""
    drops: Statistic = field(default_factory=Statistic)
    """Samples that the nodes of the hot path had missed, for each that came through."""
    period: Statistic = field(default_factory=Statistic)
    """Between two outputs of the planner."""
    latencies: list[tuple[float, float]] = field(default_factory=list)
    """(seconds since the first, ms) of each latency."""
    periods: list[tuple[float, float]] = field(default_factory=list)
    missed: int = 0
    """Samples that nodes with one input missed; fusions leave some by their nature."""
    front_sent: int = 0
    front_through: int = 0
    """Front lidar samples that reached the estimate."""
    _fronts: set[int] = field(default_factory=set)
    _planned: tuple[int, int] | None = None
    _first: int | None = None
    _commands: int = 0

    def estimated(self, message: Message) -> None:
        """The sink of the hot path has published."""
        front = message.find(HOT_PATH_ROOTS[0])
        if front is not None and front.sequence not in self._fronts:
            self._fronts.add(front.sequence)
            self.front_through += 1

    def commanded(self, message: Message) -> None:
        """A command node has got a sample that went through the planner."""
        self._commands += 1
        if self._commands < WARM_UP:
            return
        roots = [entry.stamp for name in HOT_PATH_ROOTS if (entry := message.find(name)) is not None]
        sink, planner = message.find(HOT_PATH_SINK), message.find(PLANNER)
        if self._first is None:
            self._first = message.entries[-1].stamp
        at = (message.entries[-1].stamp - self._first) / 1e9
        if sink is not None and roots:
            self.latency.add((sink.stamp - max(roots)) / _MS)
            self.latencies.append((at, self.latency.last))
            self.drops.add(sum(entry.missed for entry in message.entries if entry.name in HOT_PATH))
        if planner is not None:
            if self._planned is not None and planner.sequence > self._planned[1]:
                stamp, sequence = self._planned
                self.period.add((planner.stamp - stamp) / _MS / (planner.sequence - sequence))
                self.periods.append((at, self.period.last))
            self._planned = planner.stamp, planner.sequence

    def lines(self) -> list[str]:
        """The report, in the words of the reference system."""
        return [
            f"hot path: {' -> '.join(HOT_PATH)}",
            f"hot path latency: {self.latency.line('ms')}",
            f"hot path drops: {self.drops.line()}",
            f"behavior planner period: {self.period.line('ms')}",
        ]
