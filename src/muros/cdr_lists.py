"""CDR for boards: sequences of numbers; see :mod:`muros.cdr` and :mod:`muros.cdr_texts`.

A ``code`` is one of ``struct`` and ``array``; ``B`` stands for bytes and ``?`` for a list of bools.
"""

from array import array
from struct import pack_into

from muros.cdr import block
from muros.cdr_texts import count, pad, part, put_count
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any


def numbers(at: "list[Any]", code: str, size: int, bound: int = 0) -> "Any":
    """The next sequence of numbers, of ``size`` bytes each, as an array, bytes or a list of bools."""
    n = count(at, size, bound) * size
    p = part(at, size, n) if n else 0
    data = bytes(memoryview(at[0])[p : p + n])
    if code == "B":
        return data
    return [c != 0 for c in data] if code == "?" else array(code, data)


def list_size(p: int, align: int, size: int, n: int) -> int:
    """The size of a message up to and with ``n`` elements of ``size`` bytes each, ``p`` without them."""
    p = (p + 3 & -4) + 4
    return (p + align - 1 & -align) + n * size if n else p


def put_numbers(
    buf: "bytearray", p: int, off: int, values: "Sequence[Any]", code: str, size: int, bound: int = 0
) -> int:
    """Writes a sequence of numbers; returns the offset behind it. Allocates unless they are bytes."""
    n = len(values)
    p = put_count(buf, p, off, n, bound)
    if not n:
        return p
    p = pad(buf, p, off, size)
    end = p + n * size
    values = block(values, "B" if code == "?" else code, n)
    if code == "B" or code == "?":
        buf[p:end] = values  # unlike a format, it takes no heap
    else:
        pack_into("%ds" % (end - p), buf, p, values)
    return end
