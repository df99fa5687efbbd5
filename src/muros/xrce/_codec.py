"""The per-byte loops of serial framing in plain Python; ``_viper`` holds the same functions as native code.

The CRC is CRC-16/ARC: polynomial 0x8005 reflected, initial value 0, no final xor.
"""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from array import array

    from muros.xrce._types import Buffer

NATIVE = False

_FLAG = const(0x7E)
_ESCAPE = const(0x7D)
_FLIP = const(0x20)

# For the low four bits of the CRC: a board has no room for the table of 256
_NIBBLES = (
    0x0000, 0xCC01, 0xD801, 0x1400, 0xF001, 0x3C00, 0x2800, 0xE401,
    0xA001, 0x6C00, 0x7800, 0xB401, 0x5000, 0x9C01, 0x8801, 0x4400,
)  # fmt: skip


def crc16(buf: "Buffer", off: int, n: int, crc: int = 0) -> int:
    """CRC-16/ARC of ``buf[off:off + n]``, continuing from ``crc``."""
    table = _NIBBLES
    for i in range(off, off + n):
        crc ^= buf[i]
        crc = crc >> 4 ^ table[crc & 15]
        crc = crc >> 4 ^ table[crc & 15]
    return crc


def stuff(source: "Buffer", off: int, n: int, out: bytearray, pos: int) -> int:
    """Writes ``source[off:off + n]`` escaped into ``out`` at ``pos``; returns the position behind it.

    ``out`` needs room for twice ``n``.
    """
    for i in range(off, off + n):
        byte = source[i]
        if byte == _FLAG or byte == _ESCAPE:
            out[pos] = _ESCAPE
            pos += 1
            byte ^= _FLIP
        out[pos] = byte
        pos += 1
    return pos


def unstuff(source: "Buffer", n: int, out: bytearray, state: "list[int] | array[int]") -> int:
    """Unescapes into ``out`` until it holds what is wanted, a flag comes or ``source[:n]`` ends.

    ``state`` is [next index of source, bytes in out, bytes wanted in out, 1 behind an escape], updated in place.
    Returns 1 when a flag stopped it, else 0.
    """
    i = state[0]
    pos = state[1]
    want = state[2]
    escaped = state[3]
    flag = 0
    while i < n and pos < want:
        byte = source[i]
        i += 1
        if byte == _FLAG:
            flag = 1
            break
        if byte == _ESCAPE:
            escaped = 1
        else:
            if escaped:
                byte ^= _FLIP
                escaped = 0
            out[pos] = byte
            pos += 1
    state[0] = i
    state[1] = pos
    state[3] = escaped
    return flag
