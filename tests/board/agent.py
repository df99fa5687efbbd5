"""An agent for board tests, in a few lines: it makes sessions, says OK to every request and acknowledges.

It is a transport, so that a session talks to it without a link: ``send`` takes what the client says and answers at
once into a list that ``receive`` delivers. What is written comes out in ``written``.
"""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client._types import Deliver
    from muros.xrce._types import Buffer

_CREATE_CLIENT = const(0)
_CREATE = const(1)
_GET_INFO = const(2)
_DELETE = const(3)
_WRITE_DATA = const(7)
_HEARTBEAT = const(11)


class Agent:
    """``mtu`` is the transport's. ``quiet`` stops it answering; ``knows`` is what it says to pings."""

    def __init__(self, mtu: int = 256) -> None:
        self.mtu = mtu
        self.written: "list[bytes]" = []
        self.inbox: "list[bytes]" = []
        self.quiet = False
        self.counting = False  # only counts what is said, so as to allocate nothing
        self.said = 0
        self.knows = 0
        self.hellos = 0
        self._next = 0  # the number of our next reliable message
        self._expected = 0

    def open(self) -> bool:
        """Always open."""
        return True

    def close(self) -> None:
        """Nothing to close."""

    def wait(self, timeout: int) -> None:
        """Everything has come already."""

    def receive(self, deliver: "Deliver") -> int:
        """Delivers the answers."""
        n = 0
        while self.inbox:
            message = self.inbox.pop(0)
            deliver(message, 0, len(message))
            n += 1
        return n

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a message of the client."""
        self.said += 1
        if self.counting or self.quiet:
            return
        message = bytes(memoryview(buf)[off : off + n])
        if message[1] & 0x80:
            number = message[2] | message[3] << 8
            fresh = number == self._expected
            if fresh:
                self._expected += 1
            if fresh:
                self.handle(message)
            self.answer(b"\x0a\x01\x05\x00" + bytes((self._expected & 255, self._expected >> 8, 0, 0, 0x80)))
        else:
            self.handle(message)

    def handle(self, message: bytes) -> None:
        """Takes the submessages of a message."""
        at = 4
        while len(message) - at >= 4:
            n = message[at + 2] | message[at + 3] << 8 or len(message) - at - 4
            self.take(message[at], message[at + 1], message[at + 4 : at + 4 + n])
            at += 4 + n + 3 & ~3

    def take(self, kind: int, flags: int, body: bytes) -> None:
        """Takes a submessage."""
        if kind == _CREATE_CLIENT:
            self.hellos += 1
            self.knows = 1
            self._next = self._expected = 0
            self.inbox.append(b"\x81\x00\x00\x00\x04\x01\x0b\x00\x00\x00XRCE\x01\x00\x01\x0f\x00")
        elif kind == _CREATE or kind == _DELETE:
            status = b"\x05\x01\x06\x00" + body[:4] + b"\x00\x00"
            if body[2] == 0xFF:
                self.answer(status)
            else:
                self.reliable(status)
        elif kind == _GET_INFO:
            self.answer(b"\x06\x01\x08\x00" + body[:4] + bytes((0, self.knows, 0, 0)))
        elif kind == _WRITE_DATA:
            self.written.append(body[4:])
        elif kind == _HEARTBEAT:
            self.answer(b"\x0a\x01\x05\x00" + bytes((self._expected & 255, self._expected >> 8, 0, 0, 0x80)))

    def answer(self, submessage: bytes) -> None:
        """Says something on stream 0."""
        self.inbox.append(b"\x81\x00\x00\x00" + submessage)

    def reliable(self, submessage: bytes) -> None:
        """Says something on the reliable stream."""
        self.inbox.append(bytes((0x81, 0x80, self._next & 255, self._next >> 8)) + submessage)
        self._next += 1

    def data(self, object_id: int, payload: bytes, stream: int = 0x80) -> bytes:
        """A message with a sample for a reader; on the reliable stream it has the next number."""
        n = len(payload) + 4
        head = bytes((0x81, stream, self._next & 255, self._next >> 8))
        self._next += 1
        return head + bytes((9, 1, n & 255, n >> 8, 0, 10, object_id >> 8, object_id & 255)) + payload
