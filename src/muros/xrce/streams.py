"""The streams of a session, both ways (DDS-XRCE 1.0, 8.3.2.2 and 8.4): best effort and reliable.

Theory of operation. Sequence numbers are 16 bit and compared as RFC 1982 says: a is before b when
``(b - a) mod 65536`` is in 1..32767. The first message of every stream has number 0. Messages that are sent lie in
``history`` slots, one behind the other: ``first`` to ``sent`` are sent and not acknowledged, ``sent`` to ``next`` wait
for ``flush``.

A message is built in place: ``place(n)`` gives the offset of a submessage header with room for n bytes of payload
behind it, and ``commit`` takes the payload that was written there, packing as many submessages into the last message
as its MTU holds; ``flush`` hands every message not sent yet to ``send(buf, off, n)``. A reliable sender keeps a
message until the peer acknowledges it; while any is unacknowledged it is ``due`` to say so in a HEARTBEAT every
``period`` ms. A best-effort sender is one that takes each message for acknowledged when it is sent.

Here is what runs for each message as long as none is lost. Boards borrow the rest: ``beginning`` makes streams, and
``mending`` keeps messages that come early and sends again what was lost. Hosts with many sessions use the subclasses of
``queues``, which hold messages only while they wait.
"""

from struct import pack_into

from muros.compat import const, ticks_add

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Send
    from muros.xrce.fragments import Joiner

_HEAD = const(4)


class Output:
    """A stream as its sender sees it, reliable when its id is; ``beginning`` makes it."""

    if TYPE_CHECKING:
        stream_id: int
        reliable: bool
        mtu: int
        history: int
        period: int
        due: int  # the tick of the next heartbeat, while any message is unacknowledged
        buf: bytearray
        first: int  # the oldest unacknowledged message
        sent: int  # the first message that was never sent
        next: int  # the first message that is not begun
        resends: int
        capacity: int  # the longest payload in bytes that a message of its own can carry
        _start: int  # where the submessages of a message begin
        _sizes: "list[int]"  # the bytes of each message, by its slot
        _again: int  # bit i: message first + i was sent again at _again_at
        _again_at: int

    def place(self, n: int) -> int:
        """The offset in ``buf`` where a submessage with ``n`` bytes of payload can be written; -1 for nowhere now.

        With ``commit`` it becomes part of the stream; until then it is not there.
        """
        number = self.next
        slot = number - 1 & self.history - 1
        at = self._sizes[slot]
        if number == self.sent or (at + 3 & ~3) + _HEAD + n > self.mtu:  # the last message takes no more
            at = self._start
            if n > self.capacity or number - self.first & 0xFFFF >= self.history:
                return -1
            slot = number & self.history - 1
        slot *= self.mtu
        while at & 3:
            self.buf[slot + at] = 0
            at += 1
        return slot + at

    def commit(self, at: int, kind: int, n: int) -> None:
        """The payload at a place is written: ``flush`` sends it. ``kind`` has the flags from bit 8 on."""
        pack_into("<HH", self.buf, at, kind, n)
        slot = at // self.mtu
        at %= self.mtu
        self._sizes[slot] = at + _HEAD + n
        if at == self._start:
            self.next = self.next + 1 & 0xFFFF

    def flush(self, send: "Send", now: int) -> None:
        """Sends every message not sent yet."""
        number = self.sent
        if number == self.first:
            self.due = ticks_add(now, self.period)
        self.sent = self.next
        if not self.reliable:
            self.first = self.next
        self.transmit(number, self.next, send)

    def transmit(self, number: int, end: int, send: "Send") -> None:
        """Sends the messages from ``number`` to before ``end``."""
        while number != end:
            at = number & self.history - 1
            n = self._sizes[at]
            at *= self.mtu
            self.buf[at + 2] = number & 255
            self.buf[at + 3] = number >> 8
            send(self.buf, at, n)
            number = number + 1 & 0xFFFF

    def acknowledge(self, first: int, send: "Send", now: int) -> bool:
        """Frees what is before ``first``; False when that was never sent: the peer speaks of another session."""
        moved = first - self.first & 0xFFFF
        if moved > (self.sent - self.first & 0xFFFF):
            return False
        if moved:
            self.first = first
            self._again >>= moved
            self.due = ticks_add(now, self.period)
        return True


class Input:
    """A stream as its receiver sees it, reliable when its id is; ``beginning`` makes it, and ``mending`` knows what to
    do with it when messages come early or are missing."""

    if TYPE_CHECKING:
        stream_id: int
        reliable: bool
        mtu: int  # longest message that is kept
        window: int
        lost: int  # messages that a best-effort stream has skipped
        early: "dict[int, bytes]"  # messages that are kept, by their numbers
        expected: int  # the number handled next
        known: int  # how many messages from there on were seen or announced
        busy: bool  # a message of it is being handled
        fragments: "Joiner | None"  # while a sample comes in pieces
