"""What a context measures of itself: how often it runs, how late, how long."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

__all__ = ["WINDOW", "ContextStatistics", "Spread", "Window"]

WINDOW: Final = 4096
"""Passes that the statistics look back on: 4 s at 1 kHz, 32 kB for each kind of value."""


@dataclass(frozen=True, slots=True)
class Spread:
    """How values are spread, in seconds; all 0 where there were none."""

    p50: float = 0.0
    p99: float = 0.0
    max: float = 0.0

    @classmethod
    def of(cls, values: Iterable[float]) -> Spread:
        """The spread of some values: nearest ranks."""
        ordered = sorted(values)
        if not ordered:
            return cls()
        last = len(ordered) - 1
        return cls(ordered[round(last * 0.5)], ordered[round(last * 0.99)], ordered[last])


@dataclass(frozen=True, slots=True)
class ContextStatistics:
    """A context's passes, as of the moment it was asked."""

    passes: int = 0
    """Since it was made."""
    missed: int = 0
    """Passes that were due but left out, as those before them took too long or the system did not run the thread."""
    collapsed: int = 0
    """Ticks that came while one waited already, and so made no pass of their own."""
    rate: float = 0.0
    """Passes per second reached, over the window; 0 before there are two."""
    deviation: Spread = Spread()
    """How late passes began behind the schedule, over the window."""
    duration: Spread = Spread()
    """How long the callbacks of a pass took, over the window."""


class Window:
    """The last `size` values, in memory taken at once."""

    __slots__ = ("_count", "_size", "_values")

    def __init__(self, size: int = WINDOW) -> None:
        if size < 1:
            raise ValueError(f"a window of {size} values: it must have at least 1")
        self._values = array("d", bytes(8 * size))
        self._size = size
        self._count = 0

    def add(self, value: float) -> None:
        """Remember a value, in place of the oldest when the window is full."""
        self._values[self._count % self._size] = value
        self._count += 1

    def clear(self) -> None:
        """Forget all."""
        self._count = 0

    def values(self) -> list[float]:
        """Those remembered, oldest first."""
        if self._count <= self._size:
            return list(self._values[: self._count])
        split = self._count % self._size
        return list(self._values[split:]) + list(self._values[:split])
