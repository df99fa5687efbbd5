"""Senders in moments that are rare: they are made, begin again, are asked. See ``streams``.

Boards borrow this; its functions are methods of ``streams.Output``.
"""

from array import array

from muros.compat import const
from muros.xrce.requests import reserve as reserve
from muros.xrce.resetting import reset_output

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Send
    from muros.xrce.streams import Output

_HEAD = const(4)
_STREAM_RELIABLE = const(0x80)

reset = reset_output


def make(stream_id: int, mtu: int, head: bytearray, history: int = 1, period: int = 0) -> "Output":
    """A sender. ``head`` is the session's header: session id, stream, number, and the key if it has one.

    ``history`` (a power of two) messages may wait to be sent and acknowledged. With an ``mtu`` of 0 there is no
    buffer to reserve in.
    """
    from muros.xrce.streams import Output

    made = Output()
    begin(made, stream_id, mtu, head, history, period)
    return made


def begin(
    self: "Output", stream_id: int, mtu: int, head: bytearray, history: int = 1, period: int = 0
) -> None:
    """Sets up a sender; arguments as for ``make``."""
    if history & history - 1 or not 0 < history <= 0x4000:
        raise ValueError("history is %d: it must be a power of two up to 16384" % history)
    self.stream_id = stream_id
    self.reliable = stream_id >= _STREAM_RELIABLE
    self.mtu = mtu
    self.history = history
    self.period = period
    self.due = 0
    self.buf = bytearray(mtu * history)
    self.resends = 0
    self._start = len(head)
    self._sizes = array("H", bytes(2 * history))
    for at in range(0, len(self.buf), mtu or 1):
        self.buf[at : at + self._start] = head
        self.buf[at + 1] = stream_id
    reset_output(self)


def capacity(self: "Output") -> int:
    """Longest payload in bytes that a message of its own can carry."""
    return self.mtu - self._start - _HEAD


def idle(self: "Output") -> bool:
    """Whether everything is sent and acknowledged."""
    return self.first == self.next


def unacknowledged(self: "Output", send: "Send") -> None:
    """Shows every kept message, oldest first: ``send(buf, off, n)``."""
    self.transmit(self.first, self.next, send)
