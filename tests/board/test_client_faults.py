"""The client when things go wrong, on every runtime: refusals, request ids, callbacks that raise, services."""

from muros.client import CONNECTED, Qos
from muros.client.raw import Raw
from muros.compat import const
from tests.board.agent import Agent
from tests.board.harness import raises
from tests.board.test_client import Board

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer

_READER = const(6)
_LAST_REQUEST = const(0xFFFE)


class Refusing(Agent):
    """An agent that refuses the objects of a kind."""

    kind = 0

    def reliable(self, submessage: bytes) -> None:
        """Says no about that kind."""
        if submessage[0] == 5 and submessage[7] & 15 == self.kind:
            submessage = submessage[:8] + b"\x87\x00"
        super().reliable(submessage)


class Number:
    """A request and its response: 4 bytes."""

    def __init__(self) -> None:
        self.data = 0

    def size(self) -> int:
        return 4

    def write(self, buf: bytearray, off: int) -> int:
        buf[off] = self.data
        buf[off + 1] = buf[off + 2] = buf[off + 3] = 0
        return off + 4

    def read(self, buf: "Buffer", off: int, n: int) -> None:
        if n < 4:
            raise ValueError("short")
        self.data = buf[off]


class Service:
    """The type of a service."""

    TYPE = "example_interfaces/srv/AddTwoInts"
    Request = Number
    Response = Number


def settle(board: Board) -> None:
    for _ in range(10):
        board.step(10)


def test_a_refused_writer_refuses() -> None:
    board = Board()
    agent = Refusing()
    agent.kind = 5
    board.session.transport = agent
    board.session.send = agent.send
    late = board.session.writer(board.session.entities[0], "rt/late", "std_msgs/msg/Int32")
    agent._expected = board.session.reliable.next
    agent._next = board.session.inputs[0x80].expected
    settle(board)
    assert late.status == 0x87
    assert not late.publish(Raw(b"1234"))
    assert board.session.drops[0] == 1


def test_reading_again_keeps_the_answers_of_others() -> None:
    board = Board()
    late = board.session.writer(board.session.entities[0], "rt/late", "std_msgs/msg/Int32")
    board.session.spin_once(board.now)
    board.reader.read(5)
    settle(board)
    assert board.session.pending == 0
    assert late.publish(Raw(b"1234"))


def test_a_reading_that_is_refused_is_told_when_nothing_else_is_asked_for() -> None:
    board = Board()
    told: "list[tuple[int, str]]" = []
    board.session.on_problem = lambda code, text: told.append((code, text))
    board.reader.read(5)
    settle(board)
    request = board.reader.request
    for status in (0, 0x87):
        said = bytes((request >> 8, request & 255, board.reader.id >> 8, board.reader.id & 255, status, 0))
        board.agent.reliable(b"\x05\x01\x06\x00" + said)
        settle(board)
    assert told == [(4, "the agent refuses to read " + board.reader.name + ": no resources (0x87)")]


def test_request_ids_wrap() -> None:
    board = Board()
    requester = board.session.requester(
        board.session.entities[0],
        "/add",
        "example_interfaces/srv/AddTwoInts",
        lambda number, buf, off, n: None,
    )
    settle(board)
    board.session.request = _LAST_REQUEST - 2
    numbers = []
    for _ in range(4):
        numbers.append(requester.send(Raw(b"1234")))
        settle(board)
    assert numbers == [_LAST_REQUEST - 1, _LAST_REQUEST, 10, 11]


def test_a_callback_that_raises_has_had_its_sample() -> None:
    board = Board()

    def bad(buf: "Buffer", off: int, n: int) -> None:
        board.heard += 1
        raise RuntimeError("no")

    board.reader.deliver = bad
    board.agent.inbox.append(board.agent.data(_READER, b"\1\0\0\0"))
    board.agent.inbox.append(board.agent.data(_READER, b"\2\0\0\0"))
    with raises(RuntimeError):
        board.step(10)
    settle(board)
    assert board.heard == 2
    assert board.session.state == CONNECTED
    assert board.session.inputs[0x80].expected == board.agent._next


def test_numbers_that_cannot_be() -> None:
    for depth, deadline in ((65536, 0), (-1, 0), (1, -1), (1, 1 << 32)):
        with raises(ValueError):
            Qos(depth=depth, deadline=deadline)
    assert Qos(depth=65535, deadline=(1 << 32) - 1).depth == 65535
    with raises(ValueError):
        Board().session.participant("node", 256)


def test_objects_have_room_and_an_end() -> None:
    board = Board()
    board.session.counts[1] = 300
    assert board.session.participant("far").object_id(1) == 300 << 4 | 1
    settle(board)
    assert board.session.pending == 0


def test_a_service_answers_when_it_can() -> None:
    from muros.rclc import Context, Executor

    board = Board()
    context = Context(board.session)
    context.clock = lambda: board.now
    service = context.node("node").service(Service, "add", lambda request: request)
    settle(board)
    executor = Executor(context)
    board.session.state = 3
    board.session._due = board.now + 1000
    for i in range(15):
        service.deliver(bytes(24), bytes((i, 0, 0, 0)), 0, 4)
    assert service.lost == 5
    assert sum(executor.work(board.now) for _ in range(30)) == 10
    assert not any(board.session.drops)
    board.session.state = 2
    for _ in range(40):
        board.now += 10
        executor.work(board.now)
    assert [data[24] for data in board.agent.written] == list(range(10))
    service.destroy()
    assert service not in executor.handles
    service.reply(bytes(24), Number())
    assert service.lost == 6
