"""The reliable streams of a host with many sessions: messages are bytes, held only while they wait.

Same rules and numbers as in ``streams``; a session that is idle holds nothing. A sender may be given
more than its window: the rest waits in order, so that nothing accepted is lost.
"""

from collections import deque

from muros.xrce._types import Send
from muros.xrce.mending import go_on
from muros.xrce.outputs import begin
from muros.xrce.resetting import reset_output
from muros.xrce.session import SessionCore
from muros.xrce.streams import Output

_FRAGMENT = 13
_LITTLE_ENDIAN = 0x01
_LAST_FRAGMENT = 0x02


def resume(session: SessionCore, stream_id: int, now: int) -> None:
    """Goes on with a stream of ``session`` that was held by ``LATER``."""
    stream = session.inputs.get(stream_id)
    if stream is not None and stream.expected in stream.early and not stream.busy:
        session.now = now
        go_on(session, stream, b"", 0, 0)


class QueuedBestEffortOutput(Output):
    """Sends each submessage at once, in a message of its own."""

    def __init__(self, stream_id: int, mtu: int, head: bytearray) -> None:
        begin(self, stream_id, 0, head)
        self.mtu = mtu
        self._head = head

    def post(self, submessage: bytes, send: Send, now: int) -> bool:
        """Sends ``submessage`` (header and payload); False when it does not fit the MTU."""
        head = self._head
        n = len(head) + len(submessage)
        if n > self.mtu:
            return False
        number = self.next
        self.first = self.sent = self.next = number + 1 & 0xFFFF
        send(bytes((head[0], self.stream_id, number & 255, number >> 8)) + head[4:] + submessage, 0, n)
        return True


class QueuedReliableOutput(Output):
    """Keeps messages until they are acknowledged, ``history`` of them in flight, the others waiting."""

    def __init__(self, stream_id: int, mtu: int, head: bytearray, history: int, period: int) -> None:
        self._kept: deque[bytes] | None = None
        self._waiting: deque[bytes] | None = None
        begin(self, stream_id, 0, head, history, period)
        self.mtu = mtu
        self._head = head

    def post(self, submessage: bytes, send: Send, now: int) -> bool:
        """Takes a submessage (header and payload), cut into FRAGMENTs where it does not fit a message."""
        room = self.mtu - len(self._head)
        if len(submessage) <= room:
            self._append(submessage, send, now)
            return True
        room -= 4
        total = len(submessage)
        for start in range(0, total, room):
            piece = submessage[start : start + room]
            flags = _LITTLE_ENDIAN | (_LAST_FRAGMENT if start + room >= total else 0)
            self._append(bytes((_FRAGMENT, flags, len(piece) & 255, len(piece) >> 8)) + piece, send, now)
        return True

    def free(self) -> int:
        """How many messages can be posted without waiting."""
        return 0 if self._waiting else self.history - (self.next - self.first & 0xFFFF)

    def waiting(self) -> int:
        """Messages behind the window."""
        return len(self._waiting) if self._waiting else 0

    def acknowledge(self, first: int, send: Send, now: int) -> bool:
        """As in ``Output``; what waits moves into the room that was made."""
        known = super().acknowledge(first, send, now)
        kept = self._kept
        if kept is not None:
            for _ in range(len(kept) - (self.next - self.first & 0xFFFF)):
                kept.popleft()
            if not kept:
                self._kept = None
        waiting = self._waiting
        if waiting:
            while waiting and (self.next - self.first & 0xFFFF) < self.history:
                self._launch(waiting.popleft(), send, now)
            if not waiting:
                self._waiting = None
        return known

    def reset(self) -> None:
        """Begins again with number 0; every kept or waiting message is dropped."""
        reset_output(self)
        self._kept = self._waiting = None

    def _append(self, submessage: bytes, send: Send, now: int) -> None:
        if self._waiting or (self.next - self.first & 0xFFFF) >= self.history:
            if self._waiting is None:
                self._waiting = deque()
            self._waiting.append(submessage)
        else:
            self._launch(submessage, send, now)

    def _launch(self, submessage: bytes, send: Send, now: int) -> None:
        head = self._head
        number = self.next
        message = bytes((head[0], self.stream_id, number & 255, number >> 8)) + head[4:] + submessage
        if self._kept is None:
            self._kept = deque()
        self._kept.append(message)
        if number == self.first:
            self.due = now + self.period
        self.next = self.sent = number + 1 & 0xFFFF
        send(message, 0, len(message))

    def transmit(self, number: int, end: int, send: Send) -> None:
        """Sends the messages from ``number`` to before ``end``."""
        while number != end and self._kept is not None:
            message = self._kept[-(self.next - number & 0xFFFF)]
            send(message, 0, len(message))
            number = number + 1 & 0xFFFF
