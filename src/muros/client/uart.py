"""A UART of a board to an agent, framed as on any serial line (see ``muros.xrce.serial``)."""

from machine import UART

from muros.compat import const, sleep_ms, ticks_diff, ticks_ms
from muros.xrce.serial import SerialDeframer, SerialFramer

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client._types import Deliver
    from muros.xrce._types import Buffer

_MTU = const(256)
_CHUNK = const(64)
_AT_ONCE = const(16)
_BITS = const(10)  # of a byte on the line


class Uart:
    """UART ``number`` at ``baud``, on its default pins or on ``tx`` and ``rx``.

    ``source`` and ``destination`` are the addresses on the line: a client's is 1, the agent's 0.
    """

    def __init__(
        self,
        number: int,
        baud: int = 115200,
        mtu: int = _MTU,
        source: int = 1,
        destination: int = 0,
        tx: "Any" = None,
        rx: "Any" = None,
    ) -> None:
        self.mtu = mtu
        self.deframer = SerialDeframer(source, mtu, self._on_frame)
        self._framer = SerialFramer(source, destination, self._write)
        self._rx = bytearray(_CHUNK)
        self._deliver: "Deliver | None" = None
        self._taken = 0
        if tx is None:
            self._uart = UART(number, baud, rxbuf=2 * mtu, timeout=0)
        else:
            self._uart = UART(number, baud, rxbuf=2 * mtu, timeout=0, tx=tx, rx=rx)
        self._byte = 1 + _BITS * 1000 // baud

    def open(self) -> bool:
        """A UART is always there."""
        return True

    def close(self) -> None:
        """Nothing to do: the UART stays ours."""

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends a message as one frame."""
        self._framer.send(buf, off, n)

    def receive(self, deliver: "Deliver") -> int:
        """Delivers what has come, up to 16 reads of 64 bytes."""
        self._deliver = deliver
        self._taken = 0
        for _ in range(_AT_ONCE):
            if not self._uart.any():
                break
            n = self._uart.readinto(self._rx)
            if not n:
                break
            self.deframer.feed(self._rx, n)
        return self._taken

    def wait(self, timeout: int) -> None:
        """Waits until bytes are there, at most ``timeout`` ms."""
        start = ticks_ms()
        while not self._uart.any() and ticks_diff(ticks_ms(), start) < timeout:
            sleep_ms(1)

    def _on_frame(self, buf: bytearray, off: int, n: int, source: int) -> None:
        self._taken += 1
        if self._deliver is not None:
            self._deliver(buf, off, n)

    def _write(self, buf: bytearray, n: int) -> None:
        done = 0
        start = ticks_ms()
        while done < n and ticks_diff(ticks_ms(), start) < 100 + n * self._byte:
            done += self._uart.write(buf, done, n - done) or 0
