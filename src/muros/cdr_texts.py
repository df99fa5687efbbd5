"""CDR for boards: strings, and the position in messages whose size differs; see :mod:`muros.cdr`.

Reading, ``at`` is the list ``[buffer, first byte, end, position]``: alignment counts from the first byte, and each read
moves the position. Writing, the position is passed and returned, since publishing leaves the heap alone. Values are
aligned here, so that generated code, of which there is much, stays short.
"""

from struct import calcsize, pack_into, unpack_from

from muros.cdr import CdrError, integer, need
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

_PADDING = const(3)  # bytes that transports may put behind a body


def part(at: "list[Any]", align: int, size: int) -> int:
    """The offset of the next ``size`` bytes, which begin at a multiple of ``align``; the position is behind them."""
    p: int = at[3]
    p += at[1] - p & align - 1
    if at[2] - p < size:
        need(at[2] - p, size)
    at[3] = p + size
    return p


def unpack(at: "list[Any]", form: str, align: int) -> "tuple[Any, ...]":
    """The next numbers, in a format of ``struct`` that begins at a multiple of ``align``. Allocates them."""
    return unpack_from(form, at[0], part(at, align, calcsize(form)))


def finish(at: "list[Any]") -> None:
    """Raises CdrError unless the body ends here."""
    need(at[2], at[3], _PADDING)


def count(at: "list[Any]", least: int, bound: int = 0) -> int:
    """The next count, of elements that take at least ``least`` bytes each, checked against bound and end."""
    n = integer(at[0], part(at, 4, 4), 4, 0)
    if bound:
        need(bound, n)
    if at[2] - at[3] < n * least:
        need(at[2] - at[3], n * least)
    return n


def text(at: "list[Any]", bound: int = 0) -> str:
    """The next string. Allocates the string and a view."""
    n = count(at, 1, bound and bound + 1)
    p: int = at[3]
    at[3] = end = p + n
    if n == 0:
        return ""
    try:
        if at[0][end - 1] == 0:
            return str(memoryview(at[0])[p : end - 1], "utf-8")
    except ValueError:
        pass
    raise CdrError("bad string")


def encoded(value: str, memo: "list[Any] | None", i: int) -> bytes:
    """The bytes of a string, which ``memo`` keeps from ``i`` on until another takes its place."""
    data = value.encode()
    if memo:
        memo[i] = value
        memo[i + 1] = data
    return data


def text_size(p: int, value: "str | bytes | bytearray", memo: "list[Any] | None" = None, i: int = 0) -> int:
    """The size of a message up to and with a string, ``p`` without it."""
    if memo and value is memo[i]:
        value = memo[i + 1]
    elif isinstance(value, str):
        value = encoded(value, memo, i)
    return (p + 3 & -4) + 5 + len(value)


def put_text(
    buf: "bytearray",
    p: int,
    off: int,
    value: "str | bytes | bytearray",
    memo: "list[Any] | None" = None,
    i: int = 0,
    bound: int = 0,
) -> int:
    """Writes a string: its count, its bytes, NUL; returns the offset behind it."""
    if memo and value is memo[i]:
        value = memo[i + 1]
    elif isinstance(value, str):
        value = encoded(value, memo, i)
    n = len(value)
    if bound:
        need(bound, n)
    while p - off & 3:
        buf[p] = 0
        p += 1
    pack_into("<I", buf, p, n + 1)
    p += 4
    buf[p : p + n] = value  # type: ignore[assignment]  # no str any more
    p += n
    buf[p] = 0
    return p + 1


def pad(buf: "bytearray", p: int, off: int, align: int) -> int:
    """Zeroes up to the next multiple of ``align`` from ``off``; returns its offset."""
    while p - off & align - 1:
        buf[p] = 0
        p += 1
    return p
