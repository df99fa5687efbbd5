"""rclc in virtual time: boards against the agent core; acceptance cases are named as in the C library."""

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from muros.client import CONNECTED, Qos
from muros.client._types import Transport
from muros.client.creating import variant
from muros.rclc import (
    CapacityError,
    Context,
    Executor,
    GuardCondition,
    HandleError,
    InvalidNameError,
    Node,
    register,
)
from muros.rclc.timer import Timer
from tests.client.world import World

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String


class Board:
    """A context on a world, whose executors keep the world's time."""

    def __init__(self, world: World, name: str = "board", **arguments: Any) -> None:
        self.world = world
        self.session = world.client(name, client_key=name.encode()[:4].ljust(4, b"x"), **arguments)
        world.sessions.remove(self.session)
        transport: Any = self.session.transport
        transport.on_wait = lambda ms: world.run(max(1, min(ms, 5)), 1)
        self.context = Context(self.session)
        self.context.clock = lambda: world.now
        self.node: Node = self.context.node(name)

    def executor(self, **arguments: Any) -> Executor:
        """An executor in virtual time."""
        return Executor(self.context, **arguments)

    def connect(self) -> "Board":
        """Runs until connected, and a moment longer."""
        executor = Executor(self.context)
        executor.handles = []
        for _ in range(200):
            executor.spin_some(0.005)
            self.world.run(1, 1)
            if (
                self.session.state == CONNECTED
                and self.session.pending == 0
                and self.session.reliable.first == self.session.reliable.next
            ):
                return self
        raise AssertionError("it does not connect")

    def spin(self, executor: Executor, ms: int) -> None:
        """Runs an executor for so long."""
        end = self.world.now + ms
        while self.world.now < end:
            executor.spin_some((end - self.world.now) / 1000)


def two(world: World) -> tuple[Board, Board]:
    """Two boards."""
    return Board(world, "alice"), Board(world, "bob")


def test_publisher_and_subscription_exchange_messages() -> None:  # X17, E6, E9
    world = World()
    alice, bob = two(world)
    publisher = alice.node.publisher(Int32, "value")
    got: list[int] = []
    bob.node.subscription(Int32, "value", lambda message: got.append(message.data))
    alice.connect()
    bob.connect()
    assert publisher.publish(Int32(data=42))
    bob.spin(bob.executor(), 100)
    assert got == [42]


def test_names_on_the_wire_are_those_of_ros() -> None:
    world = World()
    board = Board(world)
    node = board.context.node("thermometer", namespace="greenhouse")
    writer: Any = node.publisher(Int32, "temperature")
    assert (writer.name, writer.type_name) == ("rt/greenhouse/temperature", "std_msgs/msg/Int32")
    assert writer.above & 0xFFF == node.participant.id >> 4
    assert node.participant.name == "/greenhouse/thermometer"
    assert b"std_msgs::msg::dds_::Int32_\0" in variant(writer, 3)
    absolute: Any = node.publisher(Int32, "/temperature", qos="sensor_data")
    assert absolute.name == "rt/temperature"
    private: Any = node.publisher(Int32, "~/temperature", qos=Qos(depth=1))
    assert private.name == "rt/greenhouse/thermometer/temperature"


@pytest.mark.parametrize(
    ("name", "namespace", "code"),
    [
        ("", "", 201),
        ("1st", "", 201),
        ("a-b", "", 201),
        ("a", "x//y", 202),
        ("a", "/x/", 202),
        ("ä", "", 201),
    ],
)
def test_names_that_ros_does_not_take(name: str, namespace: str, code: int) -> None:  # E4
    with pytest.raises(InvalidNameError) as caught:
        Board(World()).context.node(name, namespace)
    assert caught.value.code == code


def test_order_of_adding_is_the_order_of_processing() -> None:  # X18
    world = World()
    alice, bob = two(world)
    publishers = [alice.node.publisher(Int32, f"topic_{i}") for i in range(3)]
    order: list[int] = []
    executor = bob.executor()
    for i in range(3):
        executor.add(bob.node.subscription(Int32, f"topic_{i}", None), lambda message, i=i: order.append(i))
    alice.connect()
    bob.connect()
    for _ in range(3):
        for publisher in reversed(publishers):
            assert publisher.publish(Int32(data=1))
            alice.connect()
        world.run(20, 1)
    bob.spin(executor, 100)
    assert order == [0, 1, 2] * 3


def test_each_message_is_an_object_of_its_own() -> None:
    world = World()
    alice, bob = two(world)
    publisher = alice.node.publisher(String, "text")
    kept: list[Any] = []
    bob.node.subscription(String, "text", kept.append)
    alice.connect()
    bob.connect()
    for text in ("one", "two", "three"):
        publisher.publish(String(data=text))
    bob.spin(bob.executor(), 100)
    assert [message.data for message in kept] == ["one", "two", "three"]


def test_what_does_not_fit_the_depth_is_processed_early_and_never_lost() -> None:
    world = World()
    alice, bob = two(world)
    publisher = alice.node.publisher(Int32, "value")
    got: list[int] = []
    subscription = bob.node.subscription(
        Int32, "value", lambda message: got.append(message.data), qos=Qos(depth=2)
    )
    alice.connect()
    bob.connect()
    for i in range(10):
        publisher.publish(Int32(data=i))
        alice.connect()
    bob.spin(bob.executor(), 200)
    assert got == list(range(10))
    assert subscription.lost == 0


def test_with_a_trigger_the_oldest_are_dropped_and_counted() -> None:
    world = World()
    alice, bob = two(world)
    publisher = alice.node.publisher(Int32, "value")
    got: list[int] = []
    subscription = bob.node.subscription(
        Int32, "value", lambda message: got.append(message.data), qos=Qos(depth=2)
    )
    gate = SimpleNamespace(open=False)
    executor = bob.executor(trigger=lambda handles: gate.open)
    executor.add(subscription)
    alice.connect()
    bob.connect()
    for i in range(10):
        publisher.publish(Int32(data=i))
        alice.connect()
    bob.spin(executor, 200)
    assert got == []
    gate.open = True
    bob.spin(executor, 50)
    assert got == [8, 9]
    assert subscription.lost == 8


def test_a_sample_of_another_type_is_counted() -> None:
    world = World()
    alice, bob = two(world)
    publisher: Any = alice.node.publisher(Int32, "value")
    subscription = bob.node.subscription(String, "other", None)
    alice.connect()
    bob.connect()
    subscription.deliver(b"\xff\xff", 0, 2)
    assert (subscription.malformed, subscription.take()) == (1, None)
    assert publisher is not None


def test_timers_keep_their_phase() -> None:  # X13
    world = World()
    board = Board(world)
    calls: list[int] = []
    board.node.timer(0.1, lambda: calls.append(world.now))
    start = world.now
    executor = board.executor()
    board.spin(executor, 550)
    assert [at - start for at in calls] == [100, 200, 300, 400, 500]
    world.run(330, 1)
    board.spin(executor, 130)
    assert [at - start for at in calls[5:]] == [880, 900, 1000]


def test_timer_cancel_reset_exchange() -> None:  # X14, A6
    world = World()
    calls: list[int] = []
    context = Board(world).context
    timer = Timer(context, 0.1, lambda: calls.append(1), False)
    assert not timer.ready(10**9)
    assert timer.left(0) > 100_000
    timer.reset(1000)
    assert not timer.ready(1099)
    assert timer.left(1050) == 50
    assert timer.ready(1100)
    timer.run(1100)
    assert timer.exchange_period(0.5) == 0.1
    timer.run(1200)
    assert not timer.ready(1699)
    assert timer.ready(1700)
    timer.cancel()
    assert not timer.ready(10**6)
    always = Timer(context, 0, lambda: None, True)
    now = always._next
    always.run(now)
    assert always.ready(now)


def test_services() -> None:  # X28, E12, E15
    world = World()
    alice, bob = two(world)
    alice.node.service(
        AddTwoInts, "add_two_ints", lambda request: AddTwoInts.Response(sum=request.a + request.b)
    )
    client = bob.node.client(AddTwoInts, "add_two_ints")
    server = alice.executor()
    alice.connect()
    bob.connect()
    answers: list[Any] = []
    assert client.send(AddTwoInts.Request(a=1, b=2), answers.append)
    assert client.send(AddTwoInts.Request(a=20, b=22), answers.append)
    asking = bob.executor()
    for _ in range(50):
        alice.spin(server, 5)
        bob.spin(asking, 5)
    assert [answer.sum for answer in answers] == [3, 42]


def test_a_service_may_answer_later() -> None:
    world = World()
    alice, bob = two(world)
    asked: list[Any] = []
    service = alice.node.service(AddTwoInts, "add", lambda request: asked.append((service.identity, request)))
    client = bob.node.client(AddTwoInts, "add")
    server, asking = alice.executor(), bob.executor()
    alice.connect()
    bob.connect()
    answers: list[Any] = []
    client.send(AddTwoInts.Request(a=2, b=3), answers.append)
    for _ in range(20):
        alice.spin(server, 5)
        bob.spin(asking, 5)
    ((identity, request),) = asked
    assert not answers
    service.reply(identity, AddTwoInts.Response(sum=request.a + request.b))
    bob.spin(asking, 50)
    assert [answer.sum for answer in answers] == [5]


def test_a_request_that_nobody_answers_ends() -> None:
    world = World()
    board = Board(world)
    client = board.node.client(AddTwoInts, "nobody_serves")
    board.connect()
    answers: list[Any] = []
    client.send(AddTwoInts.Request(), answers.append, timeout=0.0)
    board.spin(board.executor(), 50)
    assert answers == [None]
    assert client.call(AddTwoInts.Request(), timeout=0.05) is None


def test_guard_conditions() -> None:  # X32, X33
    board = Board(World())
    calls: list[int] = []
    guard = GuardCondition(board.context, lambda: calls.append(1))
    executor = board.executor()
    executor.spin_some()
    guard.trigger()
    executor.spin_some()
    executor.spin_some()
    assert calls == [1]
    guard.destroy()
    guard.trigger()
    executor.spin_some()
    assert calls == [1]


def test_an_executor_has_room_for_what_it_was_made_for() -> None:  # X5, X6
    board = Board(World())
    subscriptions = [board.node.subscription(Int32, f"t{i}", None) for i in range(3)]
    executor = board.executor(handles=2)
    executor.add(subscriptions[0])
    executor.add(subscriptions[1])
    with pytest.raises(
        CapacityError, match=r"executor is full: 2 handles of 2 in use. Create it with handles=3."
    ) as caught:
        executor.add(subscriptions[2])
    assert caught.value.code == 1
    executor.remove(subscriptions[0])
    executor.add(subscriptions[2])
    assert executor.handles == subscriptions[1:]
    with pytest.raises(HandleError, match="is not in this executor") as absent:
        executor.remove(subscriptions[0])
    assert absent.value.code == 1


def test_what_one_executor_claims_another_leaves() -> None:
    board = Board(World())
    ran: list[str] = []
    first = GuardCondition(board.context, lambda: ran.append("first"))
    second = GuardCondition(board.context, lambda: ran.append("second"))
    own, common = board.executor(), board.executor()
    own.add(first)
    first.trigger()
    second.trigger()
    common.spin_some()
    assert ran == ["second"]
    own.spin_some()
    assert ran == ["second", "first"]


def test_states_are_told_by_name() -> None:
    world = World()
    board = Board(world)
    states: list[str] = []
    board.context.on_state(states.append)
    assert board.context.state == "WAITING"
    board.connect()
    assert states == ["CONNECTING", "CONNECTED"]
    board.context.close()
    assert board.context.state == "WAITING"
    board.executor().spin()  # a closed context has nothing to spin for


def test_a_node_takes_everything_with_it() -> None:
    world = World()
    board = Board(world)
    board.node.publisher(Int32, "a")
    board.node.subscription(Int32, "b", None)
    board.node.timer(1.0, lambda: None)
    board.node.service(AddTwoInts, "c", lambda request: None)
    board.node.client(AddTwoInts, "d")
    board.connect()
    (session,) = world.core.clients.values()
    assert len(session.objects) == 1 + 3 + 3 + 1 + 1
    board.node.destroy()
    board.connect()
    world.run(50)
    assert not session.objects
    assert not board.context.handles


def test_spin_period_keeps_its_pace() -> None:  # X21
    world = World()
    board = Board(world).connect()
    calls: list[int] = []
    executor = board.executor()
    guard = GuardCondition(board.context, lambda: None)

    def always() -> None:
        calls.append(world.now)
        guard.trigger()
        if len(calls) == 20:
            board.context.running = False

    guard.callback = always
    guard.trigger()
    executor.spin_period(0.02)
    assert {b - a for a, b in pairwise(calls)} <= {20, 21, 19}


def test_urls_need_a_middleware() -> None:
    with pytest.raises(ValueError, match="'nothing:' names no data space engine"):
        Context("nothing:")
    world = World()
    made: list[tuple[str, int]] = []

    def make(url: str, domain_id: int) -> Any:
        made.append((url, domain_id))
        return world.client()

    register("test", make)
    assert Context("test:7", domain_id=7).state == "WAITING"
    assert made == [("test:7", 7)]


def test_a_transport_is_enough() -> None:
    transport: Transport = World().client().transport
    assert Context(transport, client_key=5).state == "WAITING"


def test_names_of_the_package_are_there() -> None:
    import muros.client
    import muros.rclc

    for package in (muros.rclc, muros.client):
        for name in package.__all__:
            assert getattr(package, name) is not None
        with pytest.raises(AttributeError):
            package.Nothing  # noqa: B018
