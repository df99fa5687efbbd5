"""Every difference between CPython and MicroPython that the board floor meets, in one place.

The modules of the board floor import from here and nowhere ask which interpreter runs them. What CPython lacks is in
``_host``, which boards never load.

Time on the board floor is counted in *ticks*: integer milliseconds that wrap on boards, so they are only ever
compared with :func:`ticks_diff` and moved with :func:`ticks_add`.
"""

import sys

MPY = sys.implementation.name == "micropython"

if MPY:
    from time import (  # type: ignore[attr-defined]
        sleep_ms,  # noqa: F401
        ticks_add,  # noqa: F401
        ticks_diff,  # noqa: F401
        ticks_ms,  # noqa: F401
        ticks_us,
    )

    from micropython import const  # type: ignore[import-not-found] # noqa: F401

    def copy(target, at, source, start, n):  # type: ignore[no-untyped-def]
        """Copies ``n`` bytes; a part of the source would be allocated on the heap first."""
        if start == 0 and n == len(source):
            target[at : at + n] = source
        else:
            while n:
                n -= 1
                target[at + n] = source[start + n]

    try:
        from os import urandom
    except ImportError:  # a build without a source of entropy: the time since power-on has to do

        def urandom(n):  # type: ignore[no-untyped-def]
            return ticks_us().to_bytes(4, "little")[:n]

else:
    from muros._host import *  # noqa: F403
