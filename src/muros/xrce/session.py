"""A session without I/O: the header of its messages, its streams and their acknowledgements, for either role.

The core answers what belongs to the streams itself (ACKNACK, HEARTBEAT, FRAGMENT) and gives every other submessage
to ``handle(kind, flags, buf, off, n, stream_id)``, which returns ``HANDLED``, ``FAILED`` or ``LATER`` (see
``constants``). ``LATER`` holds the stream: this submessage and what follows on the stream stays unacknowledged until
``queues.resume`` is called, which is how a slow reader pushes back on a writer. Messages leave through
``send(buf, off, n)``, whose bytes are only lent.

What differs between the roles are values: the heartbeat period, the windows, and whether streams a peer names come
into being (an agent's) or not (a client's).
"""

from muros.compat import const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.xrce._types import Buffer, Handle, Send

_FRAGMENT = const(13)
_ACKNACK = const(10)
_HEARTBEAT = const(11)
_WRITE_DATA = const(7)
_DATA = const(9)
_LITTLE_ENDIAN = const(0x01)
_LAST_FRAGMENT = const(0x02)
_STREAM_RELIABLE = const(0x80)
_SESSION_NONE = const(0x80)
_LATER = const(2)
_HEAD = const(4)
_CONTROL = const(8)  # where the submessage of a control message lies in its buffer, behind the longest header
_LONGEST_CONTROL = const(24)
_DONE = const(-1)


class SessionCore:
    """The streams of one session and the messages that keep them whole.

    ``key`` is the client key, 4 bytes; ids below 0x80 carry it in every header. ``stop_at_failure``: the rest of a
    message is not handled behind a submessage that failed (what the reference agent does).
    ``largest`` is the longest joined submessage taken, in bytes.
    """

    stop_at_failure = True

    def __init__(
        self, session_id: int, key: "bytes | None", send: "Send", handle: "Handle", largest: int
    ) -> None:
        self.head = bytearray((session_id, 0, 0, 0))
        if session_id < _SESSION_NONE:
            self.head += key or bytes(4)
        self.send = send
        self.inputs: "dict[int, Any]" = {}
        self.outputs: "dict[int, Any]" = {}
        self.now = 0
        self.malformed = 0
        self.foreign = 0  # acknowledgements in a row of what was never sent
        self.largest = largest
        self._handle = handle
        self._start = len(self.head)  # where the submessages of a message begin
        self._control = bytearray(_CONTROL - self._start) + self.head + bytes(_HEAD + _LONGEST_CONTROL)
        self._control[_CONTROL + 1] = _LITTLE_ENDIAN

    if TYPE_CHECKING:

        def make_input(self, stream_id: int) -> "Any":
            """The input stream for an id not used yet; None refuses it."""

        def too_long(self, stream_id: int, n: int) -> None:
            """A joined submessage of ``n`` bytes was longer than ``largest`` and was passed over."""

    def receive(self, buf: "Buffer", off: int, n: int, now: int) -> bool:
        """Takes one message; False when it is not one of this session."""
        if n < self._start or buf[off] != self.head[0]:
            return False
        self.now = now
        if buf[off + 1]:
            _take(self, buf, off, n)
        else:
            submessages(self, buf, off + self._start, off + n, None)
        return True

    def flush(self, now: int) -> None:
        """Sends what was built and not sent, and the HEARTBEATs that are due."""
        for stream_id in self.outputs:
            if self.outputs[stream_id].first != self.outputs[stream_id].next:
                _flush(self, self.outputs[stream_id], now)

    heartbeats = flush

    def control(self, kind: int, n: int) -> int:
        """Begins a message on stream 0 with one submessage of ``n`` (up to 24) bytes; the offset of its payload in
        ``control_buffer``. ``send_control`` completes it."""
        self._control[_CONTROL] = kind
        self._control[_CONTROL + 2] = n
        return _CONTROL + _HEAD

    def control_buffer(self) -> bytearray:
        """Where ``control`` reserves."""
        return self._control

    def send_control(self) -> None:
        """Sends the message that ``control`` began."""
        self.send(self._control, _CONTROL - self._start, self._start + _HEAD + self._control[_CONTROL + 2])

    def reset(self) -> None:
        """All streams, both ways, begin again with number 0; what they keep is dropped."""
        for streams in (self.inputs, self.outputs):
            for stream_id in streams:
                streams[stream_id].reset()

    def _on_acknack(self, buf: "Buffer", at: int, flags: int) -> None:
        if buf[at + 4] >= _STREAM_RELIABLE and buf[at + 4] in self.outputs:
            flags &= _LITTLE_ENDIAN  # tells which of the two bytes comes first
            if self.outputs[buf[at + 4]].acknowledge(
                buf[at + flags] << 8 | buf[at + 1 - flags],
                buf[at + 2] << 8 | buf[at + 3],
                self.send,
                self.now,
            ):
                self.foreign = 0
            else:
                self.foreign += 1
                self.malformed += 1

    def _on_fragment(self, stream: "Any", buf: "Buffer", at: int, n: int, last: int) -> int:
        """Takes a piece; ``LATER`` when the joined submessage has to wait."""
        from muros.xrce.fragments import take

        return take(self, stream, buf, at, n, last)


# Functions, as a board finds them sooner than methods of a base class. It keeps their locals and operands off its heap
# when they take no more than 11 words: that is why what passes often passes little.


def _take(session: SessionCore, buf: "Buffer", off: int, n: int) -> None:
    """Takes a message of a stream."""
    stream = session.inputs.get(buf[off + 1]) or session.make_input(buf[off + 1])
    if stream is None:
        session.malformed += 1
    elif not stream.accept(buf[off + 2] | buf[off + 3] << 8, buf, off, n):
        if stream.reliable:
            _acknack(session, stream)
    elif stream.reliable:
        go_on(session, stream, buf, off, n)
    else:
        submessages(session, buf, off + session._start, off + n, stream)


def go_on(session: SessionCore, stream: "Any", buf: "Buffer", off: int, n: int) -> None:
    """Handles what is in order now and acknowledges: first the expected message, which is the one that is kept or
    else ``buf[off:off + n]``, then those kept behind it. What a submessage sets off may lead back here; the outer
    call goes on then."""
    if not stream.busy:
        stream.busy = True
        try:
            while True:
                number = stream.expected
                if number in stream.early:
                    buf = stream.early[number]
                    off = 0
                    n = len(buf)
                elif n == 0:
                    break
                at = submessages(session, buf, off + (stream.resume_at or session._start), off + n, stream)
                if not stream.busy:
                    break  # a submessage has reset the streams: number 0 comes next
                if stream.expected == number:  # no HEARTBEAT in the message gave it up
                    if at != _DONE:
                        stream.keep(number, buf, off, n)
                        stream.resume_at = at - off
                        break
                    stream.advance(1)
                n = 0
        finally:
            stream.busy = False
    _acknack(session, stream)


def _acknack(session: SessionCore, stream: "Any") -> None:
    bitmap = stream.missing()
    session._control[_CONTROL] = _ACKNACK
    _tell(session, stream.stream_id, stream.expected, bitmap >> 8 | (bitmap & 255) << 8)


def _flush(session: SessionCore, stream: "Any", now: int) -> None:
    if stream.sent != stream.next:
        stream.flush(session.send, now)
    if stream.first != stream.sent and ticks_diff(now, stream.due) >= 0:
        stream.due = ticks_add(now, stream.period)
        session._control[_CONTROL] = _HEARTBEAT
        _tell(session, stream.stream_id, stream.first, stream.sent - 1 & 0xFFFF)


def _tell(session: SessionCore, stream_id: int, first: int, second: int) -> None:
    """Completes and sends an ACKNACK or a HEARTBEAT."""
    buf = session._control
    buf[_CONTROL + 2] = 5
    buf[_CONTROL + 4] = first & 255
    buf[_CONTROL + 5] = first >> 8
    buf[_CONTROL + 6] = second & 255
    buf[_CONTROL + 7] = second >> 8
    buf[_CONTROL + 8] = stream_id
    session.send(buf, _CONTROL - session._start, session._start + 9)


def submessages(session: SessionCore, buf: "Buffer", pos: int, end: int, stream: "Any") -> int:
    """Handles the submessages from ``pos`` on; the position of the one that is to wait, or ``_DONE``.

    Up to 3 bytes behind the last one are padding, which may hold anything.
    """
    while end - pos >= _HEAD:
        kind = buf[pos]
        n = buf[pos + 2] | buf[pos + 3] << 8
        at = pos + _HEAD
        if n > end - at:
            session.malformed += 1
            break
        if n == 0 and (kind == _WRITE_DATA or kind == _DATA):
            n = end - at  # a sample too long for the length field runs to the end of the message
        result = 0
        if kind == _ACKNACK:
            if n >= 5:
                session._on_acknack(buf, at, buf[pos + 1])
        elif kind == _HEARTBEAT:
            if n >= 5:
                _on_heartbeat(session, buf, at, buf[pos + 1])
        elif kind == _FRAGMENT:
            if stream is not None and stream.reliable:
                result = session._on_fragment(stream, buf, at, n, buf[pos + 1] & _LAST_FRAGMENT)
        else:
            result = session._handle(kind, buf[pos + 1], buf, at, n, stream.stream_id if stream else 0)
        if result:
            if result == _LATER:
                return pos
            if session.stop_at_failure:
                break
        pos = at + (n + 3 & ~3)
    return _DONE


def _on_heartbeat(session: SessionCore, buf: "Buffer", at: int, flags: int) -> None:
    stream_id = buf[at + 4]
    if stream_id < _STREAM_RELIABLE:
        session._control[_CONTROL] = _ACKNACK
        _tell(session, stream_id, 0, 0)
        return
    stream = session.inputs.get(stream_id) or session.make_input(stream_id)
    if stream is not None:
        flags &= _LITTLE_ENDIAN
        stream.announce(
            buf[at + flags] << 8 | buf[at + 1 - flags], buf[at + 2 + flags] << 8 | buf[at + 3 - flags]
        )
        go_on(session, stream, buf, 0, 0)
