"""Receivers when they are made and begin again. See ``streams``. Boards borrow this."""

from muros.compat import const
from muros.xrce.resetting import reset_input

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce.streams import Input

_STREAM_RELIABLE = const(0x80)


def make(stream_id: int, mtu: int = 0, window: int = 1) -> "Input":
    """A receiver, reliable when its id is: then messages that come early are kept, less than ``window`` of them, each
    up to ``mtu`` bytes."""
    from muros.xrce.streams import Input

    made = Input()
    begin(made, stream_id, mtu, window)
    return made


def begin(self: "Input", stream_id: int, mtu: int = 0, window: int = 1) -> None:
    """Sets up a receiver; arguments as for ``make``."""
    self.stream_id = stream_id
    self.reliable = stream_id >= _STREAM_RELIABLE
    self.mtu = mtu
    self.window = window
    self.lost = 0
    self.early = {}
    reset_input(self)
