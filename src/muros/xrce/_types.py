"""Type names shared by the protocol core; imported on hosts and by type checkers only."""

from collections.abc import Callable

Buffer = bytes | bytearray | memoryview
Send = Callable[[Buffer, int, int], object]
"""Takes a message: ``send(buf, off, n)``; the bytes are only lent."""
Handle = Callable[[int, Buffer, int, int], int]
"""Takes a submessage behind its header in the buffer: ``handle(kind, buf, off, n)``."""
Answer = Callable[[int, int, Buffer, int, int, int], int]
"""Takes a submessage on a host: ``answer(kind, flags, buf, off, n, stream_id)``."""
