"""A UART of a board to a rosserial server."""

from machine import UART

from muros.client.stream import Stream
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.xrce._types import Buffer

_BUFFER = const(512)
_CHUNK = const(64)
_AT_ONCE = const(16)


class Uart(Stream):
    """UART ``number`` at ``baud``, on its default pins or on ``tx`` and ``rx``; ``rxbuf`` bytes wait in the driver."""

    def __init__(
        self, number: int, baud: int = 57600, rxbuf: int = _BUFFER, tx: "Any" = None, rx: "Any" = None
    ) -> None:
        if tx is None:
            uart = UART(number, baud, rxbuf=rxbuf, timeout=0)
        else:
            uart = UART(number, baud, rxbuf=rxbuf, timeout=0, tx=tx, rx=rx)
        self._rx = bytearray(_CHUNK)
        self._attach(uart, uart.readinto, uart.write)

    def open(self) -> bool:
        """A UART is always there."""
        return True

    def close(self) -> None:
        """Nothing to do: the UART stays ours."""

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends bytes."""
        self._write(buf, off, n)

    def receive(self, feed: "Callable[[Buffer, int], object]") -> int:
        """Calls ``feed(data, n)`` with what has come, from up to 16 reads."""
        total = 0
        for _ in range(_AT_ONCE):
            n = self._read(self._rx)
            if n is None:
                break
            total += n
            feed(self._rx, n)
        return total
