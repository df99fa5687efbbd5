"""Handles: answers that cannot go out, what is destroyed, and where handles are run."""

from typing import Any

import pytest

from muros.client import CONNECTED, LOST
from muros.rclc import CapacityError, GuardCondition
from tests.client.world import World
from tests.rclc.test_rclc import Board, two

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32

IDENTITY = bytes(24)


def answer(request: Any) -> Any:
    """The answer of the service of these tests."""
    return AddTwoInts.Response(sum=request.a + request.b)


class Served:
    """A server and a client, connected, on boards of their own."""

    def __init__(self, qos: str = "services", **arguments: Any) -> None:
        self.world = World()
        self.server = Board(self.world, "alice", **arguments)
        self.board = Board(self.world, "bob")
        self.service = self.server.node.service(AddTwoInts, "add", answer, qos)
        self.client = self.board.node.client(AddTwoInts, "add", qos)
        self.executor = self.server.executor()
        self.server.connect()
        self.board.connect()
        self.got: list[Any] = []

    def ask(self, count: int) -> None:
        """Sends requests."""
        for i in range(count):
            assert self.client.send(AddTwoInts.Request(a=i, b=1), self.got.append, 30.0)
            self.board.connect()

    def until(self, state: int) -> None:
        """Spins the server until it is in a state."""
        end = self.world.now + 10_000
        while self.server.session.state != state:
            assert self.world.now < end
            self.executor.spin_some(0.01)

    def passes(self, count: int = 100) -> int:
        """How many passes of the executor find something to do, at one instant."""
        return sum(self.executor.work(self.world.now) for _ in range(count))


def test_an_answer_that_cannot_go_out_waits_quietly_and_goes_later() -> None:
    served = Served()
    served.ask(1)
    served.world.run(50, 1)
    served.server.session.spin_once(served.world.now)  # the request is there
    served.world.network.partition(["alice"])
    end = served.world.now + 10_000
    while served.server.session.state != LOST:
        assert served.world.now < end
        served.world.run(10, 1)
        served.server.session.spin_once(served.world.now)
    assert served.passes() == 1, "the callback runs once"
    assert served.passes() == 0
    assert list(served.server.session.drops)[:4] == [0, 0, 0, 0]
    served.world.network.heal()
    served.until(CONNECTED)
    served.server.spin(served.executor, 100)
    served.board.spin(served.board.executor(), 100)
    assert [reply.sum for reply in served.got] == [1]


def test_answers_wait_for_room_in_the_window() -> None:
    served = Served(history=2)
    served.ask(8)
    served.server.spin(served.executor, 500)
    served.board.spin(served.board.executor(), 200)
    assert [reply.sum for reply in served.got] == list(range(1, 9))
    assert served.service.lost == 0


def test_an_answer_that_can_never_go_is_dropped_and_counted() -> None:
    class Long:
        def size(self) -> int:
            return 5000

    served = Served("sensor_data")
    served.service.reply(IDENTITY, Long())
    assert served.service.lost == 1
    assert served.passes() == 0
    assert served.server.session.drops[2] == 1


def test_requests_and_answers_that_wait_are_bounded_and_counted() -> None:
    served = Served()
    body = bytearray(16)
    served.server.session.state = LOST
    for _ in range(15):
        served.service.deliver(IDENTITY, body, 0, 16)
    assert served.service.lost == 5
    assert served.passes() == 10
    for _ in range(15):
        served.service.deliver(IDENTITY, body, 0, 16)
    assert served.service.lost == 10
    assert served.passes() == 0, "no answer has room, so no request is taken"
    served.service.reply(IDENTITY, AddTwoInts.Response())
    assert served.service.lost == 11


def test_what_is_destroyed_keeps_nothing() -> None:
    served = Served()
    service, client = served.service, served.client
    served.ask(1)
    served.server.session.state = LOST
    service.deliver(IDENTITY, bytearray(16), 0, 16)
    service.reply(IDENTITY, AddTwoInts.Response())
    service.destroy()
    service.deliver(IDENTITY, bytearray(16), 0, 16)
    service.reply(IDENTITY, AddTwoInts.Response())
    assert service._waiting == service._answers == []
    assert not service.ready(served.world.now)
    client.destroy()
    assert client._asked == []
    assert not client.send(AddTwoInts.Request(), served.got.append)
    assert client.call(AddTwoInts.Request(), 0.1) is None
    service.destroy()
    client.destroy()


def test_a_call_tries_only_when_it_can() -> None:
    world = World()
    board = Board(world)
    client = board.node.client(AddTwoInts, "add")
    world.stop_agent()
    assert client.call(AddTwoInts.Request(), 3.0) is None
    assert not any(board.session.drops)


def test_a_destroyed_handle_leaves_its_executor() -> None:
    board, other = two(World())
    executor = board.executor(handles=1)
    makers = (
        lambda: board.node.timer(1, lambda: None),
        lambda: board.node.subscription(Int32, "value", None),
        lambda: board.node.service(AddTwoInts, "add", answer),
        lambda: board.node.client(AddTwoInts, "add"),
        lambda: GuardCondition(board.context, lambda: None),
    )
    for make in makers:
        handle: Any = make()
        executor.add(handle)
        with pytest.raises(CapacityError):
            executor.add(board.node.timer(1, lambda: None))
        handle.destroy()
        assert executor.handles == []
        handle.destroy()
    assert other.context.handles == []


def test_a_callback_may_destroy_its_own_handle_and_others() -> None:
    world = World()
    board = Board(world)
    ran: list[str] = []

    def once() -> None:
        ran.append("first")
        first.destroy()
        second.destroy()

    first = board.node.timer(0.01, once)
    second = board.node.timer(0.01, lambda: ran.append("second"))
    board.node.timer(0.01, lambda: ran.append("third"))
    board.spin(board.executor(), 100)
    assert ran.count("first") == 1
    assert "second" not in ran
    assert ran.count("third") >= 5


def test_a_callback_that_raises_leaves_the_executor_whole() -> None:
    served = Served()
    served.service.callback = lambda request: 1 // request.a
    served.ask(1)
    with pytest.raises(ZeroDivisionError):
        served.server.spin(served.executor, 100)
    served.service.callback = answer
    served.ask(1)
    served.server.spin(served.executor, 100)
    served.board.spin(served.board.executor(), 100)
    assert [reply.sum for reply in served.got] == [1]
