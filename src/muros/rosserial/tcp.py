"""A TCP connection to a rosserial server. Connecting does not block; what breaks is dialled again."""

from muros.client.tcp import Tcp as FramedTcp
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.xrce._types import Buffer

_PORT = const(11411)
_CHUNK = const(512)
_AT_ONCE = const(16)


class Tcp(FramedTcp):
    """A connection to ``host`` (a name or an address of either family)."""

    def __init__(self, host: str, port: int = _PORT) -> None:
        super().__init__(host, port, 1)

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends bytes. A connection that takes nothing for two seconds is closed."""
        self._write(buf, off, n)

    def receive(self, feed: "Callable[[Buffer, int], object]") -> int:  # type: ignore[override]
        """Calls ``feed(data, n)`` with what has come, from up to 16 reads; OSError when the connection is gone."""
        if self._file is None:
            raise OSError(self._gone)
        total = 0
        for _ in range(_AT_ONCE):
            data = self._read(_CHUNK)
            if data is None:
                break
            total += len(data)
            feed(data, len(data))
        return total
