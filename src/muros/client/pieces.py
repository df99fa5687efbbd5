"""A sample whose bytes the program gives piece by piece, in a backlog among others that are there whole.

Boards borrow this for as long as such a sample is under way.
"""

from muros.compat import const, copy
from muros.xrce.fragments import Cutter
from muros.xrce.requests import head

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client.backlog import Backlog
    from muros.client.session import Session
    from muros.xrce.streams import Output

_WRITE = const(0x0107)  # a WRITE_DATA, little endian
_LAST_PIECE = const(0x030D)  # a FRAGMENT, little endian
_IDS = const(4)
_HEAD = const(8)  # of a WRITE_DATA, with its ids


class Pieces:
    """A WRITE_DATA in place of its bytes: ``head`` are the first of them, ``sample`` gives the others.

    ``failed``: they will never be whole, as the program has given them up.
    """

    failed = False

    def __init__(self, session: "Session", sample: "Any", n: int) -> None:
        self.session = session
        self.sample = sample
        self.head = b""
        self._n = n

    def __len__(self) -> int:
        return _HEAD + self._n

    def __getitem__(self, i: int) -> int:
        return self.head[i]

    def cutter(self) -> "PieceCutter":
        """What cuts it, from the first byte on."""
        whole: "Any" = self
        return PieceCutter(whole)

    def end(self, sent: bool) -> None:
        """Tells the program that the agent has all of it, or that it was given up."""
        try:
            self.sample.end(sent and not self.failed)
        except Exception as error:
            self.session.raised = error


class PieceCutter(Cutter):
    """Cuts such a sample."""

    data: "Any"

    def pump(self, stream: "Output") -> bool:
        """Puts as many pieces into ``stream`` as it has room for; whether the last one is in, or will never be."""
        data = self.data
        if not data.failed and not data.sample.cancelled:
            try:
                return super().pump(stream)
            except Exception as error:
                data.session.raised = error
        data.failed = True
        if self.done:  # the agent lets go of what it has: with an empty last piece it is no whole sample
            at = stream.place(0)
            if at < 0:
                return False
            stream.commit(at, _LAST_PIECE, 0)
        return True

    def put(self, buf: bytearray, off: int, n: int) -> None:
        """Writes the next ``n`` bytes."""
        at = self.done
        if at < _HEAD:
            k = min(_HEAD - at, n)
            copy(buf, off, self.data.head, at, k)
            off += k
            at += k
            n -= k
        if n:
            self.data.sample.piece(buf, off, n, at - _HEAD)


def make(session: "Session", writer: "Any", sample: "Any", n: int) -> Pieces:
    """Takes a sample of ``n`` bytes."""
    made = Pieces(session, sample, n)
    made.head = head(_WRITE, n + _IDS, session.number(), writer.id)
    sample.begin()
    return made


def close(backlog: "Backlog") -> None:
    """The session is closed: programs are told what will not be sent."""
    items = backlog.items
    if backlog._cut is not None and backlog._cut not in items:
        items.append(backlog._cut)
    for data in items:
        if isinstance(data, Pieces):
            data.end(False)
    backlog.session.backlog = None
