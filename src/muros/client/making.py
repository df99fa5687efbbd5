"""What programs make in a session: checks, names, ids. What it needs at the agent ``creating`` asks for.

Boards borrow this; functions with ``self`` are methods of ``session.Session``.
"""

from muros.client.entities import renew
from muros.client.names import dds_type, topic_name
from muros.client.session import Entity
from muros.compat import borrow, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import TypeVar

    from muros.client._types import OnData
    from muros.client.qos import AnyQos
    from muros.client.services import OnReply, OnRequest, Replier, Requester
    from muros.client.session import Session
    from muros.xrce.streams import Output

    Made = TypeVar("Made", bound=Entity)

_KIND_PARTICIPANT = const(1)
_KIND_TOPIC = const(2)
_KIND_DATAWRITER = const(5)
_KIND_DATAREADER = const(6)
_KIND_REQUESTER = const(7)
_KIND_REPLIER = const(8)
_LAST_DOMAIN = const(255)  # which leaves the choice to the agent; the others end at 232
_QOS_RELIABLE = const(0x01)
_PARENT_BITS = const(12)
_STREAM_BEST_EFFORT = const(0x01)
_INDICES = const(4096)
_USUAL = ("default", "services")  # profiles: reliable, the last 10 samples
_RELIABLE_LAST_10 = (0x03, 10, 0, 0)


def participant(self: "Session", name: str, domain: int = 0) -> Entity:
    """A DDS participant, the node of ROS. ValueError for a name longer than 59 characters, or for no domain."""
    if domain != 0:
        borrow("muros.client.qos").within("domain", domain, _LAST_DOMAIN)
    topic_name("", name)
    made = Entity()
    made.domain = domain
    _add(made, self, name, _KIND_PARTICIPANT)
    return made


def writer(self: "Session", node: Entity, topic: str, kind: str, qos: "AnyQos" = "default") -> Entity:
    """A writer of ``topic`` with messages of a type, named as in ROS or in DDS. ``publish(message)`` sends."""
    return enter(Entity(), self, node, topic, kind, qos, _KIND_DATAWRITER)


def reader(
    self: "Session",
    node: Entity,
    topic: str,
    kind: str,
    qos: "AnyQos" = "default",
    on_data: "OnData | None" = None,
) -> Entity:
    """A reader of ``topic``; ``on_data(buf, off, n)`` gets each sample, whose bytes are only lent.

    An object that has a method ``deliver`` may stand in place of the function.
    """
    made = enter(Entity(), self, node, topic, kind, qos, _KIND_DATAREADER)
    if hasattr(on_data, "deliver"):
        self.objects[made.id] = on_data
    else:
        made.deliver = on_data
    return made


def requester(
    self: "Session", node: Entity, name: str, kind: str, on_reply: "OnReply", qos: "AnyQos" = "services"
) -> "Requester":
    """A client of the service ``name``; ``on_reply(number, buf, off, n)`` gets replies, see ``services``."""
    from muros.client.services import Requester

    return enter(Requester(on_reply), self, node, name, kind, qos, _KIND_REQUESTER)


def replier(
    self: "Session", node: Entity, name: str, kind: str, on_request: "OnRequest", qos: "AnyQos" = "services"
) -> "Replier":
    """A server of the service ``name``; ``on_request(identity, buf, off, n)`` gets requests, see ``services``."""
    from muros.client.services import Replier

    return enter(Replier(on_request), self, node, name, kind, qos, _KIND_REPLIER)


def best_effort(self: "Session") -> "Output":
    """The stream to write to without acknowledgements; it is made at the first need."""
    if _STREAM_BEST_EFFORT not in self.outputs:
        self.outputs[_STREAM_BEST_EFFORT] = borrow("muros.xrce.beginning").make_output(
            _STREAM_BEST_EFFORT, self.reliable.mtu, self.head, 1, 0
        )
    stream: "Output" = self.outputs[_STREAM_BEST_EFFORT]
    return stream


def new_id(self: "Session", kind: int) -> int:
    """The id of a new object of a kind. ValueError after the last; hosts use those of deleted objects again."""
    index = self.counts[kind]
    if index == _INDICES:
        raise ValueError("no room for one more: a session has at most 4096 objects of a kind")
    self.counts[kind] = index + 1
    return index << 4 | kind


def enter(
    made: "Made", session: "Session", node: Entity, name: str, type_name: str, qos: "AnyQos", kind: int
) -> "Made":
    """Makes a writer, a reader or a side of a service, whose names in DDS are those that ROS gives it, of ``made``.

    What cannot be is complained about now, not when the agent is asked for it.
    """
    made.qos = _RELIABLE_LAST_10
    if qos not in _USUAL:
        made.qos = borrow("muros.client.qos").profile(qos).asked
    if kind != _KIND_DATAREADER:
        made.stream = session.reliable
        if not (qos in _USUAL or made.qos[0] & _QOS_RELIABLE):
            made.stream = best_effort(session)
    made.type_name = type_name
    made.above = node.id >> 4
    if kind < _KIND_REQUESTER:
        dds_type(type_name)
        made.above |= session.new_id(_KIND_TOPIC) << _PARENT_BITS
    else:
        dds_type(type_name, "_Response")
        topic_name("rq", name, "Request")
    _add(made, session, name, kind)
    if kind != _KIND_DATAWRITER:
        session.objects[made.id] = made
    return made


def _add(made: Entity, session: "Session", name: str, kind: int) -> None:
    """Has an entity created, now or when the session is connected."""
    made.session = session
    made.name = name
    made.id = session.new_id(kind)
    renew(made)
    session.entities.append(made)
    session.pending = 1
