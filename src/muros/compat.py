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
    from uctypes import addressof, bytearray_at  # type: ignore[import-not-found]

    def as_bytes(values):  # type: ignore[no-untyped-def]
        """A byte view that aliases the storage of an array, without copying."""
        return bytearray_at(addressof(values), len(values) * _item_size(values))

    def _item_size(values):  # type: ignore[no-untyped-def]
        text = repr(values)  # array('d', ...): boards have no itemsize attribute
        if not text.startswith("array("):
            return 1
        return {"b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4, "l": 4, "L": 4, "f": 4}.get(text[7], 8)

    def copy(target, at, source, start, n):  # type: ignore[no-untyped-def]
        """Copies ``n`` bytes; a slice would allocate them on the heap first."""
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

    def as_bytes(values: object) -> memoryview:
        """A byte view that aliases the storage of an array or buffer, without copying."""
        return memoryview(values).cast("B")  # type: ignore[arg-type]

    def copy(
        target: bytearray, at: int, source: "bytes | bytearray | memoryview", start: int, n: int
    ) -> None:
        """Copies ``n`` bytes of ``source`` from ``start`` into ``target`` at ``at``."""
        target[at : at + n] = source[start : start + n]
