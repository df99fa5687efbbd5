"""The per-byte loops of serial framing as native code for boards: the same functions as in ``_codec``.

MicroPython only. Boards and builds without a native emitter fail to import this and use ``_codec``.
"""

import micropython  # type: ignore[import-not-found]

NATIVE = True


@micropython.viper  # type: ignore[misc]
def _crc(buf: ptr8, off: int, end: int, crc: int) -> int:  # type: ignore[name-defined] # noqa: F821
    while off < end:
        crc ^= buf[off]
        off += 1
        k = 0
        while k < 8:
            if crc & 1:
                crc = (crc >> 1) ^ 0xA001
            else:
                crc = crc >> 1
            k += 1
    return crc


def crc16(buf, off, n, crc=0):  # type: ignore[no-untyped-def]
    """CRC-16/ARC of ``buf[off:off + n]``, continuing from ``crc``."""
    return _crc(buf, off, off + n, crc)


@micropython.viper  # type: ignore[misc]
def stuff(source: ptr8, off: int, n: int, out: ptr8, pos: int) -> int:  # type: ignore[name-defined] # noqa: F821
    """Writes ``source[off:off + n]`` escaped into ``out`` at ``pos``; returns the position behind it."""
    end = off + n
    while off < end:
        byte = source[off]
        off += 1
        if byte == 0x7E or byte == 0x7D:
            out[pos] = 0x7D
            pos += 1
            byte ^= 0x20
        out[pos] = byte
        pos += 1
    return pos


@micropython.viper  # type: ignore[misc]
def _unstuff(source: ptr8, n: int, out: ptr8, state: ptr32) -> int:  # type: ignore[name-defined] # noqa: F821
    i = state[0]
    pos = state[1]
    want = state[2]
    escaped = state[3]
    flag = 0
    while i < n and pos < want and flag == 0:
        byte = source[i]
        i += 1
        if byte == 0x7E:
            flag = 1
        elif byte == 0x7D:
            escaped = 1
        else:
            if escaped:
                byte ^= 0x20
                escaped = 0
            out[pos] = byte
            pos += 1
    state[0] = i
    state[1] = pos
    state[3] = escaped
    return flag


unstuff = _unstuff
