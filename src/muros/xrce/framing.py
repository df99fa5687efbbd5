"""The framings of every link that does not keep message boundaries, for hosts: serial, TCP and CAN FD.

Deframers take bytes in any pieces and call ``on_frame(buf, off, n, source)`` for each whole message; the same
input, whole or byte by byte, gives the same calls. Foreign bytes only move counters.
"""

from collections.abc import Callable

from muros.xrce._codec import stuff
from muros.xrce._crc import crc16
from muros.xrce._types import Buffer
from muros.xrce.serial import SerialDeframer, SerialFramer

__all__ = [
    "CAN_MTU",
    "TCP_MTU",
    "SerialDeframer",
    "SerialFramer",
    "TcpDeframer",
    "can_frame",
    "can_message_untrusted",
    "serial_frame",
    "tcp_frame",
]

TCP_MTU = 65535
"""Longest message over TCP in bytes: its length is a u16."""
CAN_MTU = 63
"""Longest message in a CAN FD frame of 64 bytes, whose first byte is the length."""


def serial_frame(message: bytes, source: int, destination: int) -> bytes:
    """One whole frame of a serial line, escaped, from the address ``source`` to ``destination`` (0 to 255)."""
    head = bytes((source, destination, len(message) & 255, len(message) >> 8))
    crc = crc16(message, 0, len(message))
    body = head + message + bytes((crc & 255, crc >> 8))
    out = bytearray(1 + 2 * len(body))
    out[0] = 0x7E
    return bytes(out[: stuff(body, 0, len(body), out, 1)])


def tcp_frame(message: bytes) -> bytes:
    """The message behind its length, u16 little endian."""
    if len(message) > TCP_MTU:
        raise ValueError(f"a message of {len(message)} B does not fit a TCP frame: at most {TCP_MTU} B")
    return len(message).to_bytes(2, "little") + message


class TcpDeframer:
    """Cuts a TCP byte stream into messages.

    ``capacity`` is the longest message taken; a longer one is passed over whole and counted in ``bad_length``, as
    are empty ones: the stream stays in step.
    """

    def __init__(self, capacity: int = TCP_MTU, on_frame: Callable[..., None] | None = None) -> None:
        self.capacity = capacity
        self.on_frame = on_frame
        self.frames = 0
        self.bad_length = 0
        self._rest = b""
        self._skip = 0

    def feed(self, data: Buffer, n: int) -> None:
        """Takes ``data[:n]``; calls ``on_frame`` for each message that it completes."""
        data = bytes(data[:n])
        if self._skip:
            passed = min(self._skip, len(data))
            self._skip -= passed
            data = data[passed:]
        buf = self._rest + data if self._rest else data
        off = 0
        while len(buf) - off >= 2:
            size = buf[off] | buf[off + 1] << 8
            if size == 0 or size > self.capacity:
                self.bad_length += 1
                off += 2
                passed = min(size, len(buf) - off)
                self._skip = size - passed
                off += passed
                continue
            if len(buf) - off - 2 < size:
                break
            self.frames += 1
            if self.on_frame is not None:
                self.on_frame(buf, off + 2, size, 0)
            off += 2 + size
        self._rest = buf[off:]


def can_frame(message: bytes) -> bytes:
    """The data of the CAN FD frame that carries ``message``: its length, then the message."""
    if len(message) > CAN_MTU:
        raise ValueError(f"a message of {len(message)} B does not fit a CAN FD frame: at most {CAN_MTU} B")
    return bytes((len(message),)) + message


def can_message_untrusted(data: bytes) -> bytes | None:
    """The message in the data of a CAN FD frame, or None when its length byte does not fit the frame."""
    if not data or data[0] == 0 or data[0] > len(data) - 1:
        return None
    return data[1 : 1 + data[0]]
