"""What is known of entities now and then: the objects that make them up, their end, raw samples, new readings.

A participant is one object; a writer is a topic, a publisher and a datawriter, as the middleware of micro-ROS makes
them, a reader likewise; a side of a service is one object. Step ``i`` of the creation makes object ``i``; behind the
last one stands the READ_DATA of those that read. Boards borrow this; functions with ``self`` are methods of
``session.Entity``.
"""

from muros.compat import borrow, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.session import Entity

_KIND_DATAWRITER = const(5)
_KIND_DATAREADER = const(6)
_PARENT_BITS = const(12)

UNLIMITED = const(0xFFFF)


def steps(entity: "Entity") -> int:
    """How many objects make it up."""
    return 3 if entity.id & 15 in (_KIND_DATAWRITER, _KIND_DATAREADER) else 1


def object_id(self: "Entity", step: int) -> int:
    """The id of an object: ``index << 4 | kind``."""
    if step == steps(self) - 1:
        return self.id
    return self.id - 2 if step else self.above >> _PARENT_BITS


def destroy(self: "Entity") -> None:
    """Has the agent delete the objects; the entity is not to be used any more."""
    borrow("muros.client.deleting").destroy(self)


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
    session = self.session
    if self.todo == 0:
        session.pending += 1
        self.request = borrow("muros.client.requests").requests(
            session, steps(self) + 1
        )  # the last: READ_DATA
        self.todo = 1 << steps(self)
