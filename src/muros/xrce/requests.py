"""Submessages with ids, as they are put into streams now and then. Boards borrow this."""

from struct import pack

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce.streams import Output

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
