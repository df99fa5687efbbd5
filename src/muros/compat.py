"""Every difference between CPython and MicroPython that the board floor meets, in one place.

The modules of the board floor import from here and nowhere ask which interpreter runs them. What CPython lacks is in
``_host``, which boards never load.

Time on the board floor is counted in *ticks*: integer milliseconds that wrap on boards, so they are only ever
compared with :func:`ticks_diff` and moved with :func:`ticks_add`.

A board keeps in memory what runs for each message and each turn while it is connected. The rest, what makes, connects,
mends and closes, is *borrowed*: :func:`borrow` imports a module, :func:`release` forgets all that were borrowed and
what they imported at their top, so that their memory is free again unless somebody holds on to them, as an object of
one of their classes does. With :func:`lending` an object has methods that live in a borrowed module. On hosts borrowing
is importing.
"""

from sys import implementation, modules

MPY = implementation.name == "micropython"

if MPY:
    from gc import collect
    from time import (  # type: ignore[attr-defined]
        sleep_ms,  # noqa: F401
        ticks_add,  # noqa: F401
        ticks_diff,  # noqa: F401
        ticks_ms,  # noqa: F401
        ticks_us,  # noqa: F401
    )

    from micropython import const  # type: ignore[import-not-found] # noqa: F401

    loans: "list[str]" = []

    def borrow(name):  # type: ignore[no-untyped-def]
        """A module, until ``release``."""
        if name not in modules:
            collect()
            known = set(modules)
            __import__(name)
            for other in modules:
                if other not in known and other.startswith("muros."):
                    loans.append(other)
        return modules[name]

    def release():  # type: ignore[no-untyped-def]
        """Forgets what was borrowed."""
        while loans:
            name = loans.pop()
            del modules[name]
            package, name = name.rsplit(".", 1)
            delattr(modules[package], name)

    def lend(owner, module, name):  # type: ignore[no-untyped-def]
        """``owner``'s method ``name``: a function of a borrowed module, which takes ``owner`` first."""
        method = getattr(borrow(module), name)
        return lambda *given, **named: method(owner, *given, **named)

    def lending(owner, name):  # type: ignore[no-untyped-def]
        """``__getattr__`` of a class that has the functions of the module ``lends`` as methods."""
        return lend(owner, owner.lends, name)

    def copy(target, at, source, start, n):  # type: ignore[no-untyped-def]
        """Copies ``n`` bytes; a part of the source would be allocated on the heap first."""
        if start == 0 and n == len(source):
            target[at : at + n] = source
        else:
            while n:
                n -= 1
                target[at + n] = source[start + n]

else:
    from muros._host import *  # noqa: F403
