"""A session without I/O: the header of its messages, its streams and their acknowledgements, for either role.

The core answers what belongs to the streams itself (ACKNACK, HEARTBEAT, FRAGMENT) and gives every other submessage
to ``handle(kind, flags, buf, off, n, stream_id)``, which returns ``HANDLED``, ``FAILED`` or ``LATER`` (see
``constants``). ``LATER`` holds the stream: this submessage and what follows on the stream stays unacknowledged until
``resume`` is called, which is how a slow reader pushes back on a writer. Messages leave through ``send(buf, off, n)``,
whose bytes are only lent.

What differs between the roles are values: the heartbeat period, the windows, and whether streams a peer names come
into being (an agent's) or not (a client's).

Boards keep the locals of a call off their heap when they and the operands take no more than 11 words: that is why
some calls here pass so little.
"""

from struct import pack_into

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
        self.head = bytearray(_HEAD if session_id >= _SESSION_NONE else _HEAD + 4)
        self.head[0] = session_id
        if session_id < _SESSION_NONE and key:
            self.head[_HEAD:] = key
        self.send = send
        self.inputs: "dict[int, Any]" = {}
        self.outputs: "dict[int, Any]" = {}
        self.now = 0
        self.malformed = 0
        self.foreign = 0  # acknowledgements in a row of what was never sent
        self.largest = largest
        self._handle = handle
        self._control = self.head + bytes(_HEAD + _LONGEST_CONTROL)

    if TYPE_CHECKING:

        def make_input(self, stream_id: int) -> "Any":
            """The input stream for an id not used yet; None refuses it."""

        def too_long(self, stream_id: int, n: int) -> None:
            """A joined submessage of ``n`` bytes was longer than ``largest`` and was passed over."""

    def receive(self, buf: "Buffer", off: int, n: int, now: int) -> bool:
        """Takes one message; False when it is not one of this session."""
        if n < len(self.head) or buf[off] != self.head[0]:
            return False
        self.now = now
        if buf[off + 1]:
            self._on_stream(buf, off, n)
        else:
            self._submessages(buf, off + len(self.head), off + n, None)
        return True

    def resume(self, stream_id: int, now: int) -> None:
        """Goes on with a stream that was held by ``LATER``."""
        stream = self.inputs.get(stream_id)
        if stream is not None and stream.stored & 1 and not stream.busy:
            self.now = now
            self._go_on(stream, b"", 0, 0)

    def flush(self, now: int) -> None:
        """Sends everything that was built and not sent."""
        for stream_id in self.outputs:
            self.outputs[stream_id].flush(self.send, now)

    def heartbeats(self, now: int) -> None:
        """Sends the HEARTBEATs that are due."""
        for stream_id in self.outputs:
            self._heartbeat(self.outputs[stream_id], now)

    def control(self, kind: int, n: int) -> int:
        """Begins a message on stream 0 with one submessage of ``n`` (up to 24) bytes; the offset of its payload in
        ``control_buffer``. ``send_control`` completes it."""
        at = len(self.head)
        buf = self._control
        buf[at] = kind
        buf[at + 1] = _LITTLE_ENDIAN
        buf[at + 2] = n
        return at + _HEAD

    def control_buffer(self) -> bytearray:
        """Where ``control`` reserves."""
        return self._control

    def send_control(self) -> None:
        """Sends the message that ``control`` began."""
        at = len(self.head)
        self.send(self._control, 0, at + _HEAD + self._control[at + 2])

    def reset(self) -> None:
        """All streams, both ways, begin again with number 0; what they keep is dropped."""
        for streams in (self.inputs, self.outputs):
            for stream_id in streams:
                streams[stream_id].reset()

    def _on_stream(self, buf: "Buffer", off: int, n: int) -> None:
        stream = self.inputs.get(buf[off + 1]) or self.make_input(buf[off + 1])
        if stream is None:
            self.malformed += 1
        elif not stream.accept(buf[off + 2] | buf[off + 3] << 8, buf, off, n):
            if stream.reliable:
                self._acknack(stream)
        elif stream.reliable:
            self._go_on(stream, buf, off, n)
        else:
            self._submessages(buf, off + len(self.head), off + n, stream)

    def _go_on(self, stream: "Any", buf: "Buffer", off: int, n: int) -> None:
        """Handles what is in order now and acknowledges: first the expected message, which is the one that is kept
        or else ``buf[off:off + n]``, then those kept behind it. What a submessage sets off may lead back here; the
        outer call goes on then."""
        if not stream.busy:
            stream.busy = True
            try:
                while stream.ready() or n:
                    if stream.stored & 1:
                        buf = stream.buf
                        off = stream.base
                        n = stream.size
                    number = stream.expected
                    at = off + (stream.resume_at or len(self.head))
                    at = self._submessages(buf, at, off + n, stream)
                    if not stream.busy:
                        break  # a submessage has reset the streams: number 0 comes next
                    if stream.expected == number:  # no HEARTBEAT in the message gave it up
                        if at != _DONE:
                            if not stream.stored & 1:
                                stream.store(number, buf, off, n)
                            stream.resume_at = at - off
                            break
                        stream.advance(1)
                    n = 0
            finally:
                stream.busy = False
        self._acknack(stream)

    def _acknack(self, stream: "Any") -> None:
        bitmap = stream.missing()
        self._tell(_ACKNACK, stream.stream_id, stream.expected, bitmap >> 8 | (bitmap & 255) << 8)

    def _tell(self, kind: int, stream_id: int, first: int, second: int) -> None:
        """Sends an ACKNACK or a HEARTBEAT."""
        kind = self.control(kind, 5)
        pack_into("<HH", self._control, kind, first, second)
        self._control[kind + 4] = stream_id
        self.send_control()

    def _heartbeat(self, stream: "Any", now: int) -> None:
        if stream.first != stream.sent and ticks_diff(now, stream.due) >= 0:
            stream.due = ticks_add(now, stream.period)
            self._tell(_HEARTBEAT, stream.stream_id, stream.first, stream.sent - 1 & 0xFFFF)

    def _submessages(self, buf: "Buffer", pos: int, end: int, stream: "Any") -> int:
        """Handles the submessages from ``pos`` on; the position of the one that is to wait, or ``_DONE``.

        Up to 3 bytes behind the last one are padding, which may hold anything.
        """
        while end - pos >= _HEAD:
            kind = buf[pos]
            n = buf[pos + 2] | buf[pos + 3] << 8
            at = pos + _HEAD
            if n > end - at:
                self.malformed += 1
                break
            if n == 0 and (kind == _WRITE_DATA or kind == _DATA):
                n = end - at  # a sample too long for the length field runs to the end of the message
            result = 0
            if kind == _ACKNACK:
                if n >= 5:
                    self._on_acknack(buf, at, buf[pos + 1])
            elif kind == _HEARTBEAT:
                if n >= 5:
                    self._on_heartbeat(buf, at, buf[pos + 1])
            elif kind == _FRAGMENT:
                if stream is not None and stream.reliable:
                    result = self._on_fragment(stream, buf, at, n, buf[pos + 1] & _LAST_FRAGMENT)
            else:
                result = self._handle(kind, buf[pos + 1], buf, at, n, stream.stream_id if stream else 0)
            if result:
                if result == _LATER:
                    return pos
                if self.stop_at_failure:
                    break
            pos = at + (n + 3 & ~3)
        return _DONE

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

    def _on_heartbeat(self, buf: "Buffer", at: int, flags: int) -> None:
        stream_id = buf[at + 4]
        if stream_id < _STREAM_RELIABLE:
            self._tell(_ACKNACK, stream_id, 0, 0)
            return
        stream = self.inputs.get(stream_id) or self.make_input(stream_id)
        if stream is not None:
            flags &= _LITTLE_ENDIAN
            stream.announce(
                buf[at + flags] << 8 | buf[at + 1 - flags], buf[at + 2 + flags] << 8 | buf[at + 3 - flags]
            )
            self._go_on(stream, buf, 0, 0)

    def _on_fragment(self, stream: "Any", buf: "Buffer", at: int, n: int, last: int) -> int:
        """Takes a piece; ``LATER`` when the joined submessage has to wait."""
        from muros.xrce.fragments import take

        return take(self, stream, buf, at, n, last)
