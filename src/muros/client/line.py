"""Framed messages over a serial line, a host's port or a board's UART (see ``muros.xrce.serial``)."""

import errno

from muros.client.stream import Stream
from muros.compat import const
from muros.xrce.serial import SerialDeframer, SerialFramer

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client._types import Deliver
    from muros.xrce._types import Buffer

_AT_ONCE = const(16)


class Line(Stream):
    """``chunk`` bytes are read at once; ``deframer`` counts what went wrong on the line."""

    _gone = errno.ENODEV

    def __init__(self, mtu: int, source: int, destination: int, chunk: int) -> None:
        self.mtu = mtu
        self.deframer = SerialDeframer(source, mtu, self._on_frame)
        self._framer = SerialFramer(source, destination, self._put_frame)
        self._rx = bytearray(chunk)
        self._deliver: "Deliver | None" = None
        self._taken = 0

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends a message as one frame. A port that takes nothing for two seconds is closed."""
        self._framer.send(buf, off, n)

    def receive(self, deliver: "Deliver") -> int:
        """Delivers what has come, from up to 16 reads; OSError when the port is gone."""
        if self._file is None:
            raise OSError(self._gone)
        self._deliver = deliver
        self._taken = 0
        for _ in range(_AT_ONCE):
            n = self._read(self._rx)
            if n is None:
                break
            self.deframer.feed(self._rx, n)
        return self._taken

    def _on_frame(self, buf: bytearray, off: int, n: int, source: int) -> None:
        self._taken += 1
        if self._deliver is not None:
            self._deliver(buf, off, n)

    def _put_frame(self, buf: bytearray, n: int) -> None:
        self._write(buf, 0, n)
