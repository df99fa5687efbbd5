"""How entities are made: checks, names, ids. What they need at the agent ``creating`` asks for. Boards borrow this."""

from muros.client.names import dds_type, topic_name
from muros.client.qos import profile, within
from muros.client.session import Entity
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client._types import OnData
    from muros.client.qos import AnyQos
    from muros.client.session import Session

_KIND_PARTICIPANT = const(1)
_KIND_TOPIC = const(2)
_KIND_DATAREADER = const(6)
_LAST_DOMAIN = const(255)  # which leaves the choice to the agent; the others end at 232
_QOS_RELIABLE = const(0x01)
_PARENT_BITS = const(12)


def participant(session: "Session", name: str, domain: int) -> "Entity":
    """A participant."""
    within("domain", domain, _LAST_DOMAIN)
    made = _made(Entity(), session, topic_name("", name), _KIND_PARTICIPANT)
    made.domain = domain
    return made


def endpoint(
    session: "Session",
    node: "Entity",
    name: str,
    type_name: str,
    qos: "AnyQos",
    kind: int,
    on_data: "OnData | None",
) -> "Entity":
    """A writer or a reader."""
    wanted = profile(qos)
    dds_type(type_name)  # complains now about what cannot be
    topic = session.index(_KIND_TOPIC) << 4 | _KIND_TOPIC
    made = _made(Entity(), session, name, kind)
    made.type_name = type_name
    made.qos = wanted
    made.above = topic << _PARENT_BITS | node.id >> 4
    if kind == _KIND_DATAREADER:
        session.objects[made.id] = on_data if hasattr(on_data, "deliver") else made
        if session.objects[made.id] is made:
            made.deliver = on_data
    else:
        made.stream = session.output(wanted.flags & _QOS_RELIABLE)
    return made


def service(
    made: "Entity",
    session: "Session",
    node: "Entity",
    name: str,
    type_name: str,
    kind: int,
    qos: "AnyQos",
) -> None:
    """A side of a service. The names of topics and types in DDS are those that ROS gives them."""
    wanted = profile(qos)
    dds_type(type_name, "_Response")  # complains now about what cannot be
    topic_name("rq", name, "Request")
    _made(made, session, name, kind)
    made.type_name = type_name
    made.qos = wanted
    made.above = node.id >> 4
    made.stream = session.output(wanted.flags & _QOS_RELIABLE)
    session.objects[made.id] = made


def _made(made: "Entity", session: "Session", name: str, kind: int) -> "Entity":
    """Has an entity created, now or when the session is connected."""
    made.session = session
    made.name = name
    made.id = session.index(kind) << 4 | kind
    made.todo = (1 << (3 if kind in (5, 6) else 1) + (kind > 5)) - 1
    made.request = 0
    session.entities.append(made)
    session.pending += 1
    return made
