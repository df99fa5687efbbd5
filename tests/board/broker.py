"""Boards in one memory that meet, in virtual time: what is written through one agent comes out of all that read it.

A `Broker` makes contexts, each over a line of its own to it. The lines are what `agent.Agent` is, and keep books of
what is created through them. `Broker.turn` lets 1 ms pass and every executor make a pass; who waits turns the others.
"""

from struct import pack

from muros.client import Session
from muros.compat import const
from muros.rclc import Context, Executor
from tests.board.agent import Agent

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

_CREATE = const(1)
_DELETE = const(3)
_WRITE_DATA = const(7)
_FRAGMENT = const(13)
_TIMESTAMP = const(14)
_LAST = const(0x02)
_PARTICIPANT = const(1)
_TOPIC = const(2)
_WRITER = const(5)
_READER = const(6)
_REQUESTER = const(7)
_REPLIER = const(8)
_IDENTITY = const(24)
_PATIENCE = const(5000)  # ms until something that must come has come


class Line(Agent):
    """The agent as one client sees it: ``objects`` has what each object of the client is about, by its id."""

    def __init__(self, broker: "Broker", mtu: int) -> None:
        super().__init__(mtu)
        self.broker = broker
        self.objects: "dict[int, Any]" = {}
        self.pieces = b""

    def restart(self) -> None:
        """The agent is another one, which knows nobody; what was under way is gone."""
        self.objects.clear()
        self.inbox.clear()
        self.pieces = b""
        self.knows = 0
        self._next = self._expected = 0

    def wait(self, timeout: int) -> None:
        """Others go on meanwhile."""
        if not self.inbox:
            self.broker.turn(self, timeout)

    def take(self, kind: int, flags: int, body: bytes) -> None:
        """Takes a submessage."""
        if kind == _FRAGMENT:
            self.pieces += body
            if flags & _LAST:
                whole, self.pieces = self.pieces, b""
                self.handle(bytes(4) + whole)
            return
        if kind == _TIMESTAMP:
            time = pack("<II", self.broker.now // 1000, self.broker.now % 1000 * 1000000)
            self.answer(b"\x0f\x01\x18\0" + time * 2 + body[:8])
            return
        super().take(kind, flags, body)
        if kind == _CREATE:
            self.create(body[2] << 8 | body[3], body[12:])
        elif kind == _DELETE:
            self.objects.pop(body[2] << 8 | body[3], None)
        elif kind == _WRITE_DATA:
            self.write(body[2] << 8 | body[3], body[:2], body[4:])

    def create(self, number: int, blob: bytes) -> None:
        """Notes what an object is about: the name of its topic or service; of a participant, name and domain."""
        kind = number & 15
        if kind == _PARTICIPANT:
            name = text(blob, 4)
            at = 8 + len(name) + 1
            self.objects[number] = (name, blob[at + (at & 1)])
        elif kind == _WRITER or kind == _READER:
            self.objects[number] = self.objects.get(blob[0] << 8 | blob[1])
        elif kind == _TOPIC or kind >= _REQUESTER:
            self.objects[number] = text(blob, 0)

    def write(self, number: int, request: bytes, data: bytes) -> None:
        """Brings a sample to all that read it, a request to who serves it, or an answer to who asked."""
        kind = number & 15
        if kind == _REPLIER:
            asked = data[:5]
            self.broker.lines[asked[0]].give(asked[3] << 8 | asked[4], asked[1:5] + data[_IDENTITY:])
            return
        if kind == _REQUESTER:
            head = bytes((self.broker.lines.index(self),)) + request + bytes((number >> 8, number & 255))
            data = head + bytes(_IDENTITY - len(head)) + data
        name = self.objects.get(number)
        for line in self.broker.lines:
            for other in list(line.objects):
                if other & 15 == kind + 1 and line.objects[other] == name:
                    line.give(other, data)

    def give(self, number: int, data: bytes) -> None:
        """Says a sample, in pieces if need be."""
        message = self.data(number, data)
        if len(message) <= self.mtu - 4:
            self.inbox.append(message)
            return
        self._next -= 1
        whole = message[4:]
        most = self.mtu - 12 & ~3
        for at in range(0, len(whole), most):
            piece = whole[at : at + most]
            flags = 1 if at + most < len(whole) else 1 | _LAST
            self.reliable(bytes((_FRAGMENT, flags, len(piece) & 255, len(piece) >> 8)) + piece)


class Broker:
    """Time in ms, and contexts that meet. ``executors`` are those that take turns."""

    def __init__(self) -> None:
        self.now = 1000
        self.lines: "list[Line]" = []
        self.executors: "list[Any]" = []
        self.problems: "list[tuple[int, str]]" = []

    def context(self, domain: int = 0, mtu: int = 512, **session: "Any") -> "Any":
        """A context on a line of its own, which an executor of its own runs."""
        line = Line(self, mtu)
        made = Context(Session(line, len(self.lines) + 1, **session), None, domain)
        made.clock = lambda: self.now
        made.on_problem(lambda code, text: self.problems.append((code, text)))
        self.lines.append(line)
        self.executors.append(Executor(made))
        return made

    def turn(self, waiting: "Any" = None, most: int = 1) -> None:
        """Lets 1 ms pass; everybody but who waits makes a pass."""
        self.now += min(most, 1)
        for executor in self.executors:
            line = executor.context.middleware.transport
            if line is not waiting and executor.context.running:
                executor.spin_some(0)

    def run(self, ms: int) -> None:
        """Lets time pass."""
        for _ in range(ms):
            self.turn()

    def until(self, condition: "Callable[[], Any]", every: "Callable[[], object]" = lambda: None) -> None:
        """Lets time pass until a condition holds, doing something in between."""
        end = self.now + _PATIENCE
        while not condition():
            assert self.now < end, "it did not come about: %r" % self.problems
            self.turn()
            every()

    def settle(self) -> None:
        """Everybody is connected, and all that was said has come."""
        contexts = [executor.context for executor in self.executors if executor.context.running]
        self.until(lambda: all(c.state == "CONNECTED" and c.middleware.pending == 0 for c in contexts))
        self.run(20)


def text(blob: bytes, at: int) -> str:
    """A string of a representation."""
    n = blob[at] | blob[at + 1] << 8
    return blob[at + 4 : at + 3 + n].decode()
