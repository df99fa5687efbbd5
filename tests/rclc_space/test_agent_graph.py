"""The whole graph as the agent of muros tells it to its clients, in virtual time."""

import json
import zlib
from dataclasses import astuple
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.agent import _graph_proxy
from muros.agent._create import Refused
from muros.rclc.host.agent_graph import LARGEST, TOPIC, pack, read_untrusted
from muros.rclc.host.endpoints import KINDS, Endpoint
from muros.space import Durability, History, Liveliness, Ownership, Qos, Reliability, Topic
from tests.client.world import World
from tests.rclc.test_rclc import Board, two

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32

INT32 = "std_msgs::msg::dds_::Int32_"


class Company:
    """A board that looks, one that is looked at, and the space behind the agent."""

    def __init__(self) -> None:
        self.world = World()
        self.looking, self.other = two(self.world)
        self.executors = [self.looking.executor(), self.other.executor()]
        self.graph = self.looking.node.graph

    def run(self, ms: int = 300) -> None:
        """Lets both run."""
        for _ in range(ms // 10):
            self.looking.spin(self.executors[0], 5)
            self.other.spin(self.executors[1], 5)


def test_endpoints_are_told_with_all_that_is_known() -> None:
    company = Company()
    company.other.node.publisher(Int32, "value", "sensor_data")
    company.other.node.service(AddTwoInts, "add", print)
    qos = Qos(deadline=5_000_000, durability=Durability.TRANSIENT_LOCAL, depth=7, partitions=("a", "b*"))
    writer = company.world.participant.writer(Topic("rt/map", INT32), qos)
    company.run()
    (value,) = company.graph.publishers("value")
    assert (value.node, str(value.qos)) == ("/bob", "best effort, volatile, keep last 5")
    (map_,) = company.graph.publishers("map")
    assert (map_.gid, map_.qos, map_.node) == (writer.gid, qos, "/host")
    (server,) = company.graph.servers("add")
    assert (server.type, len(server.gid)) == ("example_interfaces/srv/AddTwoInts", 16)
    writer.close()
    company.run()
    assert company.graph.publishers("map") == []


def test_changes_that_come_together_are_told_together() -> None:
    company = Company()
    assert company.graph.nodes() == []
    company.run()
    before = company.graph.changes
    for number in range(30):
        company.world.participant.writer(Topic(f"rt/t{number}", INT32), Qos())
    company.run()
    assert len(company.graph.publishers(node="/host")) == 30
    assert company.graph.changes - before <= 2


def test_an_agent_that_tells_less_and_one_that_tells_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """What an agent publishes for all counts until one tells more, and again when that has gone."""
    company = Company()
    company.other.node.publisher(Int32, "value")
    monkeypatch.setattr("muros.agent._create.GRAPH", "what this agent does not know")

    def publisher() -> Endpoint:
        (found,) = company.graph.publishers("value")
        return found

    company.run()
    assert publisher() == Endpoint("publisher", "/value", "std_msgs/msg/Int32", "/bob")
    company.world.stop_agent()
    monkeypatch.undo()
    company.world.start_agent()
    company.run(8000)
    assert publisher().qos is not None
    company.world.stop_agent()
    monkeypatch.setattr("muros.agent._create.GRAPH", "what this agent does not know")
    company.world.start_agent()
    company.run(8000)
    assert publisher().qos is None


def test_an_agent_that_refuses_to_tell_more(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise Refused(0x80, "no such type")

    monkeypatch.setattr("muros.agent._create.GraphProxy", refuse)
    company = Company()
    company.other.node.publisher(Int32, "value")
    company.looking.context.on_problem(lambda code, text: None)
    company.run()
    assert [end.qos for end in company.graph.publishers("value")] == [None]


def test_who_has_waited_for_the_graph_may_publish_at_once() -> None:
    """Its own readers are made when it is known: they fill no window any more."""
    for _ in range(5):
        company = Company()
        company.other.node.subscription(Int32, "value", None)
        company.other.connect()
        publisher = company.looking.node.publisher(Int32, "value")
        assert publisher.wait_for_subscriptions(timeout=10.0)
        assert all(publisher.publish(Int32(data=number)) for number in range(4))


def test_nothing_of_it_is_in_the_space() -> None:
    company = Company()
    assert not company.graph.known
    company.run()
    assert company.graph.known
    topics = [topic.name for topic in company.world.space.graph.topics]
    assert TOPIC not in topics
    objects = company.world.core.clients[b"alic"].objects.values()
    assert sum(isinstance(proxy, _graph_proxy.GraphProxy) for proxy in objects) == 1
    company.graph.destroy()
    company.run()
    objects = company.world.core.clients[b"alic"].objects.values()
    assert not any(isinstance(proxy, _graph_proxy.GraphProxy) for proxy in objects)
    company.world.participant.writer(Topic("rt/late", INT32), Qos())
    company.run()


def test_both_sides_name_the_same_topic() -> None:
    assert _graph_proxy.TOPIC == TOPIC


def test_a_sample_that_is_none_is_counted() -> None:
    board = Board(World())
    source: Any = board.node.graph._source
    source._take_whole(b"nonsense", 0, 8)
    assert (source.malformed, source.known) == (1, False)


times = st.integers(0, 2**62)
qualities = st.builds(
    Qos,
    st.sampled_from(Reliability),
    st.sampled_from(Durability),
    st.sampled_from(History),
    st.integers(1, 1000),
    times,
    times,
    st.sampled_from(Liveliness),
    times,
    st.sampled_from(Ownership),
    st.integers(0, 1000),
    st.lists(st.text(max_size=5), max_size=3).map(tuple),
)
endpoints = st.builds(
    Endpoint,
    st.sampled_from(KINDS),
    st.text(max_size=20),
    st.text(max_size=20),
    st.text(max_size=20),
    st.binary(max_size=16),
    st.none() | qualities,
    st.text(max_size=20),
)


@given(st.lists(st.text(max_size=20), max_size=5), st.lists(endpoints, max_size=5))
def test_graphs_come_as_they_went(nodes: list[str], ends: list[Endpoint]) -> None:
    assert read_untrusted(pack(nodes, ends)) == (nodes, ends)


def packed(content: object) -> bytes:
    """Any content in the place of a graph."""
    return zlib.compress(json.dumps(content).encode())


GOOD = ["publisher", "/a", "b/msg/C", "/n", "00" * 16, astuple(Qos()), ""]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        bytes(50),
        packed({})[:-3],
        packed({}),
        packed([]),
        packed({"nodes": [5], "endpoints": []}),
        packed({"nodes": [], "endpoints": [[]]}),
        *(
            packed({"nodes": [], "endpoints": [[*GOOD[:place], wrong, *GOOD[place + 1 :]]]})
            for place, wrong in enumerate(
                ("writer", 5, None, [], "zz", [1, 2, 3], {"a": 1}),
            )
        ),
        packed({"nodes": [], "endpoints": [[*GOOD[:5], [9, *astuple(Qos())[1:]], ""]]}),
        packed(
            {"nodes": [], "endpoints": [[*GOOD[:5], [*astuple(Qos())[:3], "x", *astuple(Qos())[4:]], ""]]}
        ),
        zlib.compress(b"[" * 100_000),
        zlib.compress(bytes(LARGEST + 1)),
    ],
)
def test_what_is_no_graph(data: bytes) -> None:
    with pytest.raises(ValueError, match="are no graph"):
        read_untrusted(data)
    assert read_untrusted(packed({"nodes": [], "endpoints": [GOOD]}))[1][0].qos == Qos()


@given(st.binary(max_size=100) | st.recursive(st.none() | st.integers() | st.text(), st.lists).map(packed))
def test_arbitrary_bytes_are_a_graph_or_a_value_error(data: bytes) -> None:
    with pytest.raises(ValueError, match="are no graph"):
        read_untrusted(data)
