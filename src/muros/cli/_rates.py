"""`muros topic hz`, `bw` and `delay`: what a topic does in numbers, told once a second while it moves."""

from __future__ import annotations

import argparse
import math
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple, Protocol

from muros import interfaces
from muros.cli._echo import decoded, expression, reader_qos, tell_of_mismatches, type_to_read
from muros.cli._learn import make_known
from muros.cli._names import full_name, learn_types, required_class
from muros.cli._tool import CommandError, Subscription, Tool
from muros.space import Sample, Topic

__all__ = ["Bandwidth", "Delay", "Rate", "Spread", "measure", "spread"]

PERIOD: Final = 1.0
"""Seconds between two results."""


class Spread(NamedTuple):
    """A series of numbers in five."""

    mean: float
    low: float
    high: float
    deviation: float
    window: int

    def __str__(self) -> str:
        return f"\tmin: {self.low:.3f}s max: {self.high:.3f}s std dev: {self.deviation:.5f}s window: {self.window}"


def spread(values: Iterable[float]) -> Spread:
    """Mean, least, most, standard deviation (of the population) and number of `values`, at least one."""
    numbers = list(values)
    mean = math.fsum(numbers) / len(numbers)
    variance = math.fsum((v - mean) ** 2 for v in numbers) / len(numbers)
    return Spread(mean, min(numbers), max(numbers), math.sqrt(variance), len(numbers))


class Meter(Protocol):
    """What is measured of one topic."""

    def add(self, sample: Sample, now: float) -> None:
        """A sample came, at `now` (seconds of a clock that never goes back)."""

    def result(self, now: float) -> str | None:
        """What to tell, None if there is nothing new."""


class Rate:
    """How often samples come: over the last `window` intervals."""

    def __init__(self, window: int, wanted: Callable[[Sample], bool] | None = None) -> None:
        self.intervals: deque[float] = deque(maxlen=window)
        self._wanted = wanted
        self._last: float | None = None
        self._new = False

    def add(self, sample: Sample, now: float) -> None:
        """Count the interval since the sample before."""
        if self._wanted is not None and not self._wanted(sample):
            return
        if self._last is not None:
            self.intervals.append(now - self._last)
            self._new = True
        self._last = now

    def spread(self) -> Spread | None:
        """The intervals in numbers, None if there is nothing new."""
        if not self._new:
            return None
        self._new = False
        return spread(self.intervals)

    def result(self, now: float) -> str | None:
        """Average rate, least and longest interval."""
        seen = self.spread()
        return None if seen is None else f"average rate: {_rate(seen):.3f}\n{seen}"


class Bandwidth:
    """How many bytes come: over the last `window` samples."""

    def __init__(self, window: int) -> None:
        self._seen: deque[tuple[float, int]] = deque(maxlen=window)

    def add(self, sample: Sample, now: float) -> None:
        """Count its bytes, with the 4 of the encapsulation header as ROS 2 does."""
        self._seen.append((now, len(sample.data) + 4))

    def result(self, now: float) -> str | None:
        """Bytes per second up to now, and sizes."""
        if len(self._seen) < 2 or now <= self._seen[0][0]:
            return None
        sizes = [size for _, size in self._seen]
        rate = sum(sizes) / (now - self._seen[0][0])
        scale, unit = next((s, u) for s, u, below in _UNITS if rate < below)
        digits = 2 if scale > 1 else 0

        def shown(value: float) -> str:
            return f"{value / scale:.{digits}f} {unit}"

        mean = sum(sizes) / len(sizes)
        return (
            f"{shown(rate)}/s from {len(sizes)} messages\n"
            f"\tMessage size mean: {shown(mean)} min: {shown(min(sizes))} max: {shown(max(sizes))}"
        )


_UNITS: Final = ((1, "B", 1e3), (1e3, "KB", 1e6), (1e6, "MB", math.inf))


class Delay:
    """How old samples are when they come, by the stamp in their header: over the last `window` of them."""

    def __init__(self, window: int, made: type[Any]) -> None:
        if "header" not in made._FIELDS:
            raise CommandError(f"{made.TYPE} has no header, so it does not tell when it was made")
        self.delays: deque[float] = deque(maxlen=window)
        self._made = made
        self._new = False

    def add(self, sample: Sample, now: float) -> None:
        """Compare its stamp with the time of day."""
        stamp = decoded(self._made, sample).header.stamp
        self.delays.append((time.time_ns() - stamp.sec * 10**9 - stamp.nanosec) / 1e9)
        self._new = True

    def result(self, now: float) -> str | None:
        """Average, least and longest delay."""
        if not self._new:
            return "no new messages" if self.delays else None
        self._new = False
        seen = spread(self.delays)
        return f"average delay: {seen.mean:.3f}\n{seen}"


async def measure(what: str, tool: Tool, arguments: argparse.Namespace) -> None:
    """Measure the topics and tell each second, until there were enough results."""
    if arguments.window < 1:
        raise CommandError(f"--window {arguments.window}: take 1 or more", 2)
    learn_types(arguments)
    names = [full_name(name) for name in arguments.topic_name]
    meters: dict[str, Meter] = {}
    subscriptions: list[Subscription] = []
    for name in names:
        type_name = await type_to_read(tool, name, None)
        if what == "delay" or (what == "hz" and arguments.filter_expr):
            await make_known(tool, name, type_name)
        meter = meters[name] = _meter(what, type_name, arguments)
        topic = Topic(interfaces.dds_topic(name), interfaces.dds_type_name(type_name))
        subscription = tool.subscribe(topic, reader_qos(tool, name, arguments), _adder(meter))
        tell_of_mismatches(tool, subscription.reader.gid)
        subscriptions.append(subscription)
        if what == "bw" or len(names) > 1:
            tool.print(f"Subscribed to [{name}]")
    told = 0
    while arguments.times is None or told < arguments.times:
        await subscriptions[0].wait(PERIOD)
        for subscription in subscriptions[1:]:
            await subscription.wait(0)
        text = _table(meters) if len(meters) > 1 else meters[names[0]].result(time.monotonic())
        if text:
            told += 1
            tool.print(text)


def _meter(what: str, type_name: str, arguments: argparse.Namespace) -> Meter:
    if what == "bw":
        return Bandwidth(arguments.window)
    if what == "delay":
        return Delay(arguments.window, required_class(type_name))
    test = expression(arguments.filter_expr)
    if test is None:
        return Rate(arguments.window)
    made = required_class(type_name)
    return Rate(arguments.window, lambda sample: test(decoded(made, sample)))


def _adder(meter: Meter) -> Callable[[Sample], None]:
    return lambda sample: meter.add(sample, time.monotonic())


def _table(meters: dict[str, Meter]) -> str | None:
    """Several topics at once, a line for each that moved."""
    rows: list[tuple[str, ...]] = [("topic", "rate", "min_delta", "max_delta", "std_dev", "window")]
    for name, meter in meters.items():
        seen = meter.spread() if isinstance(meter, Rate) else None
        if seen is not None:
            numbers = (f"{v:.5f}" for v in (seen.low, seen.high, seen.deviation))
            rows.append((name, f"{_rate(seen):.3f}", *numbers, str(seen.window)))
    if len(rows) == 1:
        return None
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    lines.insert(1, "=" * len(lines[0]))
    return "\n".join(line.rstrip() for line in lines)


def _rate(seen: Spread) -> float:
    return 1 / seen.mean if seen.mean > 0 else 0.0
