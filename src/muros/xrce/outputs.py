"""The sending side of a session's streams (DDS-XRCE 1.0, 8.3.2.2 and 8.4): best effort and reliable.

Theory of operation. Sequence numbers are 16 bit and compared as RFC 1982 says: a is before b when
``(b - a) mod 65536`` is in 1..32767. The first message of every stream has number 0.

A message is built in place: ``reserve(n)`` gives the offset of a submessage header with room for n bytes of payload
behind it, packing as many submessages into a message as its MTU holds; ``flush`` closes the message and hands it to
``send(buf, off, n)``. A reliable sender keeps each message in one of ``history`` slots until the peer acknowledges it;
while any is unacknowledged it is due to say so in a HEARTBEAT every ``period`` ms. An ACKNACK frees what lies before
``first_unacked`` and has the messages of its set bits sent again. The answer to a hole repeats with every message that
arrives behind it, so a message sent again is not sent once more within ``_HOLD_OFF`` ms.

Boards use these classes as they are, with every buffer made at the start. Hosts with many sessions use the
subclasses in ``queues``, which hold messages only while they wait.
"""

from array import array

from muros.compat import const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Send

_HEAD = const(4)
_HOLD_OFF = const(20)
_BITS = const(16)


class BestEffortOutput:
    """Sends messages once. ``head`` is the session's header: session id, stream, number, and the key if it has one."""

    reliable = False

    def __init__(self, stream_id: int, mtu: int, head: bytearray) -> None:
        self.stream_id = stream_id
        self.mtu = mtu
        self.next = 0
        self._head = head
        self._base = 0
        self._used = 0
        self._make(mtu)

    def reserve(self, n: int) -> int:
        """The offset in ``buf`` for a submessage with ``n`` bytes of payload; -1 when it does not fit now.

        Writing header and payload there completes the submessage: nothing else is to be called but ``flush``.
        """
        used = self._used
        at = used + 3 & ~3
        end = at + _HEAD + n
        if used == 0 or end > self.mtu:
            at = len(self._head)
            end = at + _HEAD + n
            if end > self.mtu or not self._open():
                return -1
            used = at
        base = self._base
        while used & 3:
            self.buf[base + used] = 0
            used += 1
        self._used = end
        return base + at

    def cancel(self, at: int) -> None:
        """Takes back the submessage that ``reserve`` gave last, before anything else was called."""
        used = at - self._base
        self._used = used if used > len(self._head) else 0

    def capacity(self) -> int:
        """Longest payload in bytes that a message of its own can carry."""
        return self.mtu - len(self._head) - _HEAD

    def flush(self, send: "Send", now: int) -> None:
        """Sends what was built: ``send(buf, off, n)``."""
        if self._used:
            n = self._used
            self._used = 0
            self.next = self.next + 1 & 0xFFFF
            send(self.buf, 0, n)

    def reset(self) -> None:
        """Begins again with number 0; what was not sent is dropped."""
        self.next = 0
        self._used = 0

    def _make(self, mtu: int) -> None:
        self.buf = bytearray(mtu)

    def _open(self) -> bool:
        if self._used:
            return False  # the last message has not been flushed yet
        self._begin()
        return True

    def _begin(self) -> None:
        base = self._base
        head = self._head
        head[1] = self.stream_id
        head[2] = self.next & 255
        head[3] = self.next >> 8
        self.buf[base : base + len(head)] = head
        self._used = len(head)


class ReliableOutput(BestEffortOutput):
    """Sends messages until they are acknowledged; ``history`` (a power of two) of them may wait for that."""

    reliable = True

    def __init__(self, stream_id: int, mtu: int, head: bytearray, history: int, period: int) -> None:
        if history & (history - 1) or not 0 < history <= 0x4000:
            raise ValueError("history is %d: it must be a power of two up to 16384" % history)
        self.history = history
        super().__init__(stream_id, mtu, head)
        self.period = period
        self.first = 0  # the oldest unacknowledged message
        self.due = 0  # the tick of the next heartbeat, while any is unacknowledged
        self.sent = 0  # the first message that was never sent
        self.resends = 0
        self._again = 0  # bit i: message first + i was sent again at _again_at
        self._again_at = 0

    def free(self) -> int:
        """How many more messages can be begun."""
        return self.history - (self.next - self.first & 0xFFFF) - (1 if self._used else 0)

    def idle(self) -> bool:
        """Whether everything is sent and acknowledged."""
        return self.first == self.next and self._used == 0

    def flush(self, send: "Send", now: int) -> None:
        """Closes the message that is being built and sends every message not sent yet."""
        if self._used:
            self._close()
        if self.sent == self.next:
            return
        if self.sent == self.first:
            self.due = ticks_add(now, self.period)
        while self.sent != self.next:
            self._transmit(self.sent, send)
            self.sent = self.sent + 1 & 0xFFFF

    def acknowledge(self, first: int, bitmap: int, send: "Send", now: int) -> bool:
        """Takes an ACKNACK: frees what is before ``first``, sends again what ``bitmap`` asks for (bit 0 = first).

        Returns False when ``first`` was never sent: the peer speaks of another session.
        """
        moved = first - self.first & 0xFFFF
        if moved > (self.sent - self.first & 0xFFFF):
            return False
        if moved:
            self._release(moved)
            self.first = first
            self._again >>= moved
            self.due = ticks_add(now, self.period)
        if bitmap:
            if ticks_diff(now, self._again_at) >= _HOLD_OFF:
                self._again = 0
            wanted = bitmap & ~self._again & 0xFFFF
            pending = self.sent - first & 0xFFFF
            for i in range(_BITS if pending > _BITS else pending):
                if wanted >> i & 1:
                    self._again |= 1 << i
                    self._again_at = now
                    self.resends += 1
                    self._transmit(first + i & 0xFFFF, send)
        return True

    def heartbeat_due(self, now: int) -> bool:
        """Whether a HEARTBEAT (``first`` to ``sent - 1``) is to be sent now; if so, the next one is set."""
        if self.first == self.sent or ticks_diff(now, self.due) < 0:
            return False
        self.due = ticks_add(now, self.period)
        return True

    def reset(self) -> None:
        """Begins again with number 0; every kept message is dropped."""
        self._release(self.next - self.first & 0xFFFF)
        super().reset()
        self.first = self.sent = self._again = 0

    def unacknowledged(self, send: "Send") -> None:
        """Shows every kept message, oldest first: ``send(buf, off, n)``."""
        number = self.first
        while number != self.next:
            self._transmit(number, send)
            number = number + 1 & 0xFFFF

    def _make(self, mtu: int) -> None:
        self.buf = bytearray(mtu * self.history)
        self._sizes = array("H", bytearray(2 * self.history))

    def _open(self) -> bool:
        if self.free() <= 0:
            return False
        if self._used:
            self._close()
        self._base = (self.next & self.history - 1) * self.mtu
        self._begin()
        return True

    def _close(self) -> None:
        self._sizes[self.next & self.history - 1] = self._used
        self._used = 0
        self.next = self.next + 1 & 0xFFFF

    def _transmit(self, number: int, send: "Send") -> None:
        slot = number & self.history - 1
        send(self.buf, slot * self.mtu, self._sizes[slot])

    def _release(self, count: int) -> None:
        """The ``count`` oldest messages are no longer needed (their slots are simply used again)."""
