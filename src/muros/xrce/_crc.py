"""CRC-16/ARC for hosts, which have room for a table: twice as quick as the one in ``_codec``."""

from muros.xrce._types import Buffer


def _table() -> list[int]:
    table = []
    for entry in range(256):
        for _ in range(8):
            entry = entry >> 1 ^ (0xA001 if entry & 1 else 0)
        table.append(entry)
    return table


_TABLE = _table()


def crc16(buf: Buffer, off: int, n: int, crc: int = 0) -> int:
    """CRC-16/ARC of ``buf[off:off + n]``, continuing from ``crc``."""
    table = _TABLE
    for byte in memoryview(buf)[off : off + n]:
        crc = crc >> 8 ^ table[(crc ^ byte) & 255]
    return crc
