"""The end of a session: it takes leave of its agent. Boards borrow this."""

from struct import pack_into

from muros.compat import borrow, const
from muros.xrce.session import control

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client.session import Session
    from muros.xrce._types import Buffer

_WAITING = const(0)
_LOGIN = const(1)  # how we are away, see ``link``
_DELETE = const(3)
_OBJECT_CLIENT = const(0xFFFE)
_REQUEST_LOGOUT = const(2)
_PAYLOAD = const(12)  # where that of a control message lies
_TIMEOUT = const(1000)
_PATIENCE = const(100)  # ms for each attempt


def leave(session: "Session") -> None:
    """Asks the agent once to delete the session."""
    pack_into(">HH", session._control, _PAYLOAD, _REQUEST_LOGOUT, _OBJECT_CLIENT)
    control(session, _DELETE, 4)


def close(session: "Session", left: int = _TIMEOUT) -> None:
    """Deletes the session at the agent, in attempts of 100 ms for ``left`` ms, and closes the transport for good."""

    def deliver(buf: "Buffer", off: int, n: int) -> None:
        if n > 1 and not buf[off + 1]:  # of no stream: the agent knows no session to acknowledge in
            session.deliver(buf, off, n)

    transport = session.transport
    try:
        while session.away != _LOGIN and session.up:
            leave(session)
            if left > 0:
                transport.wait(min(_PATIENCE, left))
                transport.receive(deliver)
            left -= _PATIENCE
            if left <= 0:
                break
    except OSError:
        pass
    transport.close()
    closed: "Any" = Closed()
    session.transport = closed
    session.send = closed.send
    session.up = False
    session.away = _LOGIN
    if session.state:  # as ``link.enter``, which would take a board the memory of all of ``link``
        session.state = _WAITING
        if session.on_state is not None:
            session.on_state(_WAITING)
    if session.backlog is not None:
        borrow("muros.client.pieces").close(session.backlog)


class Closed:
    """What a session that was closed has in place of its transport."""

    mtu = 0

    def open(self) -> bool:
        """Never."""
        return False

    close = open

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Drops the message."""
