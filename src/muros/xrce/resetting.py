"""Streams begin again with number 0. Boards borrow this."""

from muros.compat import MPY, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce.session import SessionCore
    from muros.xrce.streams import Input, Output


def reset(self: "SessionCore") -> None:
    """All streams of a session, both ways, begin again; what they keep is dropped."""
    for stream_id in self.inputs:
        reset_input(self.inputs[stream_id])
    for stream_id in self.outputs:
        if MPY:
            reset_output(self.outputs[stream_id])
        else:  # those of hosts have more to drop
            self.outputs[stream_id].reset()


def reset_output(self: "Output") -> None:
    """Begins again with number 0; every kept message is dropped."""
    self.first = self.sent = self.next = self._again = self._again_at = 0


def reset_input(self: "Input") -> None:
    """Expects number 0 again; kept messages are dropped."""
    self.expected = self.known = self.resume_at = 0
    self.early.clear()
    self.busy = False
    self.fragments = None
