"""What the agent of muros tells its clients of their publishers and subscriptions, in virtual time."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.agent import _events_proxy
from muros.client import Qos
from muros.rclc import Executor, Threads
from muros.rclc.host import agent_events
from muros.rclc.host.agent_events import LONGEST_WHY, NOT_TOLD, PATIENCE, TOPIC, News, pack, read_untrusted
from muros.space import Liveliness, Topic
from muros.space import Qos as SpaceQos
from tests.client.world import World
from tests.rclc.test_rclc import Board, two
from tests.rclc_space.test_events import Seen, nothing
from tests.rclc_space.ways import Stage, ThroughAgent

from std_msgs.msg import Int32

INT32 = "std_msgs::msg::dds_::Int32_"


class Pair:
    """Two boards, the first with a publisher, and their executors."""

    def __init__(self, qos: str | Qos = "default") -> None:
        self.world = World()
        self.alice, self.bob = two(self.world)
        self.publisher: Any = self.alice.node.publisher(Int32, "value", qos)
        self.talking, self.listening = self.alice.executor(), self.bob.executor()

    def run(self, ms: int = 100) -> None:
        """Lets both run."""
        for _ in range(ms // 10):
            self.alice.spin(self.talking, 5)
            self.bob.spin(self.listening, 5)


def test_who_is_matched() -> None:
    pair = Pair()
    offered, wanted = Seen(), Seen()
    events = pair.alice.node.on_events(pair.publisher, matched=offered)
    pair.run()
    assert offered.events == []
    subscription = pair.bob.node.subscription(Int32, "value", nothing)
    pair.bob.node.on_events(subscription, matched=wanted)
    pair.run()
    assert [(event.total, event.change, event.current) for event in offered.events] == [(1, 1, 1)]
    assert [(event.total, event.change, event.current) for event in wanted.events] == [(1, 1, 1)]
    subscription.destroy()
    pair.run()
    assert [(event.total, event.change, event.current) for event in offered.events][1:] == [(1, 0, 0)]
    events.destroy()
    pair.bob.node.subscription(Int32, "value", nothing)
    pair.run()
    assert len(offered.events) == 2
    assert not any(isinstance(proxy, _events_proxy.EventsProxy) for proxy in objects(pair, "alic"))


def objects(pair: Pair, key: str) -> list[Any]:
    """What a board has at the agent."""
    return list(pair.world.core.clients[key.encode()].objects.values())


def test_what_does_not_fit() -> None:
    pair = Pair("sensor_data")
    offered, wanted = Seen(), Seen()
    subscription = pair.bob.node.subscription(Int32, "value", nothing)
    pair.run()
    pair.alice.node.on_events(pair.publisher, incompatible_qos=offered, matched=nothing)
    pair.bob.node.on_events(subscription, incompatible_qos=wanted)
    pair.run()
    assert offered.totals == wanted.totals == [(1, 1)], "what was there before is told, too"
    assert "best effort" in wanted.events[0].why
    pair.world.participant.reader(Topic("rt/value", INT32), SpaceQos.preset("default"))
    pair.run()
    assert offered.totals == [(1, 1), (2, 1)]


def test_a_publisher_that_falls_silent() -> None:
    pair = Pair()
    seen = Seen()
    subscription = pair.bob.node.subscription(Int32, "other", nothing)
    pair.bob.node.on_events(subscription, liveliness_lost=seen)
    pair.run()
    by_hand = SpaceQos(liveliness=Liveliness.MANUAL_BY_TOPIC, lease=100_000_000)
    writer = pair.world.participant.writer(Topic("rt/other", INT32), by_hand)
    writer.write(bytes(4))
    pair.run(50)
    assert seen.events == []
    pair.world.findings.report(
        "writer-silent", who=subscriber(pair).owner, subject="rt/other", what="", why="", remedy="", now=0.0
    )
    pair.run(50)
    assert seen.totals == [(1, 1)]


def subscriber(pair: Pair) -> Any:
    """Bob's reader in the space."""
    (found,) = [proxy.reader for proxy in objects(pair, "bobx") if hasattr(proxy, "reader")]
    return found


def test_counting_goes_on_with_an_agent_that_starts_again() -> None:
    pair = Pair()
    seen = Seen()
    pair.alice.node.on_events(pair.publisher, matched=seen)
    pair.bob.node.subscription(Int32, "value", nothing)
    pair.run()
    assert [(event.total, event.current) for event in seen.events] == [(1, 1)]
    pair.world.stop_agent()
    pair.world.start_agent()
    pair.run(6000)
    assert seen.events[-1].total == 2
    assert seen.events[-1].current == 1
    assert sum(event.change for event in seen.events) == 2


def test_other_agents_are_told_of_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("muros.agent._create.EVENTS", "an agent that knows no such topic")
    pair = Pair()
    problems: list[tuple[int, str]] = []
    pair.alice.context.on_problem(lambda code, text: problems.append((code, text)))
    seen = Seen()
    pair.alice.node.on_events(pair.publisher, matched=seen)
    pair.run(PATIENCE - 200)
    assert problems == []
    pair.run(2 * PATIENCE)
    assert [code for code, _ in problems] == [NOT_TOLD]
    assert "Use muros agent" in problems[0][1]
    assert seen.events == []


def test_deadlines_ask_an_agent_for_nothing() -> None:
    pair = Pair(Qos(deadline=100))
    pair.alice.node.on_events(pair.publisher, deadline_missed=nothing, message_lost=nothing)
    pair.run()
    assert not any(isinstance(proxy, _events_proxy.EventsProxy) for proxy in objects(pair, "alic"))


@pytest.mark.parametrize("name", ["0000", "ffff", "zz", "", "00000", "011g", "0011"])
def test_events_of_nothing_are_refused(name: str) -> None:
    world = World()
    board = Board(world)
    session: Any = board.session
    board.node.publisher(Int32, "value")
    reader = session.reader(board.node.participant, TOPIC + name, agent_events.TYPE, "default", nothing)
    executor = Executor(board.context)
    for _ in range(20):
        executor.spin_some(0.01)
    assert reader.status == 0x84
    assert any("names no writer or reader" in finding.why for finding in world.findings.snapshot())


def test_both_sides_name_the_same_topics() -> None:
    assert _events_proxy.TOPIC == TOPIC


@given(st.builds(News, *[st.integers(0, 2**32 - 1)] * 5, st.text(max_size=LONGEST_WHY // 4)))
def test_samples_come_as_they_went(news: News) -> None:
    assert read_untrusted(pack(news)) == news


@given(st.binary(max_size=600))
def test_arbitrary_bytes_are_a_sample_or_a_value_error(data: bytes) -> None:
    if len(data) < 20:
        with pytest.raises(ValueError, match="too short"):
            read_untrusted(data)
    else:
        assert len(read_untrusted(data).why) <= LONGEST_WHY


def test_words_that_are_too_long_are_cut() -> None:
    assert read_untrusted(pack(News(1, 1, 1, 1, 1, "x" * 1000))).why == "x" * LONGEST_WHY


def test_events_with_threads() -> None:
    """The carrier takes what the agent tells; the thread of the handle calls back."""
    stage = Stage(ThroughAgent())
    try:
        node = stage.node("listener")
        seen = Seen()
        subscription = node.subscription(Int32, "value", nothing)
        events = node.on_events(subscription, matched=seen)
        stage.executors.clear()
        threads = Threads(node.context)
        threads.executor("listening").add(events)
        with threads:
            stage.node("talker").publisher(Int32, "value")
            stage.until(lambda: seen.events)
        assert (seen.events[0].total, seen.events[0].current) == (1, 1)
    finally:
        stage.close()
