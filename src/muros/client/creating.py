"""How a session creates its entities at the agent, anew after each time it was accepted.

Requests go out a few at a time and in the order of adding, each matched with its STATUS by request id and object id and
asked for again when none comes; creating twice does no harm, as REUSE and REPLACE are set. A refused entity is reported
and left alone, the others go on. Rules of the wire: DDS-XRCE 1.0, clauses 7.8.3 and 7.8.5. Boards borrow this.
"""

from muros.client.entities import object_id, renew
from muros.client.names import dds_type, topic_name
from muros.compat import const, ticks_add, ticks_diff
from muros.xrce import create as binary
from muros.xrce.requests import add, head, reset

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client.session import Entity, Session

_CREATION = const(0x0701)  # little endian, REUSE and REPLACE
_READING = const(0x0108)  # little endian
_KIND_PARTICIPANT = const(1)
_PARENT_BITS = const(12)
_QOS_RELIABLE = const(0x01)
_STREAM_BEST_EFFORT = const(0x01)
_STREAM_RELIABLE = const(0x80)
_ERROR = const(0x80)
_AT_ONCE = const(8)  # requests in flight: an agent with 16 unacknowledged messages loses a STATUS
_TOPIC = const(3)  # steps, see ``entities``
_GROUP = const(2)
_STEPS = const(0x0F)  # the bits of ``todo``: steps without a good STATUS, refused
_REFUSED = const(0x10)
_UNLIMITED = const(0xFFFF)

_PROBLEM_ENTITY = const(3)
_PROBLEM_READ = const(4)
_PROBLEM_NO_ANSWER = const(5)


def accepted(session: "Session") -> None:
    """Begins the streams again and has every entity created."""
    if session.reliable.first != session.reliable.next or session.backlog:
        session.keep().hold()
    reset(session)
    session.asked.clear()
    session.pending = 1
    for entity in session.entities:
        renew(entity)


def go_through(session: "Session", now: int) -> None:
    """Makes the requests that are not made yet, as far as there is room for them now."""
    asked = session.asked
    if asked and ticks_diff(now, session.late) >= 0:
        asked.clear()
        session.laps += 1
        if session.laps == 3:
            session.problem(_PROBLEM_NO_ANSWER)
    pending = 0
    for entity in session.entities:
        if entity.request == 0:  # that of step 0; the others come before it
            entity.request = session.number(4 if entity.todo >> _GROUP else 2)
        for step in (_TOPIC, _GROUP, 1):
            request = entity.request - step
            if entity.todo >> step & 1 and request not in asked:
                if len(asked) == _AT_ONCE or not submit(
                    session, _CREATION, request, object_id(entity, step), variant(entity, step)
                ):
                    return
                asked[request] = entity
                session.late = ticks_add(now, session.creation_timeout)
        if entity.todo == 1:
            if not submit(session, _READING, entity.request, entity.id, _reading(entity)):
                return
            entity.todo = 0
        pending |= entity.todo & _STEPS
    session.pending = pending


def status(session: "Session", request: int, number: int, status: int) -> None:
    """Takes the STATUS of a request about the object with the id ``number``."""
    entity = session.asked.get(request)
    if entity is None:
        for entity in session.entities:
            if entity.request == request and entity.id == number and status >= _ERROR:
                session.problem(_PROBLEM_READ, status, entity.name)
        return
    step = entity.request - request
    if object_id(entity, step) != number:
        return
    del session.asked[request]
    session.laps = 0
    if entity.todo >> step & 1:
        if status < _ERROR:
            entity.todo -= 1 << step
        else:
            entity.status = status
            entity.todo = _REFUSED
            session.problem(_PROBLEM_ENTITY, status, entity.name)


def submit(session: "Session", kind: int, request: int, object_id: int, payload: bytes) -> bool:
    """Puts a submessage with ids into the reliable stream; False when there is no room now.

    ``kind`` has the flags from bit 8 on.
    """
    n = 4 + len(payload)
    data = head(kind, n, request, object_id) + payload
    if n > session.reliable.capacity:
        return session.keep().first(data)
    return not (session.backlog and session.backlog.cutter) and add(session.reliable, data)


def variant(entity: "Entity", step: int) -> "Any":
    """The representation of an object, as bytes."""
    create: "Any" = entity.session.create or binary
    name = entity.name
    kind = entity.id & 15
    if kind == _KIND_PARTICIPANT:
        return create.of_participant(name, entity.domain)
    above = entity.above
    parent = (above & (1 << _PARENT_BITS) - 1) << 4 | _KIND_PARTICIPANT
    type_name = entity.type_name
    if hasattr(entity, "room"):  # a side of a service
        return create.of_service(
            kind,
            name,
            dds_type(type_name, "_Request"),
            dds_type(type_name, "_Response"),
            topic_name("rq", name, "Request"),
            topic_name("rr", name, "Reply"),
            parent,
        )
    type_name = dds_type(type_name)
    if step == _TOPIC:
        return create.of_topic(name, type_name, parent)
    if step == _GROUP:
        return create.of_group(kind - 2, parent)
    return create.of_endpoint(kind, above >> _PARENT_BITS, entity.qos, entity.id - 2, name, type_name)


def _reading(entity: "Entity") -> bytes:
    """The read specification: by default everything, for ever."""
    stream_id = _STREAM_RELIABLE if entity.qos[0] & _QOS_RELIABLE else _STREAM_BEST_EFFORT
    samples, seconds, rate, pace = getattr(entity, "limits", (_UNLIMITED, 0, 0, 0))
    return binary.read_data(stream_id, samples, seconds, rate, pace)
