"""A session without I/O: the header of its messages, its streams and their acknowledgements, for either role.

The core answers what belongs to the streams itself (ACKNACK, HEARTBEAT, FRAGMENT) and gives every other submessage
to ``handle(kind, flags, buf, off, n, stream_id)``, which returns ``HANDLED``, ``FAILED`` or ``LATER`` (see
``constants``). ``LATER`` holds the stream: this submessage and what follows on the stream stays unacknowledged until
``queues.resume`` is called, which is how a slow reader pushes back on a writer. Messages leave through
``send(buf, off, n)``, whose bytes are only lent.

What differs between the roles are values: the heartbeat period, the windows, and whether streams a peer names come
into being (an agent's) or not (a client's).

Here is what runs while no message is lost. Boards borrow the rest: ``beginning``, ``mending``, ``fragments``.
"""

from muros.compat import borrow, const, ticks_add, ticks_diff

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
_LATER = const(2)
_HEAD = const(4)
_CONTROL = const(8)  # where the submessage of a control message lies in its buffer, behind the longest header
_DONE = const(-1)
_WAITS = const(-2)


class SessionCore:
    """The streams of one session and the messages that keep them whole; ``beginning.begin`` has its arguments.

    ``stop_at_failure``: the rest of a message is not handled behind a submessage that failed (what the reference agent
    does).
    """

    stop_at_failure = True
    mender: "Any" = None  # the module ``mending``, once it was needed

    if TYPE_CHECKING:
        head: bytearray  # the header of messages: session id, stream, number, key
        send: "Send"
        inputs: "dict[int, Any]"
        outputs: "dict[int, Any]"
        now: int
        malformed: int
        foreign: int  # acknowledgements in a row of what was never sent
        probe: int  # the client's, see there
        largest: int  # the longest joined submessage taken, in bytes
        _handle: "Handle"
        _control: bytearray

        def make_input(self, stream_id: int) -> "Any":
            """The input stream for an id not used yet; None refuses it."""

        def too_long(self, stream_id: int, n: int) -> None:
            """A joined submessage of ``n`` bytes was longer than ``largest`` and was passed over."""

        def stranger(self, buf: "Buffer", at: int) -> None:
            """The peer acknowledges what was never sent; ``at`` is where its ACKNACK says what."""

    def receive(self, buf: "Buffer", off: int, n: int, now: int) -> bool:
        """Takes one message; False when it is not one of this session."""
        if n < len(self.head) or buf[off] != self.head[0]:
            return False
        self.now = now
        if buf[off + 1]:
            _take(self, buf, off, n)
        else:
            n += off
            submessages(self, buf, off + len(self.head), n, None)
        return True

    def mend(self) -> "Any":
        """The module ``mending``, kept from its first use on."""
        if self.mender is None:
            self.mender = borrow("muros.xrce.mending")
        return self.mender

    def _on_acknack(self, buf: "Buffer", at: int) -> None:
        stream = self.outputs.get(buf[at + 4])
        if stream and stream.reliable:
            first = buf[at - 3] & _LITTLE_ENDIAN  # tells which of the two bytes comes first
            first = buf[at + first] << 8 | buf[at + 1 - first]
            if stream.acknowledge(first, self.send, self.now):
                self.foreign = self.probe = 0
                first = buf[at + 2] << 8 | buf[at + 3]  # the bitmap
                if first:
                    self.mend().resend(stream, first, self.send, self.now)
            else:
                self.stranger(buf, at)

    def _on_fragment(self, stream: "Any", buf: "Buffer", at: int, n: int, last: int) -> int:
        """Takes a piece; ``LATER`` when the joined submessage has to wait."""
        if stream.fragments is None:
            stream.fragments = borrow("muros.xrce.fragments").Joiner(self.largest, stream.stream_id)
        held: int = stream.fragments.take(self, stream, buf, at, n, last)
        return held


# Functions, as a board finds them sooner than methods of a base class.


def _take(session: SessionCore, buf: "Buffer", off: int, n: int) -> None:
    """Takes a message of a stream."""
    number = buf[off + 2] | buf[off + 3] << 8
    stream = session.inputs.get(buf[off + 1]) or session.make_input(buf[off + 1])
    if stream is None:
        session.malformed += 1
    elif not stream.reliable:
        ahead = number - stream.expected & 0xFFFF
        if ahead < 0x7FFF:
            stream.lost += ahead
            stream.expected = number + 1 & 0xFFFF
            submessages(session, buf, off + len(session.head), off + n, stream)
    elif number != stream.expected or stream.known > 1 or stream.early or stream.busy:
        session.mend().take(session, stream, number, buf, off, n)
    else:
        _next(session, stream, buf, off, n)


def _next(session: SessionCore, stream: "Any", buf: "Buffer", off: int, n: int) -> None:
    """Handles the message that a reliable stream expects, and acknowledges it."""
    number = stream.expected
    stream.busy = True
    at = _DONE
    try:
        at = submessages(session, buf, off + len(session.head), off + n, stream)
    finally:
        number = stream.busy and stream.expected == number  # neither reset nor given up meanwhile
        stream.busy = False
    if number:
        if at != _DONE:
            session.mend().hold(session, stream, buf, off, n, at - off)
            return
        stream.expected = stream.expected + 1 & 0xFFFF
        if stream.known:
            stream.known -= 1
    if stream.early or stream.known:
        session.mend().go_on(session, stream, buf, 0, 0)
    else:
        tell(session, _ACKNACK, stream.stream_id, stream.expected, 0)


def flush(session: SessionCore, stream: "Any", now: int) -> None:
    """Sends what was built on a stream and not sent, and the HEARTBEAT that is due."""
    if stream.first != stream.next:
        stream.flush(session.send, now)
        if stream.first != stream.sent and ticks_diff(now, stream.due) >= 0:
            stream.due = ticks_add(now, stream.period)
            now = stream.sent - 1 & 0xFFFF
            tell(session, _HEARTBEAT, stream.stream_id, stream.first, now)


def tell(session: SessionCore, kind: int, stream_id: int, first: int, second: int) -> None:
    """Sends an ACKNACK or a HEARTBEAT."""
    buf = session._control
    buf[_CONTROL] = kind
    buf[_CONTROL + 2] = 5
    buf[_CONTROL + 4] = first & 255
    buf[_CONTROL + 5] = first >> 8
    buf[_CONTROL + 6] = second & 255
    buf[_CONTROL + 7] = second >> 8
    buf[_CONTROL + 8] = stream_id
    session.send(buf, _CONTROL - len(session.head), len(session.head) + 9)


def submessages(session: SessionCore, buf: "Buffer", pos: int, end: int, stream: "Any") -> int:
    """Handles the submessages from ``pos`` on; the position of the one that is to wait, or ``_DONE``.

    Up to 3 bytes behind the last one are padding, which may hold anything.
    """
    while 0 <= pos <= end - _HEAD:
        pos = _submessage(session, buf, pos, end, stream)
    return _WAITS - pos if pos <= _WAITS else _DONE


def _submessage(session: SessionCore, buf: "Buffer", pos: int, end: int, stream: "Any") -> int:
    """Handles a submessage; the position behind it, ``_DONE`` when the rest of the message is passed over, or
    ``_WAITS - pos`` when it is to wait."""
    if (buf[pos + 2] | buf[pos + 3] << 8) > end - pos - _HEAD:
        session.malformed += 1
        return _DONE
    if buf[pos + 2] or buf[pos + 3] or (buf[pos] != _WRITE_DATA and buf[pos] != _DATA):
        end = buf[pos + 2] | buf[pos + 3] << 8
    else:
        end -= pos + _HEAD  # a sample too long for the length field runs to the end of the message
    if buf[pos] == _ACKNACK:
        if end >= 5:
            session._on_acknack(buf, pos + _HEAD)
    else:
        stream = _other(session, buf, pos, end, stream)
        if stream:
            return _WAITS - pos if stream == _LATER else _DONE
    return pos + _HEAD + (end + 3 & ~3)


def _other(session: SessionCore, buf: "Buffer", pos: int, n: int, stream: "Any") -> int:
    """Handles any other submessage with ``n`` bytes of payload; not 0 when what is behind it is not to be handled."""
    at = pos + _HEAD
    result = 0
    if buf[pos] == _HEARTBEAT:
        if n >= 5:
            _on_heartbeat(session, buf, at)
    elif buf[pos] != _FRAGMENT:
        result = session._handle(buf[pos], buf[pos + 1], buf, at, n, stream.stream_id if stream else 0)
    elif stream is not None and stream.reliable:
        result = session._on_fragment(stream, buf, at, n, buf[pos + 1] & _LAST_FRAGMENT)
    return result if result == _LATER or session.stop_at_failure else 0


def _on_heartbeat(session: SessionCore, buf: "Buffer", at: int) -> None:
    stream = session.inputs.get(buf[at + 4])
    if (
        stream
        and stream.reliable
        and not stream.known
        and buf[at - 3] & _LITTLE_ENDIAN
        and buf[at + 2] | buf[at + 3] << 8 == stream.expected - 1 & 0xFFFF
    ):
        tell(session, _ACKNACK, stream.stream_id, stream.expected, 0)  # it asks about what is here
    else:
        session.mend().heartbeat(session, buf, at)
