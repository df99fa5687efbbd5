"""What programs and entities ask of a session now and then: to wait for an answer, to keep a sample, to end.

Boards borrow this; its functions are methods of ``session.Session``, and so are those of ``making``.
"""

from muros.compat import borrow, const, ticks_ms

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client._types import Outgoing
    from muros.client.backlog import Backlog
    from muros.client.session import Session
    from muros.xrce._types import Buffer
    from muros.xrce.streams import Input

_STREAM_BEST_EFFORT = const(0x01)
_CONNECTED = const(2)
_HEAD = const(4)
_OFFLINE = const(0)  # causes, as they are counted in ``drops``
_FULL = const(1)
_LARGEST = const(4)
_CODES = const(0xA0687)  # what problems they are, one digit for each, that of cause 0 last
_UNREACHABLE = const(9)


def ping(self: "Session", timeout: int = 1000, clock: "Callable[[], int]" = ticks_ms) -> bool:
    """Asks the agent, within the session: whether it answers within ``timeout`` ms and knows us."""
    answered: bool = borrow("muros.client.echo").ask(self, timeout, clock)
    return answered


def close(self: "Session") -> None:
    """Takes leave of the agent, for at most one second, and closes the transport."""
    borrow("muros.client.closing").close(self)


def make_input(self: "Session", stream_id: int) -> "Input | None":
    """The stream for best effort is made when something comes on it; there are no others."""
    if stream_id != _STREAM_BEST_EFFORT:
        return None
    made: "Input" = borrow("muros.xrce.beginning").make_input(stream_id, 0, 1)
    self.inputs[stream_id] = made
    return made


def keep(self: "Session") -> "Backlog":
    """The backlog, made at the first need."""
    if not self.backlog:
        self.backlog = borrow("muros.client.backlog").Backlog(self)
    return self.backlog


def defer(self: "Session", writer: "Any", message: "Outgoing", n: int) -> bool:
    """What becomes of a sample that cannot go out now: it is queued, cut up, or refused and counted."""
    if not (self.queue or self.backlog):
        if self.state != _CONNECTED or writer.todo:
            return dropped(self, _OFFLINE, n, writer)
        if n + _HEAD <= writer.stream.capacity:
            return dropped(self, _FULL, n, writer)
    return keep(self).defer(writer, message, n)


def dropped(self: "Session", cause: int, n: int, what: "object" = "") -> bool:
    """Counts a sample of ``n`` bytes in ``drops``, and tells ``on_problem``. False, as it was not taken."""
    count = self.drops[cause] + 1
    self.drops[cause] = count
    if count & count - 1 == 0:  # the 1st, 2nd, 4th, 8th...: never a flood
        self.problem(_CODES >> 4 * cause & 15, n, what)
    return False


def too_long(self: "Session", n: int) -> None:
    """A sample that came was larger than ``largest``."""
    dropped(self, _LARGEST, n)


def problem(self: "Session", code: int, value: int = 0, what: "object" = "") -> None:
    """Tells ``on_problem``."""
    try:
        if self.on_problem is not None:
            borrow("muros.client.problems").tell(self, code, value, what)
    except Exception as error:
        self.raised = error


def stranger(self: "Session", buf: "Buffer", at: int) -> None:
    """The agent acknowledges what was never sent."""
    self.lead().stranger(self, buf, at)


def gone(self: "Session", error: OSError) -> None:
    """There is no way to the agent any more."""
    self.up = False
    self.problem(_UNREACHABLE, 0, error)


def attempting(self: "Session", now: int) -> None:
    """An attempt to reach the agent is made; hosts have more to say about it."""


def __getattr__(name: str) -> "Any":
    return getattr(borrow("muros.client.making"), name)
