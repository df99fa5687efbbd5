"""A session's core when it is made and begins again; its control messages. See ``session``. Boards borrow this."""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer, Handle, Send
    from muros.xrce.session import SessionCore

_LITTLE_ENDIAN = const(0x01)
_SESSION_NONE = const(0x80)
_CONTROL = const(8)
_LONGEST_CONTROL = const(28)  # with the header of the submessage


def begin(
    self: "SessionCore",
    session_id: int,
    key: "bytes | None",
    send: "Send",
    handle: "Handle",
    largest: int,
) -> None:
    """Sets up a core. ``key`` is the client key, 4 bytes; ids below 0x80 carry it in every header.

    ``largest`` is the longest joined submessage taken, in bytes.
    """
    self.head = bytearray((session_id, 0, 0, 0))
    if session_id < _SESSION_NONE:
        self.head += key or bytes(4)
    self.send = send
    self.inputs = {}
    self.outputs = {}
    self.now = self.malformed = self.foreign = self.probe = 0
    self.largest = largest
    self._handle = handle
    self._control = bytearray(_CONTROL - len(self.head)) + self.head + bytes(_LONGEST_CONTROL)
    self._control[_CONTROL + 1] = _LITTLE_ENDIAN


def stranger(self: "SessionCore", buf: "Buffer", at: int) -> None:
    """The peer acknowledges what was never sent; ``at`` is where the ACKNACK says what."""
    self.malformed += 1
    self.foreign += 1


def flush(self: "SessionCore", now: int) -> None:
    """Sends what was built on any stream and not sent, and the HEARTBEATs that are due."""
    from muros.xrce import session

    for stream_id in self.outputs:
        session.flush(self, self.outputs[stream_id], now)
