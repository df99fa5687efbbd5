"""Submessages with ids, as they are put into streams now and then. Boards borrow this."""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce.streams import Output


def reserve(self: "Output", n: int) -> int:
    """``place`` and ``commit`` for what is certain to be written."""
    at = self.place(n)
    if at >= 0:
        self.commit(at, n)
    return at


def head(buf: bytearray, at: int, kind: int, flags: int, n: int, request: int, object_id: int) -> None:
    """Writes the header of a submessage with ``n`` bytes of payload, and the ids that its payload begins with.

    A payload of 64 KiB or more has length 0: it runs to the end of the message.
    """
    if n > 0xFFFF:
        n = 0
    buf[at] = kind
    buf[at + 1] = flags
    buf[at + 2] = n & 255
    buf[at + 3] = n >> 8
    buf[at + 4] = request >> 8
    buf[at + 5] = request & 255
    buf[at + 6] = object_id >> 8
    buf[at + 7] = object_id & 255
