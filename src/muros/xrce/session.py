"""A session without I/O: the header of its messages, its streams and their acknowledgements, for either role.

The core answers what belongs to the streams itself (ACKNACK, HEARTBEAT, FRAGMENT) and gives every other submessage
to ``handle(kind, buf, off, n)``, behind its header in ``buf``; where that returns a number other than 0, the rest of
the message is passed over. Messages leave through ``send(buf, off, n)``, whose bytes are only lent.

What differs between the roles are values: the heartbeat period, the windows, and whether streams a peer names come
into being (an agent's) or not (a client's). What only hosts need is in ``queues``.

Here is what runs while no message is lost. Boards borrow the rest: ``beginning``, ``mending``, ``fragments``.
"""

from struct import pack_into

from muros.compat import borrow, const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.xrce._types import Buffer, Send

_FRAGMENT = const(13)
_ACKNACK = const(10)
_HEARTBEAT = const(11)
_WRITE_DATA = const(7)
_DATA = const(9)
_LITTLE_ENDIAN = const(0x01)
_STREAM_RELIABLE = const(0x80)
_HEAD = const(4)
_CONTROL = const(8)  # where the submessage of a control message lies in its buffer, behind the longest header


class SessionCore:
    """The streams of one session and the messages that keep them whole; ``beginning.begin`` has its arguments."""

    mender: "Any" = None  # the module ``mending``, once it was needed

    if TYPE_CHECKING:
        head: bytearray  # the header of messages: session id, stream, number, key
        body: int  # where the submessages of a message begin: the length of its header
        send: "Send"
        inputs: "dict[int, Any]"
        outputs: "dict[int, Any]"
        now: int
        malformed: int
        foreign: int  # acknowledgements in a row of what was never sent
        probe: int  # the client's, see there
        stream: "Any"  # of the submessage that is being handled; None for none
        largest: int  # the longest joined submessage taken, in bytes
        _control: bytearray

        def handle(self, kind: int, buf: "Buffer", off: int, n: int) -> int:
            """Takes a submessage, which lies behind its header; not 0: the rest of the message is passed over."""

        def make_input(self, stream_id: int) -> "Any":
            """The input stream for an id not used yet; None refuses it."""

        def too_long(self, n: int) -> None:
            """A joined submessage of ``n`` bytes on ``stream`` was longer than ``largest`` and was passed over."""

        def stranger(self, buf: "Buffer", at: int) -> None:
            """The peer acknowledges what was never sent; ``at`` is where its ACKNACK says what."""

    def receive(self, buf: "Buffer", off: int, n: int, now: int) -> bool:
        """Takes one message; False when it is not one of this session."""
        if n < self.body or buf[off] != self.head[0]:
            return False
        self.now = now
        if buf[off + 1]:
            _take(self, buf, off, n)
        else:
            submessages(self, buf, off, n, None)
        return True

    def mend(self) -> "Any":
        """The module ``mending``, kept from its first use on."""
        if self.mender is None:
            self.mender = borrow("muros.xrce.mending")
        return self.mender

    def take_next(self, stream: "Any", buf: "Buffer", off: int, n: int) -> bool:
        """Handles the message that a reliable stream expects. False: the stream is held, and that was acknowledged."""
        number = stream.expected
        stream.busy = True
        try:
            submessages(self, buf, off, n, stream)
            if stream.busy and stream.expected == number:  # neither reset nor given up meanwhile
                stream.expected = number + 1 & 0xFFFF
                if stream.known:
                    stream.known -= 1
        finally:
            stream.busy = False
        return True

    def _on_acknack(self, buf: "Buffer", at: int) -> None:
        stream = self.outputs.get(buf[at + 4])
        if stream and stream.reliable:
            if stream.acknowledge(number_at(buf, at, 0), self.send, self.now):
                self.foreign = self.probe = 0
                bitmap = buf[at + 2] << 8 | buf[at + 3]
                if bitmap:
                    self.mend().resend(stream, bitmap, self.send, self.now)
            else:
                self.stranger(buf, at)

    def _on_fragment(self, buf: "Buffer", at: int, n: int, stream: "Any") -> None:
        if stream.fragments is None:
            stream.fragments = borrow("muros.xrce.fragments").Joiner(self.largest)
        stream.fragments.take(self, stream, buf, at, n)


# Functions, as a board finds them sooner than methods of a base class.


def _take(session: SessionCore, buf: "Buffer", off: int, n: int) -> None:
    """Takes a message of a stream."""
    stream = session.inputs.get(buf[off + 1]) or session.make_input(buf[off + 1])
    if stream is None:
        session.malformed += 1
        return
    ahead = (buf[off + 2] | buf[off + 3] << 8) - stream.expected & 0xFFFF
    if not stream.reliable:
        if ahead < 0x7FFF:
            stream.lost += ahead
            stream.expected = stream.expected + ahead + 1 & 0xFFFF
            submessages(session, buf, off, n, stream)
    elif ahead or stream.known or stream.busy:
        session.mend().take(session, stream, ahead, buf, off, n)
    elif session.take_next(stream, buf, off, n):
        if stream.known:
            session.mend().go_on(session, stream)
        else:
            tell(session, _ACKNACK, stream.stream_id, stream.expected, 0)


def flush(session: SessionCore, stream: "Any", now: int) -> None:
    """Sends what was built on a reliable stream and not sent, and the HEARTBEAT that is due."""
    if stream.first != stream.next:
        stream.flush(session.send, now)
        if ticks_diff(now, stream.due) >= 0:
            stream.due = ticks_add(now, stream.period)
            tell(session, _HEARTBEAT, stream.stream_id, stream.first, stream.sent - 1 & 0xFFFF)


def tell(session: SessionCore, kind: int, stream_id: int, first: int, second: int) -> None:
    """Sends an ACKNACK or a HEARTBEAT."""
    pack_into("<HHB", session._control, _CONTROL + _HEAD, first, second, stream_id)
    control(session, kind, 5)


def control(session: SessionCore, kind: int, n: int) -> None:
    """Sends a submessage whose ``n`` bytes of payload are in place, in a message of no stream."""
    buf = session._control
    buf[_CONTROL] = kind
    buf[_CONTROL + 2] = n
    session.send(buf, _CONTROL - session.body, session.body + _HEAD + n)


def submessages(session: SessionCore, buf: "Buffer", off: int, n: int, stream: "Any") -> None:
    """Handles the submessages of a message. Up to 3 bytes behind the last are padding, which may hold anything."""
    n += off
    off += session.body
    while off <= n - _HEAD:
        off += _HEAD
        size = buf[off - 2] | buf[off - 1] << 8
        if size == 0 and (buf[off - 4] == _WRITE_DATA or buf[off - 4] == _DATA):
            size = n - off  # too long for the length field: it ends with the message
        if size > n - off:
            session.malformed += 1
            break
        session.stream = stream  # what was handled before may have led to other messages
        if _submessage(session, buf, off, size):
            break
        off += size + 3 & ~3


def _submessage(session: SessionCore, buf: "Buffer", at: int, n: int) -> int:
    """Handles a submessage; not 0 when the rest of the message is passed over."""
    kind = buf[at - 4]
    if kind == _ACKNACK:
        if n >= 5:
            session._on_acknack(buf, at)
    elif kind == _HEARTBEAT:
        if n >= 5:
            _on_heartbeat(session, buf, at)
    elif kind != _FRAGMENT:
        return session.handle(kind, buf, at, n)
    elif session.stream is not None and session.stream.reliable:
        session._on_fragment(buf, at, n, session.stream)
    return 0


def _on_heartbeat(session: SessionCore, buf: "Buffer", at: int) -> None:
    stream_id = buf[at + 4]
    if stream_id < _STREAM_RELIABLE:
        tell(session, _ACKNACK, stream_id, 0, 0)
        return
    stream = session.inputs.get(stream_id) or session.make_input(stream_id)
    if stream is None:
        pass
    elif stream.known or number_at(buf, at, 2) != stream.expected - 1 & 0xFFFF:
        session.mend().heartbeat(session, stream, buf, at)
    else:
        tell(session, _ACKNACK, stream_id, stream.expected, 0)  # it asks about what is here


def number_at(buf: "Buffer", at: int, i: int) -> int:
    """The sequence number ``i`` bytes into an ACKNACK or HEARTBEAT, whose flags tell the order of its bytes."""
    little = buf[at - 3] & _LITTLE_ENDIAN
    at += i
    return buf[at + little] << 8 | buf[at + 1 - little]
