"""Events of publishers and subscriptions: deadlines in virtual time, matches, what does not fit, what was lost."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from muros.client import Qos
from muros.rclc import Context, Executor, Node
from muros.space import Liveliness, Topic, open_space
from muros.space import Qos as SpaceQos
from tests.client.world import World
from tests.rclc.test_rclc import two
from tests.rclc_space.ways import Stage

from std_msgs.msg import Int32

OFTEN = Qos(deadline=100)


def nothing(*_: object) -> None:
    """A callback."""


class Seen:
    """A callback that keeps what it is given."""

    def __init__(self) -> None:
        self.events: list[Any] = []

    def __call__(self, event: Any) -> None:
        self.events.append(event)

    @property
    def totals(self) -> list[tuple[int, int]]:
        """How many there were, and how many of them were new, each time."""
        return [(event.total, event.change) for event in self.events]


def test_deadlines_through_an_agent() -> None:
    world = World()
    alice, bob = two(world)
    publisher: Any = alice.node.publisher(Int32, "value", OFTEN)
    subscription = bob.node.subscription(Int32, "value", nothing, OFTEN)
    offered, wanted = Seen(), Seen()
    alice.node.on_events(publisher, deadline_missed=offered)
    events = bob.node.on_events(subscription, deadline_missed=wanted)
    alice.connect()
    bob.connect()
    talking, listening = alice.executor(), bob.executor()
    bob.spin(listening, 500)
    assert wanted.events == [], "the first message starts the watch"
    for _ in range(3):
        assert publisher.publish(Int32(data=1))
        alice.spin(talking, 10)
        bob.spin(listening, 70)
    assert (offered.events, wanted.events) == ([], [])
    alice.spin(talking, 10)
    bob.spin(listening, 110)
    assert wanted.totals[0] == (1, 1)
    bob.spin(listening, 200)
    assert wanted.totals[-1][0] in (2, 3)
    assert sum(change for _, change in wanted.totals) == wanted.totals[-1][0]
    alice.spin(talking, 10)
    assert offered.totals[-1][0] >= 3
    count = len(wanted.events)
    events.destroy()
    bob.spin(listening, 300)
    assert len(wanted.events) == count
    assert events not in bob.context.handles


def test_messages_that_were_lost(stage: Stage) -> None:
    seen = Seen()
    node = stage.node("listener")
    subscription = node.subscription(Int32, "value", nothing, Qos(depth=2))
    events = node.on_events(subscription, message_lost=seen)
    gate = {"open": False}
    executor = Executor(node.context, trigger=lambda handles: gate["open"])
    for handle in list(node.context.handles):
        executor.add(handle)
    stage.executors[-1] = executor
    publisher = stage.node("talker").publisher(Int32, "value")
    stage.meet(publisher)
    for n in range(5):
        stage.publish(publisher, Int32(data=n))
    stage.until(lambda: events._source.count("message_lost", 0) == 3)
    gate["open"] = True
    stage.until(lambda: seen.events)
    assert seen.totals == [(3, 3)]


@pytest.fixture
def node(url: str) -> Iterator[Node]:
    """A node straight in a space."""
    context = Context(url)
    yield context.node("node")
    context.close()


def until(node: Node, condition: Callable[[], Any]) -> None:
    """Spins the node's context until a condition holds."""
    executor = Executor(node.context)
    for _ in range(500):
        if condition():
            return
        executor.spin_some(0.02)
    raise AssertionError("it did not come about")


def test_who_is_matched(node: Node) -> None:
    seen, other = Seen(), Seen()
    publisher = node.publisher(Int32, "value")
    node.on_events(publisher, matched=seen)
    subscription = node.subscription(Int32, "value", nothing)
    until(node, lambda: seen.events)
    assert [(event.total, event.change, event.current) for event in seen.events] == [(1, 1, 1)]
    node.on_events(subscription, matched=other)
    until(node, lambda: other.events)
    assert (other.events[0].total, other.events[0].current) == (1, 1), "what was there before is told, too"
    subscription.destroy()
    until(node, lambda: len(seen.events) == 2)
    assert (seen.events[1].total, seen.events[1].change, seen.events[1].current) == (1, 0, 0)


def test_one_event_hides_no_other(node: Node) -> None:
    """A match that ends at the same moment as something else happens is told of, whichever is told first."""
    seen, lost = Seen(), Seen()
    publisher = node.publisher(Int32, "value", Qos(deadline=50))
    subscription = node.subscription(Int32, "value", nothing)
    until(node, lambda: publisher.matched)
    events = node.on_events(publisher, deadline_missed=lost, matched=seen)
    until(node, lambda: seen.events)
    publisher.publish(Int32(data=1))
    subscription.destroy()
    until_missed(node, events._source)
    events.run(node.context.clock())
    assert lost.events
    assert [event.current for event in seen.events] == [1, 0]


def until_missed(node: Node, source: Any) -> None:
    """Has the middleware work until a deadline was missed, and no executor."""
    end = node.context.clock() + 5000
    while not (source.count("deadline_missed", 0) and source.current() == 0):
        assert node.context.clock() < end
        node.context.middleware.spin_once(node.context.clock())
        node.context.middleware.wait(20)


def test_what_does_not_fit(node: Node) -> None:
    offered, wanted = Seen(), Seen()
    publisher = node.publisher(Int32, "value", "sensor_data")
    node.on_events(publisher, incompatible_qos=offered)
    subscription = node.subscription(Int32, "value", nothing)
    node.on_events(subscription, incompatible_qos=wanted)
    until(node, lambda: offered.events and wanted.events)
    assert (offered.totals, wanted.totals) == ([(1, 1)], [(1, 1)])
    assert "best effort" in wanted.events[0].why


def test_a_publisher_that_falls_silent(dds_url: str) -> None:
    context = Context(dds_url)
    node = context.node("node")
    seen = Seen()
    subscription = node.subscription(Int32, "value", nothing)
    node.on_events(subscription, liveliness_lost=seen)
    other = open_space(dds_url)
    theirs = Context(other)
    topic = Topic("rt/value", "std_msgs::msg::dds_::Int32_")
    by_hand = SpaceQos(liveliness=Liveliness.MANUAL_BY_TOPIC, lease=100_000_000)
    writer = theirs.node("other").participant.participant.writer(topic, by_hand)
    executors = [Executor(context), Executor(theirs)]

    def both(condition: Callable[[], Any]) -> None:
        for _ in range(1000):
            if condition():
                return
            for executor in executors:
                executor.spin_some(0.01)
        raise AssertionError("it did not come about")

    both(lambda: writer.matched)
    writer.write(bytes(4))
    both(lambda: seen.events)
    assert seen.totals == [(1, 1)]
    theirs.close()
    other.close()
    context.close()


def test_deadlines_in_a_space() -> None:
    now = [0]
    space = open_space("local:", clock=lambda: now[0])
    context = Context(space)
    node = context.node("node")
    publisher = node.publisher(Int32, "value", OFTEN)
    subscription = node.subscription(Int32, "value", nothing, OFTEN)
    offered, wanted = Seen(), Seen()
    node.on_events(publisher, deadline_missed=offered)
    node.on_events(subscription, deadline_missed=wanted)
    executor = Executor(context)
    assert publisher.publish(Int32(data=1))
    for ms in range(0, 360, 10):
        now[0] = ms * 1_000_000
        space.tick()
        executor.spin_some()
    assert offered.totals == wanted.totals == [(1, 1), (2, 1), (3, 1)]
    context.close()
    space.close()


@pytest.mark.parametrize(
    ("use", "said"),
    [
        (
            lambda node: node.on_events(node.publisher(Int32, "a"), liveliness=nothing),
            "there is no event 'liveliness'",
        ),
        (
            lambda node: node.on_events(node.publisher(Int32, "a"), matched=5),
            "the callback of matched is a function",
        ),
        (
            lambda node: node.on_events(node.timer(1.0, nothing), matched=nothing),
            "publishers and subscriptions have events",
        ),
    ],
)
def test_wrong_use(use: Callable[[Any], object], said: str) -> None:
    context = Context("local:")
    with pytest.raises(TypeError, match=said) as caught:
        use(context.node("node"))
    assert getattr(caught.value, "code", 0) == 11
    context.close()
