"""Samples larger than a message: cut into FRAGMENTs by the sender, joined by the receiver (DDS-XRCE 1.0, 8.3.5.14).

The whole submessage, header and payload, is cut; each piece is the payload of a FRAGMENT, the last one flagged. Only
reliable streams carry fragments, so the pieces come in order and none is missing. Boards borrow this for as long as a
sample is under way.
"""

from muros.compat import const, copy
from muros.xrce.session import submessages

_PIECE = const(0x010D)  # a FRAGMENT, little endian; another one follows
_LAST_PIECE = const(0x030D)
_LAST_FRAGMENT = const(0x02)
_TORN = const(-1)
_HEAD = const(4)

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer
    from muros.xrce.session import SessionCore
    from muros.xrce.streams import Input, Output


class Joiner:
    """Joins the pieces of one submessage; at most ``limit`` bytes are kept, a longer one is passed over whole.

    A limit of -1 says that a piece was given up by its sender.

    What is in a joined submessage is handled as if it had come on no stream.
    """

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.size = 0  # bytes so far
        self.data = bytearray()

    def take(self, session: "SessionCore", stream: "Input", buf: "Buffer", off: int, n: int) -> None:
        """Takes a piece for ``session``, and handles what is whole with it.

        Behind the last piece ``stream`` has no use for the joiner any more.
        """
        n += self.size
        if n > self.limit:
            self.data = bytearray()
        else:
            self.data += memoryview(buf)[off : off + n - self.size]
        self.size = n
        if buf[off - 3] & _LAST_FRAGMENT:
            if n <= self.limit:
                self.limit = _TORN  # should handling it fail, the last piece comes again and is passed over
                submessages(session, self.data, -session.body, n + session.body, None)
            else:
                session.malformed += 1
                if self.limit != _TORN:
                    session.too_long(n)
            stream.fragments = None


class Cutter:
    """One large submessage on its way through a reliable output stream, as fast as acknowledgements make room."""

    def __init__(self, data: "bytes | bytearray") -> None:
        self.data = data
        self.done = 0

    def pump(self, stream: "Output") -> bool:
        """Puts as many pieces into ``stream`` as it has room for; whether the last one is in."""
        total = len(self.data)
        while self.done < total:
            n = min(stream.capacity, total - self.done)
            at = stream.place(n)
            if at < 0:
                return False
            self.put(stream.buf, at + _HEAD, n)
            self.done += n
            stream.commit(at, _PIECE if self.done < total else _LAST_PIECE, n)
        return True

    def put(self, buf: bytearray, off: int, n: int) -> None:
        """Writes the next ``n`` bytes."""
        copy(buf, off, self.data, self.done, n)
