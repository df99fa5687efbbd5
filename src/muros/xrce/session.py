"""A session without I/O: the header of its messages, its streams and their acknowledgements, for either role.

The core answers what belongs to the streams itself (ACKNACK, HEARTBEAT, FRAGMENT) and gives every other submessage
to ``handle(kind, flags, buf, off, n, stream_id)``, which returns ``HANDLED``, ``FAILED`` or ``LATER``. ``LATER`` holds
the stream: this submessage and what follows on the stream stays unacknowledged until ``resume`` is called, which is
how a slow reader pushes back on a writer. Messages leave through ``send(buf, off, n)``, whose bytes are only lent.

What differs between the roles are values: the heartbeat period, the windows, and whether streams a peer names come
into being (an agent's) or not (a client's).
"""

from muros.compat import const

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
_HEAD = const(4)
_LONGEST_CONTROL = const(24)
_DONE = const(-1)

HANDLED = 0
FAILED = 1
LATER = 2


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
        self._control = bytearray(len(self.head) + _HEAD + _LONGEST_CONTROL)
        self._control_n = 0

    def receive(self, buf: "Buffer", off: int, n: int, now: int) -> bool:
        """Takes one message; False when it is not one of this session."""
        size = len(self.head)
        if n < size or buf[off] != self.head[0]:
            return False
        self.now = now
        stream_id = buf[off + 1]
        if stream_id == 0:
            self._submessages(buf, off, off + size, off + n, 0, None)
            return True
        stream = self.inputs.get(stream_id) or self.make_input(stream_id)
        if stream is None:
            self.malformed += 1
            return True
        number = buf[off + 2] | buf[off + 3] << 8
        what = stream.accept(number)
        if stream.reliable:
            if what == 1 and not stream.stored & 1:
                self._in_order(stream, buf, off, size, n)
            elif what == 1:
                self._go_on(stream)  # it is held: a part of it may be handled already
            elif what == 2:
                stream.store(number, buf, off, n)
            self._acknack(stream_id, stream.expected, stream.missing())
        elif what == 1:
            self._submessages(buf, off, off + size, off + n, stream_id, None)
        return True

    def resume(self, stream_id: int, now: int) -> None:
        """Goes on with a stream that was held by ``LATER``."""
        stream = self.inputs.get(stream_id)
        if stream is not None and stream.reliable and stream.stored & 1 and not stream.busy:
            self.now = now
            self._go_on(stream)
            self._acknack(stream_id, stream.expected, stream.missing())

    def flush(self, now: int) -> None:
        """Sends everything that was built and not sent."""
        for stream_id in self.outputs:
            self.outputs[stream_id].flush(self.send, now)

    def heartbeats(self, now: int) -> None:
        """Sends the HEARTBEATs that are due."""
        for stream_id in self.outputs:
            if stream_id >= _STREAM_RELIABLE:
                stream = self.outputs[stream_id]
                if stream.heartbeat_due(now):
                    last = stream.sent - 1 & 0xFFFF
                    at = self.control(_HEARTBEAT, 5)
                    buf = self._control
                    buf[at] = stream.first & 255
                    buf[at + 1] = stream.first >> 8
                    buf[at + 2] = last & 255
                    buf[at + 3] = last >> 8
                    buf[at + 4] = stream_id
                    self.send_control()

    def control(self, kind: int, n: int) -> int:
        """Begins a message on stream 0 with one submessage of ``n`` (up to 24) bytes; the offset of its payload in
        ``control_buffer``. ``send_control`` completes it."""
        buf = self._control
        head = self.head
        size = len(head)
        for i in range(size):
            buf[i] = head[i]
        buf[1] = buf[2] = buf[3] = 0
        buf[size] = kind
        buf[size + 1] = _LITTLE_ENDIAN
        buf[size + 2] = n
        buf[size + 3] = 0
        self._control_n = size + _HEAD + n
        return size + _HEAD

    def control_buffer(self) -> bytearray:
        """Where ``control`` reserves."""
        return self._control

    def send_control(self) -> None:
        """Sends the message that ``control`` began."""
        self.send(self._control, 0, self._control_n)

    def reset(self) -> None:
        """All streams, both ways, begin again with number 0; what they keep is dropped."""
        for stream_id in self.inputs:
            self.inputs[stream_id].reset()
        for stream_id in self.outputs:
            self.outputs[stream_id].reset()

    def make_input(self, stream_id: int) -> "Any":
        """The input stream for an id not used yet; None refuses it, as a client does: it makes its own at the start."""
        return None

    def _in_order(self, stream: "Any", buf: "Buffer", off: int, at: int, n: int) -> None:
        """Handles the expected message from ``at`` on, and those kept behind it. What a submessage sets off may lead
        back here; the outer call goes on then."""
        if stream.busy:
            return
        stream.busy = True
        try:
            while True:
                number = stream.expected
                held = self._submessages(buf, off, off + at, off + n, stream.stream_id, stream)
                if not stream.busy:
                    return  # a submessage has reset the streams: number 0 comes next
                if stream.expected != number:
                    more = stream.ready()  # a HEARTBEAT in the message gave it up
                elif held != _DONE:
                    if not stream.stored & 1:
                        stream.store(number, buf, off, n)
                    stream.resume_at = held - off
                    return
                else:
                    more = stream.advance()
                if not more:
                    return
                buf = stream.buf
                off = stream.base
                n = stream.size
                at = len(self.head)
        finally:
            stream.busy = False

    def _go_on(self, stream: "Any") -> None:
        """Handles the expected message, which is kept, from where it was held."""
        if stream.ready():
            at = stream.resume_at or len(self.head)
            self._in_order(stream, stream.buf, stream.base, at, stream.size)

    def _acknack(self, stream_id: int, first: int, bitmap: int) -> None:
        at = self.control(_ACKNACK, 5)
        buf = self._control
        buf[at] = first & 255
        buf[at + 1] = first >> 8
        buf[at + 2] = bitmap >> 8
        buf[at + 3] = bitmap & 255
        buf[at + 4] = stream_id
        self.send_control()

    def _submessages(
        self,
        buf: "Buffer",
        start: int,
        pos: int,
        end: int,
        stream_id: int,
        stream: "Any",
    ) -> int:
        """Handles the submessages from ``pos`` on; the position of the one that is to wait, or ``_DONE``.

        Up to 3 bytes behind the last one are padding, which may hold anything.
        """
        handle = self._handle
        while end - pos >= _HEAD:
            kind = buf[pos]
            flags = buf[pos + 1]
            n = buf[pos + 2] | buf[pos + 3] << 8
            at = pos + _HEAD
            if n > end - at:
                self.malformed += 1
                return _DONE
            if n == 0 and (kind == _WRITE_DATA or kind == _DATA):
                n = end - at  # a sample too long for the length field runs to the end of the message
            if kind == _ACKNACK:
                if n >= 5:
                    self._on_acknack(buf, at, flags)
            elif kind == _HEARTBEAT:
                if n >= 5:
                    self._on_heartbeat(buf, at, flags)
            elif kind == _FRAGMENT:
                if stream is not None and self._on_fragment(stream, buf, at, n, flags & _LAST_FRAGMENT):
                    return pos
            else:
                result = handle(kind, flags, buf, at, n, stream_id)
                if result == LATER:
                    return pos
                if result == FAILED and self.stop_at_failure:
                    return _DONE
            pos = start + (at + n - start + 3 & ~3)
        return _DONE

    def _on_acknack(self, buf: "Buffer", at: int, flags: int) -> None:
        stream = self.outputs.get(buf[at + 4])
        if stream is None or not stream.reliable:
            return
        first = buf[at] | buf[at + 1] << 8 if flags & _LITTLE_ENDIAN else buf[at] << 8 | buf[at + 1]
        if stream.acknowledge(first, buf[at + 2] << 8 | buf[at + 3], self.send, self.now):
            self.foreign = 0
        else:
            self.foreign += 1
            self.malformed += 1

    def _on_heartbeat(self, buf: "Buffer", at: int, flags: int) -> None:
        stream_id = buf[at + 4]
        if stream_id < _STREAM_RELIABLE:
            self._acknack(stream_id, 0, 0)
            return
        stream = self.inputs.get(stream_id) or self.make_input(stream_id)
        if stream is None:
            return
        if flags & _LITTLE_ENDIAN:
            first = buf[at] | buf[at + 1] << 8
            last = buf[at + 2] | buf[at + 3] << 8
        else:
            first = buf[at] << 8 | buf[at + 1]
            last = buf[at + 2] << 8 | buf[at + 3]
        stream.announce(first, last)
        if stream.stored & 1:
            self._go_on(stream)
        self._acknack(stream_id, stream.expected, stream.missing())

    def _on_fragment(self, stream: "Any", buf: "Buffer", at: int, n: int, last: int) -> bool:
        """Takes a piece; whether the joined submessage has to wait."""
        joiner = stream.fragments
        if joiner is None:
            from muros.xrce.fragments import Joiner

            joiner = stream.fragments = Joiner(self.largest)
        if joiner.add(buf, at, n, last):
            data = joiner.data
            held = self._submessages(data, 0, joiner.at, len(data), stream.stream_id, None)
            if held != _DONE:
                joiner.at = held
                return True
        elif last:
            self.malformed += 1
            if joiner.too_long:
                self.too_long(stream.stream_id, joiner.too_long)
        if last:
            joiner.clear()
        return False

    def too_long(self, stream_id: int, n: int) -> None:
        """A joined submessage of ``n`` bytes was longer than ``largest`` and was passed over."""
