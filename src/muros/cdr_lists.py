"""CDR for boards: sequences; see :mod:`muros.cdr` and :mod:`muros.cdr_texts`.

A ``code`` is one of ``struct`` and ``array``; ``B`` stands for bytes, ``s`` for strings and, in reading,
``?`` for bools.
"""

from array import array
from struct import calcsize, pack_into

from muros.cdr import block, need
from muros.cdr_texts import count, pad, part, put_text, text, text_size
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any


def sequence(at: "list[Any]", code: str, bound: int = 0) -> "Any":
    """The next sequence: an array, bytes, or a list of strings or bools. Allocates twice its bytes."""
    bools = code == "?"
    if bools:
        code = "B"
    size = calcsize(code)
    n = count(at, size, bound)
    if code == "s":
        return [text(at) for _ in range(n)]
    n *= size
    p = part(at, size, n) if n else 0
    data = bytes(memoryview(at[0])[p : p + n])
    if bools:
        return list(map(bool, data))
    return data if code == "B" else array(code, data)


def put_sequence(
    buf: "bytearray", p: int, off: int, values: "Sequence[Any]", code: str, bound: int = 0
) -> int:
    """Writes a sequence; returns the offset behind it. Allocates unless it is of bytes."""
    n = len(values)
    p = put_count(buf, p, off, n, bound)
    if not n:
        return p
    if code == "s":
        for value in values:
            p = put_text(buf, p, off, value)
        return p
    size = calcsize(code)
    if p - off & size - 1:
        p = pad(buf, p, off, size)
    end = p + n * size
    values = block(values, code, n)
    if code == "B":
        buf[p:end] = values  # unlike a format, it takes no heap
    else:
        pack_into("%ds" % (end - p), buf, p, values)
    return end


def put_count(buf: "bytearray", p: int, off: int, n: int, bound: int = 0) -> int:
    """Writes the count of a sequence; returns the offset behind it. Raises CdrError beyond the bound."""
    if bound:
        need(bound, n)
    while p - off & 3:
        buf[p] = 0
        p += 1
    pack_into("<I", buf, p, n)
    return p + 4


def texts_size(p: int, values: "Sequence[str | bytes | bytearray]") -> int:
    """The size of a message up to and with a sequence of strings, ``p`` without it."""
    p = (p + 3 & -4) + 4
    for value in values:
        p = text_size(p, value)
    return p


def list_size(p: int, values: "Sequence[Any]", align: int, size: int) -> int:
    """The size of a message up to and with elements of ``size`` bytes each, ``p`` without them."""
    p = (p + 3 & -4) + 4
    return (p + align - 1 & -align) + len(values) * size if len(values) else p
