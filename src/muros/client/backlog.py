"""What cannot go out at once: samples larger than a message, samples that wait, samples to be sent once more.

Items are whole submessages in the order in which they leave. The first of them that does not fit a message is cut
into fragments as acknowledgements make room; its bytes are kept until the last fragment is acknowledged, so that it
can be sent again whole; those of a streamed sample the program gives again, see ``pieces``. When a session begins
anew, ``hold`` takes over every WRITE_DATA that the agent has not acknowledged (DDS-XRCE 1.0, 8.4.10 to 8.4.14). Boards
borrow this for as long as there is a backlog.
"""

from muros.client.session import put
from muros.compat import borrow, const
from muros.xrce.fragments import Cutter
from muros.xrce.requests import add, head

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client._types import Outgoing
    from muros.client.session import Session
    from muros.xrce._types import Buffer

_CONNECTED = const(2)
_WRITE_DATA = const(7)
_WRITE = const(0x0107)  # a WRITE_DATA, little endian
_FRAGMENT = const(13)
_LASTING = b"\3\7"  # DELETE and WRITE_DATA: the rest is asked for anew
_HEAD = const(4)

_OFFLINE = const(0)  # causes of what is dropped, see ``methods``
_FULL = const(1)
_TOO_LARGE = const(2)


class Backlog:
    """The backlog of a session."""

    def __init__(self, session: "Session") -> None:
        self.session = session
        self.items: "list[Any]" = []  # bytes, or Pieces
        self.cutter: "Cutter | None" = None
        self._cut: "Any" = None  # in fragments, the last one not acknowledged
        self._held: "list[Any]" = []

    def defer(self, writer: "Any", message: "Outgoing", n: int) -> bool:
        """Sends a sample of ``n`` bytes if it can go out now, else queues it, or counts and reports it."""
        session = self.session
        stream = writer.stream
        ready = session.state == _CONNECTED and writer.todo == 0
        if writer.status or (not ready and not (stream.reliable and session.queue)):
            return session.dropped(_OFFLINE, n, writer)
        large = n + _HEAD > stream.capacity
        waits = not ready or large or (stream.reliable and (self.items or self._cut))
        if not waits and put(writer, message, n):
            return True
        if not stream.reliable:
            return session.dropped(_TOO_LARGE if large else _FULL, n, writer)
        if len(self.items) >= (session.queue or (1 if large or self._cut else 0)):
            return session.dropped(_FULL, n, writer)
        if large and hasattr(message, "piece"):
            data: "Any" = borrow("muros.client.pieces").make(session, writer, message, n)
        else:
            data = bytearray(2 * _HEAD + n)
            data[: 2 * _HEAD] = head(_WRITE, n + _HEAD, session.number(), writer.id)
            message.write(data, 2 * _HEAD)
        self.items.append(data)
        self.pump()
        return True

    def first(self, data: "bytes | bytearray") -> bool:
        """Puts a large request before everything that waits; False while another one is being cut."""
        if self.cutter is not None or self._cut is not None:
            return False
        self.items.insert(0, data)
        self.pump()
        return True

    def pump(self) -> None:
        """Moves into the stream what it has room for; ends the backlog when nothing is left."""
        session = self.session
        stream = session.reliable
        items = self.items
        if self._cut is not None and self.cutter is None:
            if stream.first != stream.next:
                return
            data, self._cut = self._cut, None
            if hasattr(data, "end"):
                data.end(True)
        while items:
            data = items[0]
            if self.cutter is None:
                if data[0] == _WRITE_DATA and (session.state != _CONNECTED or session.pending):
                    break
                if len(data) - _HEAD <= stream.capacity:
                    if not add(stream, data):
                        break
                    items.pop(0)
                    continue
                self._cut = data
                self.cutter = data.cutter() if hasattr(data, "end") else Cutter(data)
            if self.cutter.pump(stream):
                self.cutter = None
                items.pop(0)
            break
        stream.flush(session.send, session.now)
        if not items and self._cut is None:
            session.backlog = None

    def hold(self) -> None:
        """Takes over what the agent has not acknowledged, before the streams begin again."""
        stream = self.session.reliable
        stream.transmit(stream.first, stream.next, self._take)
        if self.cutter is not None:
            self.items.pop(0)  # its first fragments are under way
            self._take_cut()
        self.items[:0] = self._held
        self._held.clear()
        self.cutter = self._cut = None

    def _take(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes the WRITE_DATA and DELETE out of a message that was sent."""
        pos = self.session.body
        while pos + _HEAD <= n:
            at = off + pos
            size = _HEAD + (buf[at + 2] | buf[at + 3] << 8)
            if buf[at] == _FRAGMENT:
                self._take_cut()
            elif buf[at] in _LASTING:
                self._held.append(bytes(memoryview(buf)[at : at + size]))
            pos += size + 3 & ~3

    def _take_cut(self) -> None:
        """Takes the sample that is being sent in fragments, once and whole; a request is made anew instead."""
        if self._cut is not None and self._cut[0] == _WRITE_DATA:
            self._held.append(self._cut)
        self._cut = None
