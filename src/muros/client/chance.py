"""Random numbers, on boards with and without a source of entropy."""

from muros.compat import ticks_us


def draw() -> int:
    """A random number of 32 bits."""
    try:
        from os import urandom

        return int.from_bytes(urandom(4), "big")
    except (ImportError, OSError):  # a board without a source: the time since power-on, 30 bits, has to do
        return ticks_us()
