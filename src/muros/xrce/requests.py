"""What a client needs when it connects anew: streams that begin again, and requests in them. Boards borrow this."""

from struct import pack

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce.session import SessionCore
    from muros.xrce.streams import Input, Output

_HEAD = const(4)


def head(kind: int, n: int, request: int, object_id: int) -> bytes:
    """The header of a submessage with ``n`` bytes of payload, and the ids that its payload begins with.

    ``kind`` has the flags from bit 8 on. A payload of 64 KiB or more has length 0: it runs to the end of the message.
    """
    return pack("<HH", kind, n if n <= 0xFFFF else 0) + pack(">HH", request, object_id)


def add(stream: "Output", data: "bytes | bytearray") -> bool:
    """Puts a whole submessage into a stream; False when there is no room for it now."""
    n = len(data) - _HEAD
    at = stream.place(n)
    if at < 0:
        return False
    stream.buf[at : at + len(data)] = data
    stream.commit(at, data[0] | data[1] << 8, n)
    return True


def reset(self: "SessionCore") -> None:
    """All streams of a session, both ways, begin again; what they keep is dropped."""
    for stream in self.inputs.values():
        reset_input(stream)
    for stream in self.outputs.values():
        reset_output(stream)


def reset_output(self: "Output") -> None:
    """Begins again with number 0; every kept message is dropped."""
    self.first = self.sent = self.next = self._again = self._again_at = 0


def reset_input(self: "Input") -> None:
    """Expects number 0 again; kept messages are dropped."""
    self.expected = self.known = 0
    self.early.clear()
    self.busy = False
    self.fragments = None
