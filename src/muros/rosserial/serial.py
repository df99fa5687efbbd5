"""A serial port of a host that plays a board, raw, 8N1. Boards use ``uart``."""

from muros.client.serial import Serial as FramedSerial
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.xrce._types import Buffer

_AT_ONCE = const(16)


class Serial(FramedSerial):
    """The port ``device`` at ``baud``; it need not be there yet, and may come and go."""

    def __init__(self, device: str, baud: int = 57600) -> None:
        super().__init__(device, baud, 1)

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends bytes. A port that takes nothing for two seconds is closed."""
        self._write(buf, off, n)

    def receive(self, feed: "Callable[[Buffer, int], object]") -> int:  # type: ignore[override]
        """Calls ``feed(data, n)`` with what has come, from up to 16 reads; OSError when the port is gone."""
        if self._file is None:
            raise OSError(self._gone)
        total = 0
        for _ in range(_AT_ONCE):
            n = self._read(self._rx)
            if n is None:
                break
            total += n
            feed(self._rx, n)
        return total
