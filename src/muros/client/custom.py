"""A way of your own to an agent: four functions, with or without the framing of serial lines."""

from muros.compat import const, sleep_ms

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client._types import Deliver
    from muros.xrce._types import Buffer
    from muros.xrce.serial import SerialDeframer

_MTU = const(512)
_AT_ONCE = const(16)


class Custom:
    """Carries messages through functions.

    ``open()`` returns whether the way is open, ``close()`` closes it. ``write(buf, off, n)`` takes bytes and returns
    when they are taken. ``read(buf)`` puts what has come into ``buf`` and returns how many bytes, 0 for none; it does
    not wait. Any of them may raise OSError when the way is gone. Without ``framing`` each write and each read is one
    whole message; with it they are bytes of a stream. ``wait(ms)`` may wait until something has come.
    """

    def __init__(
        self,
        open: "Callable[[], object]",
        close: "Callable[[], object]",
        write: "Callable[[Buffer, int, int], object]",
        read: "Callable[[bytearray], int | None]",
        framing: bool = False,
        mtu: int = _MTU,
        source: int = 1,
        destination: int = 0,
        wait: "Callable[[int], object] | None" = None,
    ) -> None:
        self.mtu = mtu
        self.open: "Any" = open
        self.close: "Any" = close
        self.wait: "Any" = wait or _nap
        self._write = write
        self._read = read
        self._rx = bytearray(mtu)
        self._deliver: "Deliver | None" = None
        self._taken = 0
        self._error: "int | None" = None
        self.deframer: "SerialDeframer | None" = None
        if framing:
            from muros.xrce.serial import SerialDeframer, SerialFramer

            self.deframer = SerialDeframer(source, mtu, self._on_frame)
            self._write = SerialFramer(source, destination, lambda buf, n: write(buf, 0, n)).send

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends a message."""
        try:
            self._write(buf, off, n)
        except OSError as error:
            self._error = error.errno

    def receive(self, deliver: "Deliver") -> int:
        """Delivers what has come, from up to 16 reads."""
        if self._error is not None:
            error_number, self._error = self._error, None
            raise OSError(error_number)
        self._deliver = deliver
        self._taken = 0
        rx = self._rx
        for _ in range(_AT_ONCE):
            n = self._read(rx)
            if not n:
                break
            if self.deframer is None:
                self._on_frame(rx, 0, n, 0)
            else:
                self.deframer.feed(rx, n)
        return self._taken

    def _on_frame(self, buf: bytearray, off: int, n: int, source: int) -> None:
        self._taken += 1
        if self._deliver is not None:
            self._deliver(buf, off, n)


def _nap(timeout: int) -> None:
    """Waits for a millisecond."""
    sleep_ms(1)
