"""Samples that are serialised already, as messages."""

from muros.compat import const, copy

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer


class Raw:
    """A message whose body is ``data`` as it is."""

    def __init__(self, data: "bytes | bytearray" = b"") -> None:
        self.data = data

    def size(self) -> int:
        """Bytes of the body."""
        return len(self.data)

    def write(self, buf: bytearray, off: int) -> int:
        """Writes the body at ``off`` and returns its end."""
        n = len(self.data)
        copy(buf, off, self.data, 0, n)
        return off + n

    def read(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a copy of the body."""
        self.data = bytes(memoryview(buf)[off : off + n])
