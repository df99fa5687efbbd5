"""What callbacks with logical execution time publish over a session, held back. Boards load it for those alone."""

from muros.compat import const
from muros.xrce.requests import add, head

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.rclc.let import Task

_CONNECTED = const(2)
_OFFLINE = const(0)  # causes of what is dropped, see ``muros.client.methods``
_FULL = const(1)
_WRITE = const(0x0107)  # a WRITE_DATA, little endian
_HEAD = const(8)  # of a WRITE_DATA


class Outputs:
    """What callbacks publish over a session, held back: while a callback runs this is the backlog of the session.

    ``items`` are requests that do not wait for the end of the period.
    """

    cutter = None
    _cut = None

    def __init__(self, session: "Any") -> None:
        self.session = session
        self.items: "list[Any]" = []
        self._task: "Any" = None
        self._backlog: "Any" = None

    def open(self, task: "Task") -> None:
        """From now on everything is held back."""
        self._task = task
        self._backlog = self.session.backlog
        self.session.backlog = self

    def close(self, outer: object) -> None:
        """No more."""
        session = self.session
        session.backlog = self._backlog
        if self.items:
            backlog = session.keep()
            backlog.items += self.items
            self.items = []
            backlog.pump()

    def defer(self, writer: "Any", message: "Any", n: int) -> bool:
        """Takes a sample. CapacityError when the writer has published too many."""
        if writer.name == "rt/rosout":  # what is logged is no output
            self.session.backlog = self._backlog
            taken: bool = writer.publish(message)
            self._backlog = self.session.backlog
            self.session.backlog = self
            return taken
        task = self._task
        count = 0
        for other in task.outputs:
            count += other[0] is writer
        if count >= task.messages:
            from muros.rclc.errors import CapacityError

            raise CapacityError(
                "%d messages of %d of %s wait for the end of the period. Give the executor messages=%d."
                % (count, count, writer.name, count + 1)
            )
        data = bytearray(_HEAD + n)
        data[:_HEAD] = head(_WRITE, n + 4, self.session.number(), writer.id)
        message.write(data, _HEAD)
        task.outputs.append((writer, data))
        return True

    def first(self, data: "Any") -> bool:
        """A request that is larger than a message has to wait, until it is made again."""
        return False

    def pump(self) -> None:
        """Nothing leaves meanwhile."""

    def flush(self, task: "Task") -> None:
        """Has everything leave that waits."""
        for writer, data in task.outputs:
            if not self._send(writer, data):
                task.lost += 1
        if task.handle._answers:
            task.handle._send()

    def _send(self, writer: "Any", data: bytearray) -> bool:
        session = self.session
        n = len(data) - _HEAD
        if session.state != _CONNECTED or writer.todo:
            if writer.status or not (writer.stream.reliable and session.queue):
                session.dropped(_OFFLINE, n, writer)
                return False
        elif not writer.stream.reliable:
            if not add(writer.stream, data):
                session.dropped(_FULL, n, writer)
                return False
            writer.stream.flush(session.send, session.now)
            return True
        backlog = session.keep()
        backlog.items.append(data)
        backlog.pump()
        return True
