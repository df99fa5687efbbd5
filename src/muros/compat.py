"""Every difference between CPython and MicroPython that the board floor meets, in one place.

The modules of the board floor import from here and nowhere ask which interpreter runs them.

Time on the board floor is counted in *ticks*: integer milliseconds that wrap on boards, so they are only ever
compared with :func:`ticks_diff` and moved with :func:`ticks_add`.
"""

import sys

MPY = sys.implementation.name == "micropython"

if MPY:
    from time import sleep_ms, ticks_add, ticks_diff, ticks_ms, ticks_us  # type: ignore[attr-defined]

    from micropython import const  # type: ignore[import-not-found]

    def copy(target, at, source, start, n):  # type: ignore[no-untyped-def]
        """Copies ``n`` bytes; a part of the source would be allocated on the heap first."""
        if start == 0 and n == len(source):
            target[at : at + n] = source
        else:
            for i in range(n):
                target[at + i] = source[start + i]

    try:
        from os import urandom
    except ImportError:  # a build without a source of entropy: the time since power-on has to do

        def urandom(n):  # type: ignore[no-untyped-def]
            return bytes([ticks_us() >> (3 * i) & 255 for i in range(n)])

else:
    import time
    from os import urandom as urandom

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

    def copy(
        target: bytearray, at: int, source: "bytes | bytearray | memoryview", start: int, n: int
    ) -> None:
        """Copies ``n`` bytes of ``source`` from ``start`` into ``target`` at ``at``."""
        target[at : at + n] = source[start : start + n]
