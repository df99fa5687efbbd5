"""Streams begin again with number 0. Boards borrow this."""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce.session import SessionCore
    from muros.xrce.streams import Input, Output


def reset(self: "SessionCore") -> None:
    """All streams of a session, both ways, begin again; what they keep is dropped."""
    for stream in self.inputs.values():
        reset_input(stream)
    for stream in self.outputs.values():
        reset_output(stream)


def reset_output(self: "Output") -> None:
    """Begins again with number 0; every kept message is dropped."""
    self.first = self.sent = self.next = self._again = self._again_at = 0


def reset_input(self: "Input") -> None:
    """Expects number 0 again; kept messages are dropped."""
    self.expected = self.known = 0
    self.early.clear()
    self.busy = False
    self.fragments = None
