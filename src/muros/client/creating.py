"""How a session creates its entities at the agent, anew after each time it was accepted.

Requests go out a few at a time and in the order of adding, each matched with its STATUS by request id and object id and
asked for again when none comes; creating twice does no harm, as REUSE and REPLACE are set. A refused entity is reported
and left alone, the others go on. Rules of the wire: DDS-XRCE 1.0, clauses 7.8.3 and 7.8.5. Boards borrow this.
"""

from muros.client.entities import UNLIMITED, object_id, steps
from muros.client.names import dds_type, topic_name
from muros.client.requests import keep, requests, submit
from muros.compat import const, ticks_add, ticks_diff
from muros.xrce import create as binary
from muros.xrce.resetting import reset

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client.session import Entity, Session

_CREATE = const(1)
_READ_DATA = const(8)
_LITTLE_ENDIAN = const(0x01)
_CREATE_FLAGS = const(0x07)  # little endian, REUSE and REPLACE
_KIND_PARTICIPANT = const(1)
_KIND_DATAWRITER = const(5)
_PARENT_BITS = const(12)
_QOS_RELIABLE = const(0x01)
_STREAM_BEST_EFFORT = const(0x01)
_STREAM_RELIABLE = const(0x80)
_ERROR = const(0x80)
_AT_ONCE = const(8)  # requests in flight: an agent with 16 unacknowledged messages loses a STATUS
_STEPS = const(0x0F)  # the bits of ``todo``: steps without a good STATUS, requests under way, refused
_ALL_ASKED = const(0xF0)
_ASKED = const(4)
_REFUSED = const(0x100)

_PROBLEM_ENTITY = const(3)
_PROBLEM_READ = const(4)
_PROBLEM_NO_ANSWER = const(5)


def accepted(session: "Session") -> None:
    """Begins the streams again and has every entity created."""
    if session.reliable.first != session.reliable.next or session.backlog is not None:
        keep(session).hold()
    reset(session)
    session.waiting = 0
    session.pending = len(session.entities)
    for entity in session.entities:
        renew(entity)


def renew(entity: "Entity") -> None:
    """Everything is to be created again."""
    entity.request = 0
    if entity.status:
        entity.status = 0
    entity.todo = (1 << steps(entity) + (entity.id & 15 > _KIND_DATAWRITER)) - 1


def work(session: "Session", now: int) -> None:
    """Creates what is to be created."""
    if session.waiting and ticks_diff(now, session.notes["late"]) >= 0:
        session.waiting = 0
        for entity in session.entities:
            entity.todo &= ~_ALL_ASKED
        session.notes["laps"] += 1
        if session.notes["laps"] == 3:
            session.problem(_PROBLEM_NO_ANSWER)
    for entity in session.entities:
        if entity.todo & _STEPS and not _create(session, entity, now):
            break


def status(session: "Session", request: int, object_id: int, status: int) -> None:
    """Takes a STATUS."""
    for entity in session.entities:
        if _answered(session, entity, request - entity.request, object_id, status):
            return


def _create(session: "Session", entity: "Entity", now: int) -> bool:
    """Makes the requests that are not made yet; False when there is no room for them now."""
    count = steps(entity)
    if entity.request == 0:
        entity.request = requests(session, count + 1)
    for step in range(count):
        if entity.todo >> step & 1 and not entity.todo >> step + _ASKED & 1:
            if session.waiting >= _AT_ONCE or not submit(
                session,
                _CREATE,
                _CREATE_FLAGS,
                entity.request + step,
                object_id(entity, step),
                variant(entity, step),
            ):
                return False
            entity.todo |= 1 << step + _ASKED
            session.waiting += 1
            session.notes["late"] = ticks_add(now, session.notes["creation_timeout"])
    if entity.todo == 1 << count:
        if not submit(
            session, _READ_DATA, _LITTLE_ENDIAN, entity.request + count, entity.id, _reading(entity)
        ):
            return False
        entity.todo = 0
        session.pending -= 1
    return True


def _answered(session: "Session", entity: "Entity", step: int, number: int, status: int) -> bool:
    """Takes the STATUS of request number ``step`` of an entity; False when that is none of its."""
    count = steps(entity)
    if not 0 <= step <= count:
        return False
    if step == count:
        if status < _ERROR or entity.id != number:
            return False
        session.problem(_PROBLEM_READ, status, entity.name)
        return True
    if not entity.todo >> step + _ASKED & 1 or object_id(entity, step) != number:
        return False
    session.waiting -= 1
    session.notes["laps"] = 0
    entity.todo &= ~(1 << step + _ASKED)
    if entity.todo >> step & 1:
        entity.todo &= ~(1 << step)
        if status >= _ERROR:
            entity.status = status
            entity.todo = entity.todo & _ALL_ASKED | _REFUSED
        if not entity.todo & _STEPS:
            session.pending -= 1
        if status >= _ERROR:
            session.problem(_PROBLEM_ENTITY, status, entity.name)
    return True


def variant(entity: "Entity", step: int) -> bytes:
    """The representation of an object."""
    create: "Any" = entity.session.notes["create"] or binary
    kind = entity.id & 15
    made: bytes
    if kind == _KIND_PARTICIPANT:
        made = create.participant(entity.name, entity.domain)
        return made
    parent = (entity.above & (1 << _PARENT_BITS) - 1) << 4 | _KIND_PARTICIPANT
    if steps(entity) == 1:
        made = create.service(
            kind,
            entity.name,
            dds_type(entity.type_name, "_Request"),
            dds_type(entity.type_name, "_Response"),
            topic_name("rq", entity.name, "Request"),
            topic_name("rr", entity.name, "Reply"),
            parent,
        )
    elif step == 0:
        made = create.topic(entity.name, dds_type(entity.type_name), parent)
    elif step == 1:
        made = create.group(kind - 2, parent)
    else:
        made = create.endpoint(
            kind,
            entity.above >> _PARENT_BITS,
            entity.qos,
            entity.id - 2,
            entity.name,
            dds_type(entity.type_name),
        )
    return made


def _reading(entity: "Entity") -> bytes:
    """The read specification: by default everything, for ever."""
    samples, seconds, rate, pace = getattr(entity, "limits", None) or (UNLIMITED, 0, 0, 0)
    stream_id = _STREAM_RELIABLE if entity.qos.flags & _QOS_RELIABLE else _STREAM_BEST_EFFORT
    return binary.read_data(stream_id, samples, seconds, rate, pace)
