"""Type names shared by the protocol core; imported on hosts and by type checkers only."""

from collections.abc import Callable

Buffer = bytes | bytearray | memoryview
Send = Callable[[Buffer, int, int], object]
"""Takes a message: ``send(buf, off, n)``; the bytes are only lent."""
