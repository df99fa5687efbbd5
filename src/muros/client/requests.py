"""Requests of a session, in its reliable stream. Boards borrow this."""

from muros.compat import borrow, const
from muros.xrce.requests import head

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.backlog import Backlog
    from muros.client.session import Session


def submit(
    self: "Session", kind: int, flags: int, request: int, object_id: int, payload: "bytes | bytearray"
) -> bool:
    """Puts a submessage with ids into the reliable stream; False when there is no room now."""
    n = 4 + len(payload)
    stream = self.reliable
    backlog = self.backlog
    at = -1 if backlog is not None and backlog.cutter is not None else stream.place(n)
    if at < 0:
        if n <= stream.capacity:
            return False
        data = bytearray(4 + n)
        head(data, 0, kind, flags, n, request, object_id)
        data[8:] = payload
        return keep(self).first(data)
    head(stream.buf, at, kind, flags, n, request, object_id)
    stream.buf[at + 8 : at + 4 + n] = payload
    stream.commit(at, n)
    return True


def keep(self: "Session") -> "Backlog":
    """The backlog, made at the first need."""
    if self.backlog is None:
        self.backlog = borrow("muros.client.backlog").Backlog(self)
    return self.backlog
