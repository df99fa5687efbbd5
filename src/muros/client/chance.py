"""Random bytes, on boards with and without a source of entropy."""

from muros.compat import ticks_us


def draw(n: int) -> bytes:
    """``n`` random bytes, 4 at most."""
    try:
        from os import urandom

        return urandom(n)
    except (ImportError, OSError):  # a build without a source: the time since power-on has to do
        return ticks_us().to_bytes(8, "little")[:n]
