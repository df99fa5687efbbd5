"""What sessions of hosts have beside those of boards: submessages that wait, and reliable streams that are queues.

A handler that answers ``LATER`` holds the stream: this submessage and what follows on the stream stays unacknowledged
until ``resume`` is called, which is how a slow reader pushes back on a writer. What is left of the message is kept like
one that came early.

The streams have the same rules and numbers as in ``streams``, for a host with many sessions: messages are bytes, held
only while they wait, and a session that is idle holds nothing. A sender may be given more than its window: the rest
waits in order, so that nothing accepted is lost.
"""

from collections import deque
from typing import TYPE_CHECKING, Any

from muros.xrce import session as core
from muros.xrce._types import Buffer, Send
from muros.xrce.beginning import begin, make_output
from muros.xrce.constants import HANDLED, LATER
from muros.xrce.fragments import Joiner
from muros.xrce.mending import acknowledge, go_on
from muros.xrce.requests import reset_input, reset_output
from muros.xrce.streams import Output

if TYPE_CHECKING:
    from muros.xrce.streams import Input

_FRAGMENT = 13
_LITTLE_ENDIAN = 0x01
_LAST_FRAGMENT = 0x02
_HEAD = 4


class HostSession(core.SessionCore):
    """A session whose handler may also answer ``LATER``, and ``FAILED``.

    ``stop_at_failure``: the rest of a message is not handled behind a submessage that failed (what the reference agent
    does).
    """

    stop_at_failure = True
    _joining: "Input | None" = None  # a stream whose joined submessages are being handled

    if TYPE_CHECKING:

        def answer(self, kind: int, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
            """Takes a submessage: ``HANDLED``, ``FAILED`` or ``LATER``."""

    begin = begin

    def flush(self, now: int) -> None:
        """Sends what was built on any stream and not sent, and the HEARTBEATs that are due."""
        for stream in self.outputs.values():
            core.flush(self, stream, now)

    def reset(self) -> None:
        """All streams, both ways, begin again; what they keep is dropped."""
        for stream in self.inputs.values():
            reset_input(stream)
        for stream in self.outputs.values():
            stream.reset()

    def stranger(self, buf: Buffer, at: int) -> None:
        """The peer acknowledges what was never sent; ``at`` is where the ACKNACK says what."""
        self.malformed += 1

    def take_next(self, stream: "Input", buf: Buffer, off: int, n: int) -> bool:
        """As in ``SessionCore``."""
        number = stream.expected
        try:
            return super().take_next(stream, buf, off, n)
        except _LaterError as later:
            if stream.expected == number:  # no HEARTBEAT in the message gave it up
                stream.early[number] = bytes(buf[off : off + self.body]) + bytes(buf[later.at : off + n])
                stream.known = max(stream.known, 1)
        acknowledge(self, stream)
        return False

    def _on_fragment(self, buf: Buffer, at: int, n: int, stream: "Input") -> None:
        held: Any = stream.fragments
        if isinstance(held, _Held) and held.limit < 0:
            stream.fragments = None  # the message with the last piece was given up
        before, self._joining = self._joining, stream
        try:
            super()._on_fragment(buf, at, n, stream)
        except _LaterError as later:
            held = stream.fragments
            stream.fragments = _Held(held.data[later.at :])
            raise _LaterError(at - _HEAD) from None
        finally:
            self._joining = before

    def handle(self, kind: int, buf: Buffer, off: int, n: int) -> int:
        """Takes a submessage."""
        stream = self.stream or self._joining
        result = self.answer(kind, buf[off - 3], buf, off, n, stream.stream_id if stream else 0)
        if result == LATER:
            if stream and stream.busy:
                raise _LaterError(off - _HEAD)
            return LATER  # on no stream, or on one that was reset meanwhile
        return result if self.stop_at_failure else HANDLED


def resume(session: HostSession, stream_id: int, now: int) -> None:
    """Goes on with a stream of ``session`` that was held by ``LATER``."""
    stream = session.inputs.get(stream_id)
    if stream is not None and stream.expected in stream.early and not stream.busy:
        session.now = now
        go_on(session, stream)


class _LaterError(Exception):
    """A submessage, whose header is at ``at``, has to wait."""

    def __init__(self, at: int) -> None:
        self.at = at


class _Held(Joiner):
    """What is left of a joined submessage that waits."""

    def __init__(self, data: bytearray) -> None:
        super().__init__(0)
        self.data = data

    def take(self, session: core.SessionCore, stream: "Input", buf: Buffer, off: int, n: int) -> None:
        """Its last piece comes again: goes on with it."""
        core.submessages(session, self.data, -session.body, len(self.data) + session.body, None)
        stream.fragments = None


class QueuedOutput(Output):
    """What both kinds share."""

    def __init__(self, stream_id: int, head: bytearray, history: int, period: int) -> None:
        vars(self).update(vars(make_output(stream_id, 0, head, history, period)))

    def idle(self) -> bool:
        """Whether everything is sent and acknowledged."""
        return self.first == self.next

    def reset(self) -> None:
        """Begins again with number 0."""
        reset_output(self)


class QueuedBestEffortOutput(QueuedOutput):
    """Sends each submessage at once, in a message of its own."""

    def __init__(self, stream_id: int, mtu: int, head: bytearray) -> None:
        super().__init__(stream_id, head, 1, 0)
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


class QueuedReliableOutput(QueuedOutput):
    """Keeps messages until they are acknowledged, ``history`` of them in flight, the others waiting."""

    def __init__(self, stream_id: int, mtu: int, head: bytearray, history: int, period: int) -> None:
        self._kept: deque[bytes] | None = None
        self._waiting: deque[bytes] | None = None
        super().__init__(stream_id, head, history, period)
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
        super().reset()
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
