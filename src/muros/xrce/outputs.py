"""The sending side of a session's streams (DDS-XRCE 1.0, 8.3.2.2 and 8.4): best effort and reliable.

Theory of operation. Sequence numbers are 16 bit and compared as RFC 1982 says: a is before b when
``(b - a) mod 65536`` is in 1..32767. The first message of every stream has number 0. Messages lie in ``history``
slots, one behind the other: ``first`` to ``sent`` are sent and not acknowledged, ``sent`` to ``next`` wait for
``flush``.

A message is built in place: ``reserve(n)`` gives the offset of a submessage header with room for n bytes of payload
behind it, packing as many submessages into the last message as its MTU holds; ``flush`` hands every message not sent
yet to ``send(buf, off, n)``. A reliable sender keeps a message until the peer acknowledges it; while any is
unacknowledged it is ``due`` to say so in a HEARTBEAT every ``period`` ms. An ACKNACK frees what lies before
``first_unacked`` and has the messages of its set bits sent again. The answer to a hole repeats with every message that
arrives behind it, so a message sent again is not sent once more within ``_HOLD_OFF`` ms. A best-effort sender is one
that takes each message for acknowledged when it is sent.

Boards use this class as it is, with every buffer made at the start. Hosts with many sessions use the subclasses in
``queues``, which hold messages only while they wait.
"""

from array import array

from muros.compat import const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Send

_HEAD = const(4)
_HOLD_OFF = const(20)
_STREAM_RELIABLE = const(0x80)


class Output:
    """A stream as its sender sees it, reliable when its id is.

    ``head`` is the session's header: session id, stream, number, and the key if it has one. ``history`` (a power of
    two) messages may wait to be sent and acknowledged. With an ``mtu`` of 0 there is no buffer to reserve in.
    """

    def __init__(self, stream_id: int, mtu: int, head: bytearray, history: int = 1, period: int = 0) -> None:
        if history & history - 1 or not 0 < history <= 0x4000:
            raise ValueError("history is %d: it must be a power of two up to 16384" % history)
        self.stream_id = stream_id
        self.reliable = stream_id >= _STREAM_RELIABLE
        self.mtu = mtu
        self.history = history
        self.period = period
        self.due = 0  # the tick of the next heartbeat, while any message is unacknowledged
        self.resends = 0
        self.buf = bytearray(mtu * history)
        self._start = len(head)
        self._sizes = array("H", bytes(2 * history))
        for at in range(0, len(self.buf), mtu or 1):
            self.buf[at : at + self._start] = head
            self.buf[at + 1] = stream_id
        self.reset()

    def reset(self) -> None:
        """Begins again with number 0; every kept message is dropped."""
        self.first = 0  # the oldest unacknowledged message
        self.sent = 0  # the first message that was never sent
        self.next = 0  # the first message that is not begun
        self._again = 0  # bit i: message first + i was sent again at _again_at
        self._again_at = 0

    def reserve(self, n: int) -> int:
        """The offset in ``buf`` for a submessage with ``n`` bytes of payload; -1 when it does not fit now.

        Writing header and payload there completes the submessage: nothing else is to be called but ``flush``.
        """
        number = self.next
        slot = number - 1 & self.history - 1
        at = self._sizes[slot]
        if number == self.sent or (at + 3 & ~3) + _HEAD + n > self.mtu:  # the last message takes no more
            at = self._start
            if at + _HEAD + n > self.mtu or number - self.first & 0xFFFF >= self.history:
                return -1
            slot = number & self.history - 1
            self.next = number + 1 & 0xFFFF
        base = slot * self.mtu
        buf = self.buf
        if at == self._start:
            buf[base + 2] = number & 255
            buf[base + 3] = number >> 8
        while at & 3:
            buf[base + at] = 0
            at += 1
        self._sizes[slot] = at + _HEAD + n
        return base + at

    def cancel(self, at: int) -> None:
        """Takes back the submessage that ``reserve`` gave last, before anything else was called."""
        at %= self.mtu
        self._sizes[self.next - 1 & self.history - 1] = at
        if at == self._start:
            self.next = self.next - 1 & 0xFFFF

    def capacity(self) -> int:
        """Longest payload in bytes that a message of its own can carry."""
        return self.mtu - self._start - _HEAD

    def idle(self) -> bool:
        """Whether everything is sent and acknowledged."""
        return self.first == self.next

    def flush(self, send: "Send", now: int) -> None:
        """Sends every message not sent yet."""
        number = self.sent
        end = self.next
        if number != end:
            if number == self.first:
                self.due = ticks_add(now, self.period)
            self.sent = end
            if not self.reliable:
                self.first = end
            self._transmit(number, end, send)

    def acknowledge(self, first: int, bitmap: int, send: "Send", now: int) -> bool:
        """Takes an ACKNACK: frees what is before ``first``, sends again what ``bitmap`` asks for (bit 0 = first).

        Returns False when ``first`` was never sent: the peer speaks of another session.
        """
        moved = first - self.first & 0xFFFF
        if moved > (self.sent - self.first & 0xFFFF):
            return False
        if moved:
            self.first = first
            self._again >>= moved
            self.due = ticks_add(now, self.period)
        if bitmap:
            self._resend(bitmap, send, now)
        return True

    def unacknowledged(self, send: "Send") -> None:
        """Shows every kept message, oldest first: ``send(buf, off, n)``."""
        self._transmit(self.first, self.next, send)

    def _resend(self, bitmap: int, send: "Send", now: int) -> None:
        if ticks_diff(now, self._again_at) >= _HOLD_OFF:
            self._again = 0
        number = self.first
        bit = 1
        while bit <= bitmap and number != self.sent:
            if bitmap & bit & ~self._again:
                self._again |= bit
                self._again_at = now
                self.resends += 1
                self._transmit(number, number + 1 & 0xFFFF, send)
            number = number + 1 & 0xFFFF
            bit <<= 1

    def _transmit(self, number: int, end: int, send: "Send") -> None:
        while number != end:
            slot = number & self.history - 1
            send(self.buf, slot * self.mtu, self._sizes[slot])
            number = number + 1 & 0xFFFF
