"""What is known of entities now and then: the objects that make them up, their end, raw samples, new readings.

A participant is one object; a writer is a topic, a publisher and a datawriter, as the middleware of micro-ROS makes
them, a reader likewise; a side of a service is one object. The steps of the creation count down: 3 makes the topic, 2
the publisher or subscriber, 1 the entity itself; 0 is the READ_DATA of those that read. Boards borrow this; functions
with ``self`` are methods of ``session.Entity``.
"""

from muros.compat import borrow, const
from muros.xrce.requests import head

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.session import Entity

_DELETION = const(0x0103)  # a DELETE, little endian
_TOPIC = const(3)
_GROUP = const(2)
_REFUSED = const(0x10)
_PARENT_BITS = const(12)

UNLIMITED = const(0xFFFF)
STEPS = b"\0\2\0\0\0\x0e\x0f\3\3"
"""The steps of the creation, by kind of object: bit i stands for step i."""


def renew(entity: "Entity") -> None:
    """Everything is to be created, again."""
    entity.request = 0
    if entity.status:
        entity.status = 0
    entity.todo = STEPS[entity.id & 15]


def object_id(self: "Entity", step: int) -> int:
    """The id of the object that a step makes: ``index << 4 | kind``."""
    if step == _TOPIC:
        return self.above >> _PARENT_BITS
    return self.id + 2 - 2 * step


def destroy(self: "Entity") -> None:
    """Has the agent delete the objects, after what was written before; waits for nothing.

    The entity is forgotten, and not to be used any more.
    """
    session = self.session
    if self not in session.entities:
        return
    session.entities.remove(self)
    session.objects.pop(self.id, None)
    self.todo = _REFUSED
    self.status = 1
    backlog = session.keep()
    for step in (_TOPIC, 1, _GROUP):
        if STEPS[self.id & 15] >> step & 1:
            session.asked.pop(self.request - step, None)
            backlog.items.append(head(_DELETION, 4, session.number(), object_id(self, step)))


def write_bytes(self: "Entity", data: "bytes | bytearray") -> bool:
    """Sends a sample that is serialised already."""
    return self.publish(borrow("muros.client.raw").Raw(data))


def read(
    self: "Entity", samples: int = UNLIMITED, seconds: int = 0, bytes_per_second: int = 0, pace: int = 0
) -> None:
    """Asks again: for at most ``samples``, for at most so long, at most so fast; 0 means without that limit.

    ``pace`` is the least time between samples in ms. ``samples`` 0 ends the reading. A new reading replaces the
    one before.
    """
    self.limits = (samples, seconds, bytes_per_second, pace)
    if self.todo == 0:
        self.session.pending = 1
        self.request = 0
        self.todo = 1
