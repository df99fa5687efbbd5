"""Entities on every runtime, by the ids of the acceptance cases: E of the C library, R of its middleware.

Boards meet through a `Broker`. Looking for an agent (R20) is among the tests of transports; refusing what is no type,
name or callback at all is what only computers do.
"""

from muros.client import Qos
from muros.client.raw import Raw
from muros.compat import const
from muros.rclc import Context, Epoch, Executor, GuardCondition, InvalidNameError, RclError, Streamer
from tests.board.agent import Agent
from tests.board.broker import Broker
from tests.board.harness import raises

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any


def nothing(*_: object) -> None:
    """A callback."""


def answer(request: "Any") -> "Any":
    """Adds."""
    return AddTwoInts.Response(sum=request.a + request.b)


class Pair:
    """Somebody who talks and somebody who listens."""

    def __init__(self, **session: "Any") -> None:
        self.broker = Broker()
        self.one = self.broker.context().node("one", "lab")
        self.other = self.broker.context(**session).node("other", "lab")
        self.got: "list[Any]" = []

    def keep(self, message: "Any") -> None:
        """The callback of a subscription."""
        self.got.append(message.data)

    def hold(self, made: "Any") -> "Any":
        """A handle for which things wait: no executor runs it."""
        executor = self.broker.executors[1]
        if executor.trigger is None:
            executor = Executor(self.other.context, trigger=lambda handles: False)
            self.broker.executors[1] = executor
        executor.add(made)
        return made

    def say(self, publisher: "Any", *numbers: int) -> None:
        """Publishes numbers, each of which comes."""
        for i in numbers:
            assert publisher.publish(Int32(data=i))
            self.broker.run(5)


def taken(subscription: "Any") -> "list[int]":
    """The numbers that wait."""
    numbers: "list[int]" = []
    while subscription.ready(subscription.context.clock()):
        numbers.append(subscription.take().data)
    return numbers


def test_e1_init() -> None:
    context = Context(Agent(), 5)
    assert (context.state, context.running, context.domain_id, context.handles) == ("WAITING", True, 0, [])
    for key in (0, bytes(4), b"123"):
        with raises(ValueError):
            Context(Agent(), key)


def test_e2_init_with_a_domain() -> None:
    broker = Broker()
    context = broker.context(7)
    context.node("one", "lab")
    broker.settle()
    assert (context.domain_id, broker.lines[0].objects) == (7, {1: ("/lab/one", 7)})


def test_e3_closing_twice_is_harmless() -> None:
    broker = Broker()
    context = broker.context()
    context.node("one").publisher(Int32, "value")
    broker.settle()
    context.close()
    context.close()
    assert (context.running, context.state) == (False, "WAITING")


def test_e4_node_default() -> None:
    broker = Broker()
    context = broker.context()
    for name, namespace in (("one", ""), ("two", "lab"), ("three", "/lab")):
        context.node(name, namespace)
    broker.settle()
    named = sorted(broker.lines[0].objects[number][0] for number in broker.lines[0].objects)
    assert named == ["/lab/three", "/lab/two", "one"]


def test_e5_node_that_cannot_be() -> None:
    context = Broker().context()
    for name, namespace in (("", ""), ("1st", ""), ("a-b", ""), ("a", "x//y"), ("a", "/x/"), ("ä", "")):
        with raises(InvalidNameError) as caught:
            context.node(name, namespace)
        error: "Any" = caught.value
        assert error.code in (201, 202)
    with raises(ValueError):
        context.node("n" * 60)


def test_e6_to_e11_a_message_arrives() -> None:
    for qos in ("default", "best_effort", Qos(True, 3, "transient_local")):
        pair = Pair()
        publisher = pair.one.publisher(Int32, "value", qos)
        pair.other.subscription(Int32, "value", pair.keep, qos)
        pair.broker.settle()
        assert publisher.publish(Int32(data=42))
        pair.broker.until(lambda pair=pair: pair.got)  # type: ignore[misc]
        assert pair.got == [42]


def test_e6_to_e11_what_cannot_be_leaves_nothing() -> None:
    node = Broker().context().node("one")
    uses: "list[Any]" = [
        lambda: node.publisher(Int32, "no name"),
        lambda: node.publisher(Int32, ""),
        lambda: node.publisher(Int32, "x" * 60),
        lambda: node.publisher(Int32, "value", "nonsense"),
        lambda: node.subscription(Int32, "no name", nothing),
        lambda: node.subscription(Int32, "x" * 60, nothing),
        lambda: node.subscription(Int32, "value", nothing, "nonsense"),
    ]
    for use in uses:
        with raises(ValueError):
            use()
    assert (node.entities, node.context.handles) == ([], [])


def test_e12_to_e14_service() -> None:
    broker = Broker()
    node = broker.context().node("one", "lab")
    for name, qos in (("add_two_ints", "services"), ("~/add", "services"), ("/quick", Qos(False, 10))):
        node.service(AddTwoInts, name, answer, qos)
    broker.settle()
    objects = broker.lines[0].objects
    named = [objects[number] for number in sorted(objects) if number & 15 == 8]
    assert named == ["/lab/add_two_ints", "/lab/one/add", "/quick"]
    for name in ("no name", "", "x" * 60):
        with raises(ValueError):
            node.service(AddTwoInts, name, answer)
    assert len(node.context.handles) == 3


def test_e15_to_e17_client() -> None:
    broker = Broker()
    client = broker.context().node("one").client(AddTwoInts, "add_two_ints")
    broker.settle()
    answers: "list[Any]" = []
    assert client.send(AddTwoInts.Request(a=1), answers.append, timeout=0.05)
    broker.run(60)
    assert answers == [None], "no server is there, and the request was taken all the same"
    assert client.call(AddTwoInts.Request(a=1), 0.05) is None


def test_e18_timer() -> None:
    broker = Broker()
    node = broker.context().node("one")
    calls: "list[int]" = []
    still = node.timer(0.1, lambda: calls.append(broker.now), autostart=False)
    assert still.cancelled
    broker.run(400)
    assert calls == [], "without autostart it is silent until it is reset"
    still.reset()
    start = broker.now
    broker.run(350)
    assert calls == [start + 100, start + 200, start + 300]


def test_r1_to_r6_entities_come_and_go() -> None:
    broker = Broker()
    context = broker.context()
    objects = broker.lines[0].objects
    for _ in range(3):
        node = context.node("one")
        several = [node.publisher(Int32, "value") for _ in range(3)]
        several += [node.subscription(Int32, "value", nothing) for _ in range(3)]
        several += [node.service(AddTwoInts, "add", answer), node.client(AddTwoInts, "add")]
        broker.settle()
        assert len(objects) == 1 + 3 * 2 + 3 * 2 + 2, "several on one topic share nothing"
        for made in several[::2]:
            made.destroy()
        broker.settle()
        assert len(objects) == 1 + 2 + 2 * 2 + 1
        node.destroy()
        broker.settle()
        assert (objects, context.handles) == ({}, [])


def test_r7_continuous_fragment() -> None:
    pair = Pair(largest=31000)
    publisher = pair.one.publisher(String, "value")
    pair.other.subscription(String, "value", pair.keep)
    pair.broker.settle()
    said = "".join([chr(32 + i % 90) for i in range(30000)])
    assert publisher.publish(String(data=said))
    pair.broker.until(lambda: pair.got)
    assert pair.got == [said]


def test_r8_continuous_fragment_with_callbacks() -> None:
    pair = Pair(largest=11000)
    publisher = pair.one.publisher(String, "value")
    pair.other.subscription(String, "value", pair.keep)
    pair.broker.settle()
    body = bytearray(10010)
    String(data="head: " + "x" * 9999).write(body, 0)
    ended: "list[bool]" = []

    def fill(buf: bytearray, off: int, n: int, at: int) -> None:
        buf[off : off + n] = body[10 + at : 10 + at + n]

    streamer = Streamer(publisher, fill, 0, more=lambda: 10000, on_end=ended.append)
    assert streamer.publish(Raw(body[:10]))
    pair.broker.until(lambda: pair.got and ended)
    assert (pair.got, ended) == (["head: " + "x" * 9999], [True])


def test_r9_publish_and_receive() -> None:
    pair = Pair()
    publisher = pair.one.publisher(String, "value")
    pair.other.subscription(String, "value", pair.keep)
    pair.broker.settle()
    said = "what was said, ä and all " * 8
    assert publisher.publish(String(data=said))
    pair.broker.until(lambda: pair.got)
    assert pair.got == [said]


def test_r10_wait_timeout() -> None:
    broker = Broker()
    broker.context().node("one").subscription(Int32, "value", nothing)
    broker.settle()
    start = broker.now
    assert broker.executors[0].spin_some(0.01) is False, "nothing was sent"
    assert broker.now >= start + 10


def test_r11_take_expired() -> None:
    pair = Pair()
    publisher = pair.one.publisher(Int32, "value")
    made = pair.hold(pair.other.subscription(Int32, "value", nothing, Qos(lifespan=100)))
    pair.broker.settle()
    pair.say(publisher, 1)
    assert made.ready(pair.broker.now)
    pair.broker.run(100)
    assert not made.ready(pair.broker.now)
    assert (made.take(), made.expired) == (None, 1)


def test_r12_and_r13_what_is_fresh_comes_in_order() -> None:
    pair = Pair()
    publisher = pair.one.publisher(Int32, "value")
    short, long = [
        pair.hold(pair.other.subscription(Int32, "value", nothing, Qos(lifespan=lifespan)))
        for lifespan in (100, 1000)
    ]
    pair.broker.settle()
    pair.say(publisher, 1)
    pair.broker.run(100)
    assert (taken(short), taken(long)) == ([], [1])
    pair.say(publisher, 2, 3)
    fresh = taken(long)
    assert fresh in ([2, 3], [3]), "boards have one message object"
    assert taken(short) == fresh
    assert (short.expired, long.expired) == (1, 0)


def test_what_is_fresh_is_delivered() -> None:
    pair = Pair()
    publisher = pair.one.publisher(Int32, "value")
    pair.other.subscription(Int32, "value", pair.keep, Qos(lifespan=100))
    pair.broker.settle()
    pair.say(publisher, 1, 2, 3)
    assert pair.got == [1, 2, 3]


def test_r14_and_r15_what_waits() -> None:
    pair = Pair()
    publisher = pair.one.publisher(Int32, "value")
    made = pair.hold(pair.other.subscription(Int32, "value", nothing, Qos(depth=4)))
    pair.broker.settle()
    pair.say(publisher, *range(10))
    waits = taken(made)
    assert waits == list(range(10))[-len(waits) :], "the newest, in order"
    assert len(waits) in (1, 4), "boards have one message object"
    assert made.lost == 10 - len(waits)


def test_r16_request_and_reply() -> None:
    pair = Pair()
    identities: "list[bytes]" = []

    def serve(request: "Any") -> "Any":
        identities.append(service.identity)
        return answer(request)

    service = pair.other.service(AddTwoInts, "add", serve)
    client = pair.one.client(AddTwoInts, "add")
    pair.broker.settle()
    sums: "dict[int, int]" = {}

    def ask(n: int) -> None:
        def keep(reply: "Any") -> None:
            sums[n] = reply.sum

        assert client.send(AddTwoInts.Request(a=n, b=10), keep)

    for n in range(3):
        ask(n)
    pair.broker.until(lambda: len(sums) == 3)
    assert sums == {0: 10, 1: 11, 2: 12}, "each reply goes to its own request"
    assert len(set(identities)) == 3
    assert [len(identity) for identity in identities] == [24] * 3
    assert client.call(AddTwoInts.Request(a=20, b=22)).sum == 42


def test_r17_request_expired() -> None:
    pair = Pair()
    service = pair.hold(pair.other.service(AddTwoInts, "add", answer, Qos(lifespan=100)))
    client = pair.one.client(AddTwoInts, "add")
    pair.broker.settle()
    sums: "list[int]" = []

    def ask(n: int) -> None:
        assert client.send(AddTwoInts.Request(a=n), lambda reply: sums.append(reply.sum))

    ask(1)
    pair.broker.run(50)
    ask(2)
    pair.broker.run(60)
    assert service.ready(pair.broker.now)
    assert service.expired == 1
    pair.broker.executors[1].trigger = None
    ask(3)
    pair.broker.until(lambda: len(sums) == 2)
    assert (sums, service.expired) == ([2, 3], 1)


def test_r18_reply_expired() -> None:
    pair = Pair()
    service = pair.other.service(AddTwoInts, "add", lambda request: None)
    client = pair.one.client(AddTwoInts, "add")
    pair.broker.settle()
    replies: "list[Any]" = []
    assert client.send(AddTwoInts.Request(a=1), replies.append, 0.05)
    pair.broker.until(lambda: replies)
    service.reply(service.identity, AddTwoInts.Response(sum=1))
    pair.broker.run(50)
    assert replies == [None], "who asked has given up before the reply came"


def test_r19_init_and_shutdown_again() -> None:
    for _ in range(5):
        broker = Broker()
        context = broker.context()
        context.node("one").subscription(Int32, "value", nothing)
        broker.settle()
        assert context.state == "CONNECTED"
        context.close()
        assert context.state == "WAITING"


def test_r21_agent_ping() -> None:
    broker = Broker()
    context = broker.context()
    broker.settle()
    assert context.ping(0.1)
    broker.lines[0].quiet = True
    assert not context.ping(0.1)
    broker.lines[0].quiet = False
    assert context.ping(0.1)


def test_r22_sync_session() -> None:
    broker = Broker()
    epoch = Epoch(broker.context())
    assert (epoch.synchronized, epoch.millis()) == (False, 0)
    broker.settle()
    assert epoch.sync(0.1)
    assert 0 <= epoch.millis() - broker.now <= 5000
    broker.lines[0].quiet = True
    assert not epoch.sync(0.05)


def test_r23_guard_condition() -> None:
    broker = Broker()
    calls: "list[int]" = []
    guard = GuardCondition(broker.context(), lambda: calls.append(1))
    broker.settle()
    guard.trigger()
    broker.run(2)
    assert calls == [1], "it is reset by itself"


def test_errors_bear_codes() -> None:
    assert (RclError.code, InvalidNameError.code) == (1, 201)


def test_an_agent_that_begins_again() -> None:
    """Everything is made again, and goes on; what had been taken for sending arrives."""
    pair = Pair(keepalive=100)
    publisher = pair.one.publisher(Int32, "value")
    pair.other.subscription(Int32, "value", pair.keep)
    pair.other.service(AddTwoInts, "add", answer)
    client = pair.one.client(AddTwoInts, "add")
    pair.broker.settle()
    before = [dict(line.objects) for line in pair.broker.lines]
    pair.say(publisher, 1)
    for line in pair.broker.lines:
        line.quiet = True
    assert publisher.publish(Int32(data=2)), "nobody has noticed yet"
    pair.broker.run(5000)
    assert [executor.context.state for executor in pair.broker.executors] == ["LOST", "LOST"]
    assert not publisher.publish(Int32(data=3))
    for line in (pair.broker.lines[1], pair.broker.lines[0]):
        line.restart()
        line.quiet = False
        pair.broker.run(3000)
    pair.broker.settle()
    assert [line.objects for line in pair.broker.lines] == before
    pair.say(publisher, 4)
    assert pair.got == [1, 2, 4]
    assert client.call(AddTwoInts.Request(a=1, b=2)).sum == 3
