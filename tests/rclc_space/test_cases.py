"""Entities over every way, by the ids of the acceptance cases: E1 to E18 of the C library, R1 to R23 of its middleware.

What has no case here has one elsewhere: R22 with the epoch, R24 with the memory. What is null in C is None here.
"""

import json
import threading
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import pytest

import muros.rclc
from muros.client import Qos, Udp, discover, ping
from muros.client.raw import Raw
from muros.links import DiscoveryLink, UdpLink
from muros.rclc import Context, Executor, GuardCondition, InvalidNameError, Node, Streamer
from tests.client.agent_thread import RunningAgent
from tests.dds.domains import free_domain
from tests.rclc_space.ways import PATIENCE, Stage, ThroughAgent

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String

CODES: dict[str, dict[str, int]] = json.loads(
    (Path(__file__).parents[1] / "vectors/rmw/return_codes.json").read_text()
)
INVALID_ARGUMENT = CODES["rcl"]["INVALID_ARGUMENT"]
NONE: Any = None


LARGE = 30_000
"""Characters of a text that takes many messages."""


def nothing(*_: object) -> None:
    """A callback."""


def refused(use: Callable[[], object], code: int = INVALID_ARGUMENT) -> None:
    """It is refused, with a return code of the C library and in one line."""
    with pytest.raises((TypeError, ValueError)) as caught:
        use()
    assert getattr(caught.value, "code", None) == code
    assert "\n" not in str(caught.value)


def answer(request: Any) -> Any:
    """Adds."""
    return AddTwoInts.Response(sum=request.a + request.b)


class Pair:
    """Somebody who talks and somebody who listens, each in a context of his own."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.one = stage.node("one", "lab")
        self.other = stage.node("other", "lab")
        self.got: list[Any] = []

    def round_trip(self, qos: str | Qos) -> None:
        """A message arrives."""
        publisher = self.one.publisher(Int32, "value", qos)
        self.other.subscription(Int32, "value", lambda message: self.got.append(message.data), qos)
        self.stage.meet(publisher)
        self.stage.until(lambda: self.got, lambda: publisher.publish(Int32(data=42)))
        assert set(self.got) == {42}

    def hold(self, qos: Qos, kind: Any = Int32) -> Any:
        """A subscription of the other whose messages wait: no executor runs it."""
        made = self.other.subscription(kind, "value", nothing, qos)
        executor = Executor(self.other.context, trigger=lambda handles: False)
        executor.add(made)
        self.stage.executors[1] = executor
        return made

    def send(self, publisher: Any, *numbers: int) -> None:
        """Publishes numbers, each of which the other side has had time to take."""
        for number in numbers:
            self.stage.publish(publisher, Int32(data=number))
            for executor in self.stage.executors * 2:
                executor.spin_some(0.002)


def test_e1_init(stage: Stage) -> None:
    context = stage.run(stage.way.open())
    stage.until(lambda: context.wait_connected(0.001))
    refused(lambda: Context(None))
    refused(lambda: Context(NONE, 5))
    if isinstance(stage.way, ThroughAgent):
        transport = stage.way.transport()
        refused(lambda: Context(Udp))
        refused(lambda: Context(transport, 0))
        refused(lambda: Context(transport, space="local:"))
    else:
        refused(lambda: Context("nothing:"))
        refused(lambda: Context("local:", 5))


def test_e2_init_with_a_domain(stage: Stage) -> None:
    refused(lambda: stage.way.open(233))
    refused(lambda: stage.way.open(-1))
    with free_domain() as ours, free_domain() as theirs:
        talker, listener, other = (stage.run(stage.way.open(domain)) for domain in (ours, ours, theirs))
        assert (talker.domain_id, other.domain_id) == (ours, theirs)
        got: list[int] = []
        strange: list[int] = []
        listener.node("one").subscription(Int32, "value", lambda message: got.append(message.data))
        other.node("one").subscription(Int32, "value", lambda message: strange.append(message.data))
        publisher = talker.node("one").publisher(Int32, "value")
        stage.meet(publisher)
        stage.until(lambda: len(got) > 2, lambda: publisher.publish(Int32(data=7)))
        assert set(got) == {7}
        assert strange == []
        stage.close()


def test_e3_closing_twice_is_harmless(stage: Stage) -> None:
    context = stage.way.open()
    context.node("one").publisher(Int32, "value")
    context.close()
    context.close()
    assert not context.running


def test_e4_node_default(stage: Stage) -> None:
    context = stage.way.open()
    assert context.node("one").full_name == "/one"
    assert context.node("two", "lab").full_name == "/lab/two"
    assert context.node("three", "/lab").full_name == "/lab/three"
    context.close()


def test_e5_node_that_cannot_be(stage: Stage) -> None:
    context = stage.way.open()
    refused(lambda: context.node(NONE))
    refused(lambda: context.node("one", NONE))
    for name, namespace, said in (
        ("", "", "NODE_INVALID_NAME"),
        ("a b", "", "NODE_INVALID_NAME"),
        ("one", "a//b", "NODE_INVALID_NAMESPACE"),
    ):
        refused(lambda name=name, namespace=namespace: context.node(name, namespace), CODES["rcl"][said])  # type: ignore[misc]
    context.close()


@pytest.mark.parametrize(
    ("case", "qos"),
    [("e6 e9", "default"), ("e7 e10", "best_effort"), ("e8 e11", Qos(True, 3, "transient_local"))],
)
def test_e6_to_e11_a_message_arrives(stage: Stage, case: str, qos: str | Qos) -> None:
    Pair(stage).round_trip(qos)


def test_e6_to_e11_nulls(stage: Stage) -> None:
    node = stage.node("one")
    for use in (
        lambda: node.publisher(NONE, "value"),
        lambda: node.publisher(Int32, NONE),
        lambda: node.publisher(Int32, "value", NONE),
        lambda: node.publisher(Int32, "value", "nonsense"),
        lambda: node.subscription(NONE, "value", nothing),
        lambda: node.subscription(Int32, NONE, nothing),
        lambda: node.subscription(Int32, "value", nothing, NONE),
        lambda: node.subscription(Int32, "value", 5),  # type: ignore[arg-type]
    ):
        refused(use)
    refused(lambda: node.publisher(Int32, "no name"), CODES["rcl"]["TOPIC_NAME_INVALID"])
    assert (node.entities, node.context.handles) == ([], [])


def test_e12_to_e14_service(stage: Stage) -> None:
    node = stage.node("one", "lab")
    assert node.service(AddTwoInts, "add_two_ints", answer).name == "/lab/add_two_ints"
    assert stage.node("two").service(AddTwoInts, "add_two_ints", answer, "services").name == "/add_two_ints"
    best_effort = Qos(False, 10)
    assert node.service(AddTwoInts, "/quick", answer, best_effort).name == "/quick"
    for use in (
        lambda: node.service(NONE, "add", answer),
        lambda: node.service(AddTwoInts, NONE, answer),
        lambda: node.service(AddTwoInts, "add", NONE),
        lambda: node.service(AddTwoInts, "add", answer, NONE),
        lambda: node.service(Int32, "add", answer),
    ):
        refused(use)
    refused(lambda: node.service(AddTwoInts, "no name", answer), CODES["rcl"]["SERVICE_NAME_INVALID"])


def test_e15_to_e17_client(stage: Stage) -> None:
    node = stage.node("one")
    client = node.client(AddTwoInts, "add_two_ints")
    assert client.name == "/add_two_ints"
    answers: list[Any] = []
    stage.until(lambda: client.send(AddTwoInts.Request(a=1), answers.append, timeout=0.05))
    stage.until(lambda: answers)
    assert answers == [None], "no server is there, and the request was taken all the same"
    for use in (
        lambda: node.client(NONE, "add"),
        lambda: node.client(AddTwoInts, NONE),
        lambda: node.client(AddTwoInts, "add", NONE),
        lambda: client.send(NONE, nothing),
        lambda: client.send(AddTwoInts.Request(), NONE),
    ):
        refused(use)


def test_e18_timer(stage: Stage) -> None:
    context = stage.way.open()
    context.clock = lambda: now[0]
    node = context.node("one")
    now = [1000]
    calls: list[int] = []
    still = node.timer(0.1, lambda: calls.append(now[0]), autostart=False)
    assert still.cancelled
    executor = Executor(context)
    for now[0] in range(1000, 1400, 10):
        executor.spin_some()
    assert calls == [], "without autostart it is silent until it is reset"
    still.reset()
    for now[0] in range(1400, 1750, 10):
        executor.spin_some()
    assert calls == [1490, 1590, 1690] or calls == [1500, 1600, 1700]
    refused(lambda: node.timer(NONE, nothing))
    refused(lambda: node.timer(-1.0, nothing))
    refused(lambda: node.timer(1.0, NONE))
    context.close()


def test_r1_node_and_what_is_left_of_it(stage: Stage) -> None:
    context = stage.way.open()
    for _ in range(20):
        node = context.node("one")
        node.publisher(Int32, "value")
        node.destroy()
        node.destroy()
    assert context.handles == []
    context.close()


MAKERS: dict[str, Callable[[Node, int], Any]] = {
    "r2": lambda node, n: node.publisher(Int32, "value"),
    "r3": lambda node, n: node.subscription(Int32, "value", nothing),
    "r4": lambda node, n: node.service(AddTwoInts, f"add_{n}", answer),
    "r5": lambda node, n: node.client(AddTwoInts, "add"),
}


@pytest.mark.parametrize("case", MAKERS)
def test_r2_to_r5_entities_come_and_go(stage: Stage, case: str) -> None:
    node = stage.node("one")
    several = [MAKERS[case](node, n) for n in range(5)]
    stage.until(lambda: node.context.wait_connected(0.001))
    for made in several[:3]:
        made.destroy()
    again = MAKERS[case](node, 0)
    stage.until(lambda: node.context.wait_connected(0.001))
    for made in (*several[3:], again):
        made.destroy()
    assert node.context.handles == []


def test_r2_r6_several_on_one_topic_share_nothing(stage: Stage) -> None:
    pair = Pair(stage)
    first, second = (pair.one.publisher(Int32, "value") for _ in range(2))
    pair.other.subscription(Int32, "value", lambda message: pair.got.append(message.data))
    stage.meet(first, second)
    stage.until(
        lambda: {1, 2} <= set(pair.got), lambda: (first.publish(Int32(data=1)), second.publish(Int32(data=2)))
    )
    first.destroy()
    pair.got.clear()
    stage.until(lambda: 3 in pair.got, lambda: second.publish(Int32(data=3)))


def test_r7_continuous_fragment(stage: Stage) -> None:
    pair = Pair(stage)
    text = "".join(chr(32 + i % 90) for i in range(LARGE))
    publisher = pair.one.publisher(String, "value")
    pair.other.subscription(String, "value", lambda message: pair.got.append(message.data))
    stage.meet(publisher)
    stage.publish(publisher, String(data=text))
    stage.until(lambda: pair.got)
    assert pair.got == [text]


def test_r8_continuous_fragment_with_callbacks(stage: Stage) -> None:
    pair = Pair(stage)
    body = String(data="head: " + "x" * 9_999).serialize()
    ended: list[bool] = []

    def fill(buf: bytearray, off: int, n: int, at: int) -> None:
        buf[off : off + n] = body[10 + at : 10 + at + n]

    publisher = pair.one.publisher(String, "value")
    pair.other.subscription(String, "value", lambda message: pair.got.append(message.data))
    streamer = Streamer(publisher, fill, 0, more=lambda: len(body) - 10, on_end=ended.append)
    stage.meet(publisher)
    assert len(body) == 10_010
    stage.until(lambda: streamer.publish(Raw(body[:10])))
    stage.until(lambda: pair.got and ended)
    assert (pair.got, ended) == (["head: " + "x" * 9_999], [True])


def test_r9_publish_and_receive(stage: Stage) -> None:
    pair = Pair(stage)
    text = "what was said, ä and all " * 8
    publisher = pair.one.publisher(String, "value")
    pair.other.subscription(String, "value", lambda message: pair.got.append(message.data))
    stage.meet(publisher)
    stage.until(lambda: pair.got, lambda: publisher.publish(String(data=text)))
    assert pair.got[0] == text


def test_r10_wait_timeout(stage: Stage) -> None:
    node = stage.node("one")
    node.subscription(Int32, "value", nothing)
    assert stage.executors[0].spin_some(0.01) is False, "nothing was sent"


def test_r11_take_expired(stage: Stage) -> None:
    pair = Pair(stage)
    move_on = later(pair.other)
    subscription = pair.hold(Qos(lifespan=LONG))
    publisher = pair.one.publisher(Int32, "value")
    stage.meet(publisher)
    stage.until(lambda: subscription._waiting, lambda: publisher.publish(Int32(data=1)))
    count = len(subscription._waiting)
    clock = pair.other.context.clock
    assert subscription.ready(clock())
    move_on(LONG)
    assert not subscription.ready(clock())
    assert subscription.take() is None
    assert subscription.expired == count


def test_r12_and_r13_what_is_fresh_comes_in_order(stage: Stage) -> None:
    pair = Pair(stage)
    move_on = later(pair.other)
    short = pair.hold(Qos(lifespan=LONG))
    long: Any = pair.other.subscription(Int32, "value", nothing, Qos(lifespan=10 * LONG))
    stage.executors[1].add(long)
    publisher = pair.one.publisher(Int32, "value")
    stage.meet(publisher)
    stage.until(lambda: short._waiting and long._waiting, lambda: publisher.publish(Int32(data=0)))
    for _ in range(20):  # nothing of it is under way still
        for executor in stage.executors:
            executor.spin_some(0.002)
    move_on(LONG)
    pair.send(publisher, 1, 2, 3)
    stage.until(lambda: long._waiting[-1].data == short._waiting[-1].data == 3)
    assert [message.data for message in iter(short.take, None)] == [1, 2, 3]
    taken = [message.data for message in iter(long.take, None)]
    assert taken[-4:] == [0, 1, 2, 3], "another subscription has them still, in the order they were sent"


def test_r14_keep_all(stage: Stage) -> None:
    pair = Pair(stage)
    subscription = pair.hold(Qos(keep_all=True))
    publisher = pair.one.publisher(Int32, "value", Qos(keep_all=True))
    stage.meet(publisher)
    stage.until(lambda: subscription._waiting, lambda: publisher.publish(Int32(data=0)))
    pair.send(publisher, *range(1, 11))
    stage.until(lambda: subscription._waiting[-1].data == 10)
    assert [message.data for message in iter(subscription.take, None)][-10:] == list(range(1, 11))
    assert subscription.lost == 0, "there is no pool of four here: all are kept"


def test_r15_keep_last(stage: Stage) -> None:
    pair = Pair(stage)
    subscription = pair.hold(Qos(depth=4))
    publisher = pair.one.publisher(Int32, "value")
    stage.meet(publisher)
    stage.until(lambda: subscription._waiting, lambda: publisher.publish(Int32(data=0)))
    pair.send(publisher, *range(1, 11))
    stage.until(lambda: subscription._waiting[-1].data == 10)
    assert [subscription.take().data for _ in range(4)] == [7, 8, 9, 10]
    assert subscription.take() is None


def test_r16_request_and_reply(stage: Stage) -> None:
    identities: list[bytes] = []

    def serve(request: Any) -> Any:
        identities.append(service.identity)
        return answer(request)

    service = stage.node("one").service(AddTwoInts, "add", serve)
    client = stage.node("other").client(AddTwoInts, "add")
    stage.meet(client)
    sums: dict[int, int] = {}

    def ask(n: int) -> bool:
        return client.send(AddTwoInts.Request(a=n, b=10), lambda reply: sums.update({n: reply.sum}))

    for n in range(3):
        stage.until(partial(ask, n))
    stage.until(lambda: len(sums) == 3)
    assert sums == {0: 10, 1: 11, 2: 12}, "each reply goes to its own request"
    assert len(set(identities)) == 3
    assert {len(identity) for identity in identities} == {24}


def test_r17_request_expired(stage: Stage) -> None:
    node = stage.node("one")
    move_on = later(node)
    service: Any = node.service(AddTwoInts, "add", answer, Qos(lifespan=LONG))
    executor = Executor(node.context, trigger=lambda handles: False)
    executor.add(service)
    stage.executors[0] = executor
    client = stage.node("other").client(AddTwoInts, "add")
    stage.meet(client)
    stage.until(lambda: client.send(AddTwoInts.Request(), nothing))
    stage.until(lambda: service._waiting)
    assert service.ready(node.context.clock())
    move_on(LONG)
    assert not service.ready(node.context.clock())
    assert service.expired == 1


def test_r18_reply_expired(stage: Stage) -> None:
    server = stage.node("one")
    service = server.service(AddTwoInts, "add", lambda request: None)
    other = stage.node("other")
    client = other.client(AddTwoInts, "add")
    stage.meet(client)
    replies: list[Any] = []
    stage.until(lambda: client.send(AddTwoInts.Request(a=1), replies.append, timeout=0.05))
    stage.until(lambda: replies and service.identity)
    service.reply(service.identity, AddTwoInts.Response(sum=1))
    stage.until(lambda: client.send(AddTwoInts.Request(a=2), replies.append, timeout=0.05))
    stage.until(lambda: len(replies) == 2)
    assert replies == [None, None], "who asked has given up before the reply came"


def test_what_is_fresh_is_delivered_and_answered(stage: Stage) -> None:
    Pair(stage).round_trip(Qos(lifespan=LONG))
    service: Any = stage.node("server").service(AddTwoInts, "add", answer, Qos(lifespan=LONG))
    client = stage.node("client").client(AddTwoInts, "add")
    stage.meet(client)
    sums: list[int] = []
    for n in range(3):
        stage.until(partial(client.send, AddTwoInts.Request(a=n), lambda reply: sums.append(reply.sum)))
    stage.until(lambda: len(sums) == 3)
    assert (sorted(sums), service.expired) == ([0, 1, 2], 0)


def test_r19_init_and_shutdown_again(stage: Stage) -> None:
    for _ in range(5):
        context = stage.way.open()
        context.node("one").subscription(Int32, "value", nothing)
        assert context.wait_connected(10.0)
        context.close()
    assert not context.wait_connected(0.01)


def test_r20_autodiscover(stage: Stage) -> None:
    if stage.way.direct:
        assert stage.run(stage.way.open()).ping(0.0), "there is nobody to look for"
        return
    data, door = UdpLink(0, "127.0.0.1"), DiscoveryLink(0)
    agent = RunningAgent(data, door)
    try:
        ((host, port),) = discover(["127.0.0.1"], door.port, attempts=5)
        context = Context(Udp(host, port))
        assert context.wait_connected(PATIENCE)
        assert context.ping(PATIENCE), "it works afterwards"
        context.close()
    finally:
        agent.stop()


def test_r21_agent_ping(stage: Stage) -> None:
    if isinstance(stage.way, ThroughAgent):
        transport = stage.way.transport()
        assert ping(transport, 5), "before there is a session"
        transport.close()
    context = stage.way.open()
    context.node("one")
    assert context.wait_connected(PATIENCE)
    assert context.ping(PATIENCE), "and within it"
    context.close()
    assert not context.ping(0.05)


def test_r23_guard_condition(stage: Stage) -> None:
    node = stage.node("one")
    calls: list[int] = []
    guard = GuardCondition(node.context, lambda: calls.append(1))
    assert not stage.executors[0].spin_some(0.001)
    guard.trigger()
    stage.until(lambda: calls)
    assert not stage.executors[0].spin_some(0.001), "it is reset by itself"
    assert calls == [1]
    end = node.context.clock() + 1000 * PATIENCE
    threading.Timer(0.05, guard.trigger).start()
    assert stage.executors[0].spin_some(2 * PATIENCE)
    assert calls == [1, 1]
    assert node.context.clock() < end, "it ends a wait"


LONG = 1_000_000
"""A lifespan in ms that no test lives to see the end of, unless time is moved on."""


def later(node: Node) -> Callable[[int], None]:
    """Gives a function that moves the clock of a node's context on, in ms."""
    real = node.context.clock
    moved = [0]
    node.context.clock = lambda: real() + moved[0]

    def move(ms: int) -> None:
        moved[0] += ms

    return move


def test_every_error_has_a_return_code_of_the_c_library() -> None:
    known = {code for name, table in CODES.items() if name != "notes" for code in table.values()}
    found: dict[str, int] = {}
    for module in walk_packages(muros.rclc.__path__, "muros.rclc."):
        if module.name.rpartition(".")[2].startswith("_"):
            continue  # types alone
        for name, kind in vars(import_module(module.name)).items():
            if isinstance(kind, type) and issubclass(kind, Exception) and kind.__module__ == module.name:
                found[name] = getattr(kind, "code", -1)
                assert found[name] in known, name
    assert len(found) >= 18
    assert found["ParameterRejectedError"] == CODES["rclc"]["PARAMETER_MODIFICATION_REJECTED"]
    assert found["ParameterTypeError"] == CODES["rclc"]["PARAMETER_TYPE_MISMATCH"]
    assert found["ParameterMemoryError"] == CODES["rclc"]["PARAMETER_UNSUPORTED_ON_LOW_MEM"]
    assert found["ParameterChangingError"] == CODES["rclc"]["PARAMETER_DISABLED_ON_CALLBACK"]
    assert issubclass(InvalidNameError, ValueError)


def test_what_is_destroyed_is_forgotten(stage: Stage) -> None:
    node = stage.node("one")
    kept = node.publisher(Int32, "kept")
    for n in range(30):
        made: list[Any] = [MAKERS[case](node, n) for case in MAKERS]
        made.append(node.timer(1.0, nothing))
        for one in made:
            one.destroy()
    assert len(node.entities) == 1
    node.destroy()
    assert node.entities == []
    del kept


def test_a_value_that_does_not_fit_has_a_return_code_too(stage: Stage) -> None:
    pair = Pair(stage)
    publisher = pair.one.publisher(Int32, "value")
    pair.other.subscription(Int32, "value", print)
    stage.meet(publisher)
    with pytest.raises(ValueError, match=r"Int32\.data: 1099511627776 does not fit int32") as caught:
        publisher.publish(Int32(data=2**40))
    assert getattr(caught.value, "code", None) == 1
