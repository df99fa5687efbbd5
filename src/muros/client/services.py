"""Requesters and repliers, the two sides of a service (DDS-XRCE 1.0, 7.7.3.9, and the reference agent's data formats).

A request is a WRITE_DATA on the requester; its reply comes as DATA that begins with the request id and the object id
of that WRITE_DATA. At the replier a request begins with the identity of its sample in DDS, 24 bytes, and the reply
has to begin with the same.
"""

from muros.client.entities import Entity, publish
from muros.client.link import CONNECTED
from muros.client.names import dds_type, topic_name
from muros.client.qos import profile
from muros.compat import const, copy
from muros.xrce.create import read_data

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client._types import Message, Outgoing
    from muros.client.entities import Participant
    from muros.client.qos import AnyQos
    from muros.client.session import Session
    from muros.xrce._types import Buffer

    OnReply = Callable[[int, Buffer, int, int], object]
    OnRequest = Callable[[bytes, Buffer, int, int], object]

_KIND_REQUESTER = const(7)
_KIND_REPLIER = const(8)
_QOS_RELIABLE = const(0x01)
_STREAM_BEST_EFFORT = const(0x01)
_STREAM_RELIABLE = const(0x80)
_UNLIMITED_SAMPLES = const(0xFFFF)
_IDENTITY = const(24)


class _Service(Entity):
    """What both sides share. The names of topics and types in DDS are those that ROS gives them."""

    kind = 0
    reads = 1

    def __init__(
        self,
        session: "Session",
        node: "Participant",
        name: str,
        kind: str,
        callback: "Any",
        qos: "AnyQos",
    ) -> None:
        self.callback = callback
        self.node = node
        self.type_name = kind
        self.name = name
        self.stream = session.output(profile(qos).flags & _QOS_RELIABLE)
        self.session = session
        self.index = session.index(self.kind)
        self.variant(0)  # complains now about what cannot be
        session.objects[self.object_id(0)] = self
        super().__init__(session, name)

    def object_id(self, step: int) -> int:
        """The id of the requester or replier."""
        return self.index << 4 | self.kind

    def variant(self, step: int) -> bytes:
        """Its representation."""
        name = self.name
        made: bytes = self.session.create.service(
            self.kind,
            name,
            dds_type(self.type_name, "_Request"),
            dds_type(self.type_name, "_Response"),
            topic_name("rq", name, "Request"),
            topic_name("rr", name, "Reply"),
            self.node.object_id(0),
        )
        return made

    def room(self) -> bool:
        """Whether a sample that is written now can go out."""
        session = self.session
        stream = session.reliable
        return (
            session.state == CONNECTED
            and session.backlog is None
            and self.todo == 0
            and (self.stream is not stream or stream.next - stream.first & 0xFFFF < stream.history)
        )

    def reading(self) -> bytes:
        """The read specification: everything, for ever."""
        stream_id = _STREAM_RELIABLE if self.stream.reliable else _STREAM_BEST_EFFORT
        return read_data(stream_id, _UNLIMITED_SAMPLES, 0, 0, 0)

    publish = publish


class Requester(_Service):
    """The client's side. ``callback(number, buf, off, n)`` gets replies, with the number that ``send`` gave."""

    kind = _KIND_REQUESTER

    def send(self, request: "Message") -> int:
        """Sends a request; its number, or 0 when it was not taken."""
        return self.session.request - 1 if self.publish(request) else 0

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a reply."""
        if n >= 4:
            self.callback(buf[off] << 8 | buf[off + 1], buf, off + 4, n - 4)


class Replier(_Service):
    """The server's side. ``callback(identity, buf, off, n)`` gets requests; ``reply`` answers them, at any time."""

    kind = _KIND_REPLIER

    def reply(self, identity: bytes, reply: "Message") -> bool:
        """Answers the request of that identity; False when it was not taken."""
        return self.publish(_Identified(identity, reply))

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a request."""
        if n >= _IDENTITY:
            identity = bytes(memoryview(buf)[off : off + _IDENTITY])
            self.callback(identity, buf, off + _IDENTITY, n - _IDENTITY)


class _Identified:
    """A message behind the identity of the request it answers."""

    def __init__(self, identity: bytes, message: "Outgoing") -> None:
        self.identity = identity
        self.message = message

    def size(self) -> int:
        """Bytes of the body."""
        return _IDENTITY + self.message.size()

    def write(self, buf: bytearray, off: int) -> int:
        """Writes the body at ``off`` and returns its end."""
        copy(buf, off, self.identity, 0, _IDENTITY)
        return self.message.write(buf, off + _IDENTITY)
