"""Submessages with ids, as they are put into streams now and then. Boards borrow this."""

from struct import pack_into


def head(buf: bytearray, at: int, kind: int, n: int, request: int, object_id: int) -> None:
    """Writes the header of a submessage with ``n`` bytes of payload, and the ids that its payload begins with.

    ``kind`` has the flags from bit 8 on. A payload of 64 KiB or more has length 0: it runs to the end of the message.
    """
    if n > 0xFFFF:
        n = 0
    pack_into("<HH", buf, at, kind, n)
    pack_into(">HH", buf, at + 4, request, object_id)
