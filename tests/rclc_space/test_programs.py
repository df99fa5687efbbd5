"""The same programs through an agent and straight on a space."""

import threading
from functools import partial
from typing import Any

import pytest

from muros.client import Qos
from muros.client.raw import Raw
from muros.rclc import Context, Executor, GuardCondition, all_of
from tests.rclc_space.ways import PATIENCE, Stage

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String, UInt8MultiArray


def add(request: Any) -> Any:
    """What the adding service does."""
    return AddTwoInts.Response(sum=request.a + request.b)


def note(got: list[tuple[str, Any]], topic: str, message: Any) -> None:
    """Keeps a message with its topic."""
    got.append((topic, message.data))


def test_messages_come_whole_and_in_order(stage: Stage) -> None:
    talker, listener = stage.node("talker"), stage.node("listener")
    got: list[int] = []
    publisher = talker.publisher(Int32, "value")
    listener.subscription(Int32, "value", lambda message: got.append(message.data))
    stage.meet(publisher)
    sent: list[int] = []

    def send() -> None:
        if len(sent) - len(got) < 10 and publisher.publish(Int32(data=len(sent))):  # so many are kept
            sent.append(len(sent))

    stage.until(lambda: len(sent) == 50, send)
    stage.until(lambda: len(got) >= 50)
    assert got == list(range(50))


def test_names_and_namespaces(stage: Stage) -> None:
    talker, listener = stage.node("talker", "green/house"), stage.node("listener")
    got: list[tuple[str, Any]] = []
    publishers = [talker.publisher(String, name) for name in ("relative", "/absolute", "~/private")]
    for name in ("/green/house/relative", "absolute", "/green/house/talker/private"):
        listener.subscription(String, name, partial(note, got, name))
    stage.meet(*publishers)
    for publisher in publishers:
        stage.publish(publisher, String(data="here"))
    stage.until(lambda: len(got) == 3)
    assert sorted(name for name, _ in got) == [
        "/green/house/relative",
        "/green/house/talker/private",
        "absolute",
    ]


@pytest.mark.parametrize("qos", ["default", "sensor_data", "best_effort", "parameters", "rosout"])
def test_profiles(stage: Stage, qos: str) -> None:
    talker, listener = stage.node("talker"), stage.node("listener")
    got: list[int] = []
    publisher = talker.publisher(Int32, "value", qos)
    listener.subscription(Int32, "value", lambda message: got.append(message.data), qos)
    stage.meet(publisher)
    stage.until(lambda: got, lambda: publisher.publish(Int32(data=7)))
    assert got[0] == 7


def test_late_listeners_get_what_is_kept_for_them(stage: Stage) -> None:
    kept = Qos(reliable=True, depth=3, durability="transient_local")
    talker = stage.node("talker")
    publisher = talker.publisher(Int32, "map", kept)
    stage.meet()
    for i in range(5):
        stage.publish(publisher, Int32(data=i))
    seen: list[int] = []
    early = stage.node("early")
    early.subscription(Int32, "map", lambda message: seen.append(message.data), kept)
    stage.until(lambda: len(seen) >= 3)
    late = stage.node("late")
    got: list[int] = []
    late.subscription(Int32, "map", lambda message: got.append(message.data), kept)
    stage.until(lambda: len(got) >= 3)
    assert seen == got == [2, 3, 4]


def test_large_messages(stage: Stage) -> None:
    talker, listener = stage.node("talker"), stage.node("listener")
    got: list[Any] = []
    image = UInt8MultiArray(data=bytes(i % 251 for i in range(20_000)))
    publisher = talker.publisher(UInt8MultiArray, "image")
    listener.subscription(UInt8MultiArray, "image", got.append)
    stage.meet(publisher)
    stage.publish(publisher, image)
    stage.until(lambda: got)
    assert bytes(got[0].data) == image.data


def test_samples_that_are_serialised_already(stage: Stage) -> None:
    talker, listener = stage.node("talker"), stage.node("listener")
    got: list[int] = []
    publisher = talker.publisher(Int32, "value")
    listener.subscription(Int32, "value", lambda message: got.append(message.data))
    stage.meet(publisher)
    stage.publish(publisher, Raw(Int32(data=4).serialize()))
    stage.until(lambda: got)
    assert got == [4]


def test_a_node_hears_itself(stage: Stage) -> None:
    node = stage.node("both")
    got: list[int] = []
    publisher = node.publisher(Int32, "echo")

    def again(message: Any) -> None:
        got.append(message.data)
        if message.data < 20:
            assert publisher.publish(Int32(data=message.data + 1))

    node.subscription(Int32, "echo", again)
    stage.meet(publisher)
    stage.publish(publisher, Int32(data=0))
    stage.until(lambda: len(got) > 20)
    assert got == list(range(21))


def test_services(stage: Stage) -> None:
    stage.node("server").service(AddTwoInts, "add", add)
    client = stage.node("client").client(AddTwoInts, "add")
    stage.meet(client)
    answers: list[int] = []
    for i in range(3):
        request = AddTwoInts.Request(a=i, b=40)
        stage.until(partial(client.send, request, lambda reply: answers.append(reply.sum)))
    stage.until(lambda: len(answers) == 3)
    assert answers == [40, 41, 42]


def test_a_service_may_answer_later(stage: Stage) -> None:
    asked: list[tuple[bytes, Any]] = []
    service = stage.node("server").service(
        AddTwoInts, "add", lambda request: asked.append((service.identity, request))
    )
    clients = [stage.node(f"client_{i}").client(AddTwoInts, "add") for i in range(2)]
    stage.meet(*clients)
    answers: list[tuple[int, int]] = []

    def answer(who: int, reply: Any) -> None:
        answers.append((who, reply.sum))

    for i, client in enumerate(clients):
        client.send(AddTwoInts.Request(a=i, b=1), partial(answer, i))
    stage.until(lambda: len(asked) == 2)
    assert not answers
    for identity, request in reversed(asked):
        service.reply(identity, add(request))
    stage.until(lambda: len(answers) == 2)
    assert sorted(answers) == [(0, 1), (1, 2)], "each got its own"


def test_a_context_asks_its_own_server(stage: Stage) -> None:
    node = stage.node("node")
    node.service(AddTwoInts, "add", add)
    client = node.client(AddTwoInts, "add")
    stage.meet(client)
    answers: list[int] = []
    stage.until(partial(client.send, AddTwoInts.Request(a=4, b=4), lambda reply: answers.append(reply.sum)))
    stage.until(lambda: answers)
    assert answers == [8]


def test_call_waits_for_the_reply_of_a_server_in_another_thread(stage: Stage) -> None:
    server = stage.way.open()
    server.node("server").service(AddTwoInts, "add", add)
    thread = threading.Thread(target=Executor(server).spin)
    thread.start()
    try:
        client = stage.node("client").client(AddTwoInts, "add")
        for i in range(20):
            reply = client.call(AddTwoInts.Request(a=i, b=2), timeout=PATIENCE)
            assert reply is not None
            assert reply.sum == i + 2
    finally:
        server.running = False
        thread.join(PATIENCE)
        server.close()
    assert not thread.is_alive()


def test_a_request_that_nobody_answers_ends(stage: Stage) -> None:
    client = stage.node("client").client(AddTwoInts, "nobody")
    stage.meet()
    answers: list[Any] = []
    assert client.send(AddTwoInts.Request(), answers.append, timeout=0.05)
    stage.until(lambda: answers)
    assert answers == [None]
    assert client.call(AddTwoInts.Request(), timeout=0.05) is None


def test_timers_and_messages_take_turns(stage: Stage) -> None:
    node = stage.node("node")
    events: list[str] = []
    publisher = node.publisher(Int32, "value")
    stage.meet()

    def tick() -> None:
        events.append("tick")
        publisher.publish(Int32(data=len(events)))

    node.timer(0.005, tick)
    node.subscription(Int32, "value", lambda message: events.append("message"))
    stage.until(lambda: events.count("message") >= 5)
    assert events.count("tick") >= 5


def test_guard_conditions_wake_their_executor(stage: Stage) -> None:
    node = stage.node("node")
    events: list[str] = []
    guard = GuardCondition(node.context, lambda: events.append("guard"))

    def ring() -> None:
        timer.cancel()
        guard.trigger()

    timer = node.timer(0.001, ring)
    stage.until(lambda: events)
    assert events == ["guard"]


def test_triggers(stage: Stage) -> None:
    talker = stage.node("talker")
    laser, imu = talker.publisher(Int32, "laser"), talker.publisher(Int32, "imu")
    context = stage.way.open()
    stage.contexts.append(context)
    node = context.node("fusion")
    got: list[tuple[str, Any]] = []
    handles = [node.subscription(Int32, topic, partial(note, got, topic)) for topic in ("laser", "imu")]
    control = Executor(context, trigger=all_of(*handles))
    for handle in handles:
        control.add(handle)
    stage.executors.append(control)
    stage.meet(laser, imu)
    for i in range(3):
        stage.publish(laser, Int32(data=i))
    stage.until(lambda: handles[0].ready(0))
    assert got == []
    stage.publish(imu, Int32(data=9))
    stage.until(lambda: len(got) >= 2)
    assert set(got[:2]) == {("laser", 0), ("imu", 9)}


def test_states_are_told(stage: Stage) -> None:
    node = stage.node("node")
    states: list[str] = []
    node.context.on_state(states.append)
    assert node.context.state == "WAITING"
    stage.until(lambda: node.context.state == "CONNECTED")
    assert node.context.ping(PATIENCE)
    node.context.close()
    assert states[-2:] == ["CONNECTED", "WAITING"]
    node.context.close()


def test_what_a_callback_raises_comes_out_of_spinning(stage: Stage) -> None:
    talker, listener = stage.node("talker"), stage.node("listener")
    publisher = talker.publisher(Int32, "value")
    got: list[int] = []

    def fail(message: Any) -> None:
        got.append(message.data)
        if message.data == 1:
            raise RuntimeError("on purpose")

    listener.subscription(Int32, "value", fail)
    stage.meet(publisher)
    stage.publish(publisher, Int32(data=1))
    with pytest.raises(RuntimeError, match="on purpose"):
        stage.until(lambda: False)
    stage.publish(publisher, Int32(data=2))
    stage.until(lambda: len(got) == 2)
    assert got == [1, 2]


def test_what_was_destroyed_is_gone(stage: Stage) -> None:
    talker, listener = stage.node("talker"), stage.node("listener")
    got: list[int] = []
    publisher = talker.publisher(Int32, "value")
    subscription = listener.subscription(Int32, "value", lambda message: got.append(message.data))
    stage.meet(publisher)
    stage.publish(publisher, Int32(data=1))
    stage.until(lambda: got)
    problems: list[str] = []
    talker.context.on_problem(lambda code, text: problems.append(text))
    subscription.destroy()
    assert not subscription.context.handles
    publisher.destroy()
    assert not publisher.publish(Int32(data=2))
    assert problems[0].startswith("4 B of rt/value dropped: ")
    listener.destroy()
    talker.destroy()
    assert got == [1]


def test_a_closed_context_ends_spinning(stage: Stage) -> None:
    node = stage.node("node")
    node.timer(0.001, node.context.close)
    Executor(node.context).spin()
    assert node.context.state == "WAITING"


def test_spin_period(stage: Stage) -> None:
    node: Any = stage.node("node")
    context: Context = node.context
    calls: list[int] = []

    def work() -> None:
        calls.append(1)
        guard.trigger()
        if len(calls) == 5:
            context.running = False

    guard = GuardCondition(context, work)
    guard.trigger()
    Executor(context).spin_period(0.01)
    assert len(calls) == 5
