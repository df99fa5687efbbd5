"""What a session creates at the agent: participants and writers; readers and services have modules of their own.

An entity stands for the objects that make it up, one for each step of its creation: a writer is a topic, a publisher
and a datawriter, as the middleware of micro-ROS makes them. Bit i of ``todo`` says that step i has no good STATUS
yet, of ``asked`` that its request is under way; ``steps`` itself stands for the READ_DATA of those that read.
"""

from muros.client.link import CONNECTED
from muros.client.names import dds_type, topic_name
from muros.client.qos import profile, within
from muros.compat import const, ticks_add
from muros.xrce.create import head

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client._types import Outgoing
    from muros.client.qos import AnyQos
    from muros.client.session import Session

_CREATE = const(1)
_WRITE_DATA = const(7)
_READ_DATA = const(8)
_LITTLE_ENDIAN = const(0x01)
_CREATE_FLAGS = const(0x07)  # little endian, REUSE and REPLACE
_FIRST_REQUEST = const(10)
_KIND_PARTICIPANT = const(1)
_LAST_DOMAIN = const(255)  # which leaves the choice to the agent; the others end at 232
_KIND_TOPIC = const(2)
_KIND_DATAWRITER = const(5)
_QOS_RELIABLE = const(0x01)
_ERROR = const(0x80)
_AT_ONCE = const(8)  # requests in flight: an agent with 16 unacknowledged messages loses a STATUS

_PROBLEM_ENTITY = const(3)
_PROBLEM_READ = const(4)


def publish(self: "Any", message: "Outgoing") -> bool:
    """Sends a message. False when it was not taken: the session's ``drops`` and ``on_problem`` say why.

    A reliable message that was taken arrives once and in order for as long as the agent keeps the session; when the
    session begins anew, what was not acknowledged is sent again.
    """
    session = self.session
    n = message.size()
    stream = self.stream
    if session.state == CONNECTED and self.todo == 0 and self.status == 0 and session.backlog is None:
        at = stream.reserve(n + 4)
        if at >= 0:
            request = session.request
            if request == 0xFFFF:
                request = _FIRST_REQUEST
            session.request = request + 1
            head(stream.buf, at, _WRITE_DATA, _LITTLE_ENDIAN, n + 4, request, self.index << 4 | self.kind)
            try:
                message.write(stream.buf, at + 8)
            except Exception:
                stream.cancel(at)
                raise
            stream.flush(session.send, session.now)
            return True
    accepted: bool = session.defer(self, message, n)
    return accepted


class Entity:
    """``name`` is its name in DDS; ``status`` is that of the request the agent refused, 0 while none was."""

    steps = 1
    reads = 0  # 1 for entities that ask for data
    status = 0

    def __init__(self, session: "Session", name: str) -> None:
        self.session = session
        self.name = name
        self.request = 0  # the id of the first request, one more for each step
        self.todo = 0
        self.asked = 0
        session.add(self)

    def renew(self) -> None:
        """Everything is to be created again."""
        self.request = self.asked = 0
        if self.status:
            self.status = 0
        self.todo = (1 << self.steps + self.reads) - 1

    def create(self, now: int) -> bool:
        """Makes the requests that are not made yet; False when there is no room for them now."""
        session = self.session
        if self.request == 0:
            self.request = session.requests(self.steps + 1)
        for step in range(self.steps):
            bit = 1 << step
            if self.todo & bit and not self.asked & bit:
                if session.waiting >= _AT_ONCE or not session.submit(
                    _CREATE, _CREATE_FLAGS, self.request + step, self.object_id(step), self.variant(step)
                ):
                    return False
                self.asked |= bit
                session.waiting += 1
                session.late = ticks_add(now, session.creation_timeout)
        if self.todo == 1 << self.steps:
            request = self.request + self.steps
            if not session.submit(
                _READ_DATA, _LITTLE_ENDIAN, request, self.object_id(self.steps - 1), self.reading()
            ):
                return False
            self.todo = 0
            session.pending -= 1
        return True

    def answered(self, step: int, object_id: int, status: int) -> bool:
        """Takes the STATUS of request number ``step``; False when that is none of ours."""
        if not 0 <= step <= self.steps:
            return False
        session = self.session
        if step == self.steps:
            if status < _ERROR or self.object_id(step - 1) != object_id:
                return False
            session.problem(_PROBLEM_READ, status, self.name)
            return True
        bit = 1 << step
        if not self.asked & bit or self.object_id(step) != object_id:
            return False
        session.waiting -= 1
        session.laps = 0
        self.asked &= ~bit
        if self.todo & bit:
            self.todo &= ~bit
            if status >= _ERROR:
                self.status = status
                self.todo = 0
            if self.todo == 0:
                session.pending -= 1
            if status >= _ERROR:
                session.problem(_PROBLEM_ENTITY, status, self.name)
        return True

    def object_id(self, step: int) -> int:
        """The id of an object: ``index << 4 | kind``."""
        raise NotImplementedError

    def variant(self, step: int) -> bytes:
        """The representation of an object."""
        raise NotImplementedError

    def reading(self) -> bytes:
        """The read specification."""
        raise NotImplementedError

    def destroy(self) -> None:
        """Has the agent delete the objects; the entity is not to be used any more."""
        from muros.client.closing import destroy

        destroy(self)


class Participant(Entity):
    """A DDS participant."""

    def __init__(self, session: "Session", name: str, domain: int) -> None:
        within("domain", domain, _LAST_DOMAIN)
        self.index = session.index(_KIND_PARTICIPANT)
        self.domain = domain
        super().__init__(session, topic_name("", name))

    def object_id(self, step: int) -> int:
        """The id of the participant."""
        return self.index << 4 | _KIND_PARTICIPANT

    def variant(self, step: int) -> bytes:
        """The participant's representation."""
        made: bytes = self.session.create.participant(self.name, self.domain)
        return made


class Endpoint(Entity):
    """A topic, the publisher or subscriber, and the datawriter or datareader."""

    steps = 3
    kind = _KIND_DATAWRITER

    def __init__(
        self, session: "Session", node: Participant, name: str, type_name: str, qos: "AnyQos"
    ) -> None:
        self.node = node
        dds_type(type_name)  # complains now about what cannot be
        self.type_name = type_name
        self.qos = profile(qos)
        self.topic_index = session.index(_KIND_TOPIC)
        self.index = session.index(self.kind)
        super().__init__(session, name)

    def object_id(self, step: int) -> int:
        """The ids of topic, publisher or subscriber, endpoint."""
        if step == 0:
            return self.topic_index << 4 | _KIND_TOPIC
        return self.index << 4 | (self.kind - 2 if step == 1 else self.kind)

    def variant(self, step: int) -> bytes:
        """Their representations."""
        create = self.session.create
        if step == 0:
            made: bytes = create.topic(self.name, dds_type(self.type_name), self.node.object_id(0))
        elif step == 1:
            made = create.group(self.kind - 2, self.node.object_id(0))
        else:
            made = create.endpoint(
                self.kind, self.object_id(0), self.qos, self.object_id(1), self.name, dds_type(self.type_name)
            )
        return made


class Writer(Endpoint):
    """Writes samples; reliable or best effort by its QoS."""

    def __init__(
        self, session: "Session", node: Participant, name: str, type_name: str, qos: "AnyQos"
    ) -> None:
        super().__init__(session, node, name, type_name, qos)
        self.stream = session.output(self.qos.flags & _QOS_RELIABLE)

    publish = publish

    def write_bytes(self, data: "bytes | bytearray") -> bool:
        """Sends a sample that is serialised already."""
        from muros.client.raw import Raw

        return self.publish(Raw(data))
