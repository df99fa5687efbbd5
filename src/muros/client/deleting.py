"""The end of an entity. Boards borrow this."""

from muros.client.entities import object_id, steps
from muros.client.requests import keep
from muros.compat import const
from muros.xrce.requests import head

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.session import Entity

_DELETE = const(3)
_LITTLE_ENDIAN = const(0x01)
_STEPS = const(0x0F)
_REFUSED = const(0x10)


def destroy(entity: "Entity") -> None:
    """Forgets an entity and has the agent delete its objects, after what was written before; waits for nothing."""
    session = entity.session
    if entity not in session.entities:
        return
    session.entities.remove(entity)
    if entity.todo & _STEPS:
        session.pending -= 1
    entity.todo = _REFUSED
    entity.status = 1
    session.objects.pop(entity.id, None)
    backlog = keep(session)
    for step in (3, 1, 2):
        if steps(entity) >> step & 1:
            session.asked.pop(entity.request - step, None)
            data = bytearray(8)
            head(data, 0, _DELETE, _LITTLE_ENDIAN, 4, session.number(), object_id(entity, step))
            backlog.items.append(data)
