"""What MicroPython has and CPython lacks, for ``compat``."""

import time
from os import urandom

__all__ = ["const", "copy", "sleep_ms", "ticks_add", "ticks_diff", "ticks_ms", "ticks_us", "urandom"]


def const(value: int) -> int:
    """Marks a module constant; MicroPython folds ``_NAME = const(n)`` away at compile time."""
    return value


def ticks_ms() -> int:
    """Monotonic milliseconds; boards wrap them, hosts do not."""
    return time.monotonic_ns() // 1_000_000


def ticks_us() -> int:
    """Monotonic microseconds; boards wrap them, hosts do not."""
    return time.monotonic_ns() // 1_000


def sleep_ms(ms: int) -> None:
    """Sleeps so many milliseconds."""
    time.sleep(ms / 1000)


def ticks_add(ticks: int, delta: int) -> int:
    """The tick ``delta`` milliseconds after ``ticks``."""
    return ticks + delta


def ticks_diff(later: int, earlier: int) -> int:
    """Milliseconds from ``earlier`` to ``later``, negative when ``later`` lies before."""
    return later - earlier


def copy(target: bytearray, at: int, source: bytes | bytearray | memoryview, start: int, n: int) -> None:
    """Copies ``n`` bytes of ``source`` from ``start`` into ``target`` at ``at``."""
    target[at : at + n] = source[start : start + n]
