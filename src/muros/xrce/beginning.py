"""A session's core and its streams when they are made. See ``session`` and ``streams``. Boards borrow this."""

from muros.compat import const
from muros.xrce.requests import reset_input, reset_output

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Send
    from muros.xrce.session import SessionCore
    from muros.xrce.streams import Input, Output

_HEAD = const(4)
_LITTLE_ENDIAN = const(0x01)
_SESSION_NONE = const(0x80)
_STREAM_RELIABLE = const(0x80)
_CONTROL = const(8)
_LONGEST_CONTROL = const(28)  # with the header of the submessage


def begin(self: "SessionCore", session_id: int, key: bytes, send: "Send", largest: int) -> None:
    """Sets up a core. ``key`` is the client key, 4 bytes; ids below 0x80 carry it in every header.

    ``largest`` is the longest joined submessage taken, in bytes.
    """
    self.head = bytearray((session_id, 0, 0, 0))
    if session_id < _SESSION_NONE:
        self.head += key
    self.body = len(self.head)
    self.send = send
    self.inputs = {}
    self.outputs = {}
    self.now = self.malformed = self.foreign = self.probe = 0
    self.largest = largest
    self._control = bytearray(_CONTROL - self.body) + self.head + bytes(_LONGEST_CONTROL)
    self._control[_CONTROL + 1] = _LITTLE_ENDIAN


def make_output(stream_id: int, mtu: int, head: bytearray, history: int, period: int) -> "Output":
    """A sender. ``head`` is the session's header: session id, stream, number, and the key if it has one.

    ``history`` (a power of two) messages may wait to be sent and acknowledged. With an ``mtu`` of 0 there is no
    buffer to reserve in.
    """
    if history & history - 1 or not 0 < history <= 0x4000:
        raise ValueError("history is %d: it must be a power of two up to 16384" % history)
    from muros.xrce.streams import Output  # here, as it outlasts this module

    made = Output()
    made.stream_id = stream_id
    made.reliable = stream_id >= _STREAM_RELIABLE
    made.mtu = mtu
    made.history = history
    made.period = period
    made.due = made.resends = 0
    made.buf = bytearray(mtu * history)
    made._sizes = [0] * history
    made._start = len(head)
    made.capacity = mtu - made._start - _HEAD
    for slot in range(history):
        slot *= mtu
        made.buf[slot : slot + made._start] = head
        made.buf[slot + 1] = stream_id
    reset_output(made)
    return made


def make_input(stream_id: int, mtu: int, window: int) -> "Input":
    """A receiver, reliable when its id is: then messages that come early are kept, less than ``window`` of them, each
    up to ``mtu`` bytes."""
    from muros.xrce.streams import Input  # here, as it outlasts this module

    made = Input()
    made.stream_id = stream_id
    made.reliable = stream_id >= _STREAM_RELIABLE
    made.mtu = mtu
    made.window = window
    made.lost = 0
    made.early = {}
    reset_input(made)
    return made
