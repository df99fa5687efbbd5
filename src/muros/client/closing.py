"""The ends: entities are destroyed, sessions take leave of their agent."""

from muros.client.link import WAITING
from muros.compat import const
from muros.xrce.create import head

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client.entities import Entity
    from muros.client.session import Session
    from muros.xrce._types import Buffer

_DELETE = const(3)
_LITTLE_ENDIAN = const(0x01)
_OBJECT_CLIENT = const(0xFFFE)
_REQUEST_LOGOUT = const(2)
_ATTEMPTS = const(10)
_PATIENCE = const(100)  # ms for each attempt


def destroy(entity: "Entity") -> None:
    """Forgets an entity and has the agent delete its objects, after what was written before; waits for nothing."""
    session = entity.session
    if entity not in session.entities:
        return
    session.entities.remove(entity)
    if entity.todo:
        session.pending -= 1
    for step in range(entity.steps):
        if entity.asked >> step & 1:
            session.waiting -= 1
    entity.todo = entity.status = 1
    session.objects.pop(entity.object_id(entity.steps - 1), None)
    backlog = session.keep()
    for step in (0, 2, 1) if entity.steps == 3 else (0,):
        data = bytearray(8)
        head(data, 0, _DELETE, _LITTLE_ENDIAN, 4, session.requests(1), entity.object_id(step))
        backlog.items.append(data)


def leave(session: "Session") -> None:
    """Asks the agent once to delete the session."""
    at = session.control(_DELETE, 4)
    out = session.control_buffer()
    out[at] = 0
    out[at + 1] = _REQUEST_LOGOUT
    out[at + 2] = _OBJECT_CLIENT >> 8
    out[at + 3] = _OBJECT_CLIENT & 255
    session.send_control()


def close(session: "Session") -> None:
    """Deletes the session at the agent, in at most ten attempts of 100 ms, and closes the transport for good."""
    transport = session.transport
    try:
        for _ in range(_ATTEMPTS):
            if session.login or not session.up:
                break
            leave(session)
            transport.wait(_PATIENCE)
            transport.receive(session.deliver)
    except OSError:
        pass
    transport.close()
    closed: "Any" = Closed()
    session.transport = closed
    session.send = closed.send
    session.up = False
    session.login = True
    session.enter(WAITING)


class Closed:
    """What a session that was closed has in place of its transport."""

    mtu = 0

    def open(self) -> bool:
        """Never."""
        return False

    close = open

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Drops the message."""
