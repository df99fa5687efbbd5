"""What a node sees of others, over every way: names, types, counts, endpoints, waiting, and being told of changes."""

from collections.abc import Iterator

import pytest

from muros.rclc import Context, Node
from muros.rclc.host.graph import CLIENT, NO_GRAPH, PUBLISHER, SERVER, SUBSCRIPTION
from muros.space import open_space
from tests.client.world import World
from tests.rclc.test_rclc import two
from tests.rclc_space.spun import Spun
from tests.rclc_space.ways import PATIENCE, Direct, Stage

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String

INT32, STRING, ADD = "std_msgs/msg/Int32", "std_msgs/msg/String", "example_interfaces/srv/AddTwoInts"


def nothing(*_: object) -> None:
    """A callback."""


class Company:
    """Two nodes with something of each kind, and one that looks at them."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.arm = stage.node("arm", "lab")
        self.value = self.arm.publisher(Int32, "value", "sensor_data")
        self.arm.service(AddTwoInts, "add", nothing)
        self.leg = stage.node("leg")
        self.leg.subscription(Int32, "/lab/value", nothing, "sensor_data")
        self.leg.subscription(String, "/lab/value", nothing)
        self.asking = self.leg.client(AddTwoInts, "/lab/add")
        self.looking = stage.node("looking", "lab/eye")

    def seen(self) -> "Company":
        """Everybody sees everything."""
        graph = self.looking.graph
        self.stage.until(
            lambda: (
                len(graph.nodes()) == 3
                and graph.servers("/lab/add")
                and graph.clients("/lab/add")
                and len(graph.subscriptions("/lab/value")) == 2
                and graph.publishers("/lab/value")
            )
        )
        return self


def test_g1_g2_g5_names_and_types(stage: Stage) -> None:
    company = Company(stage).seen()
    graph = company.looking.graph
    assert graph.known
    assert graph.nodes() == ["/lab/arm", "/lab/eye/looking", "/leg"]
    assert graph.topics() == {"/lab/value": [INT32, STRING]}
    assert graph.services() == {"/lab/add": [ADD]}


def test_what_a_node_has(stage: Stage) -> None:
    graph = Company(stage).seen().looking.graph
    assert [(end.kind, end.name, end.type) for end in graph.publishers(node="/lab/arm")] == [
        (PUBLISHER, "/lab/value", INT32)
    ]
    assert {end.type for end in graph.subscriptions(node="/leg")} == {INT32, STRING}
    assert [(end.kind, end.name, end.node) for end in graph.servers()] == [(SERVER, "/lab/add", "/lab/arm")]
    assert [(end.kind, end.type, end.node) for end in graph.clients(node="/leg")] == [(CLIENT, ADD, "/leg")]
    assert graph.publishers(node="/leg") == graph.servers(node="leg") == []
    assert {end.kind for end in graph.subscriptions()} == {SUBSCRIPTION}


def test_names_are_those_of_the_node(stage: Stage) -> None:
    company = Company(stage).seen()
    node = stage.node("other", "lab")
    stage.until(lambda: node.graph.publishers("value") and node.graph.servers("add"))
    assert [end.node for end in node.graph.publishers(node="arm")] == ["/lab/arm"]
    assert company.looking.graph.publishers("value") == []


def test_what_is_known_of_an_endpoint(stage: Stage) -> None:
    (end,) = Company(stage).seen().looking.graph.publishers("/lab/value")
    assert len(end.gid) == 16
    assert str(end.qos).startswith("best effort, volatile")
    assert (
        end.type_hash.startswith("RIHS01_") or not isinstance(stage.way, Direct) or stage.way.url == "local:"
    )


def test_g3_g6_who_goes_is_seen_no_more(stage: Stage) -> None:
    company = Company(stage).seen()
    graph = company.looking.graph
    company.value.destroy()
    stage.until(lambda: not graph.publishers("/lab/value"))
    assert "/lab/arm" in graph.nodes()
    company.arm.destroy()
    stage.until(lambda: "/lab/arm" not in graph.nodes())
    assert graph.servers() == []
    company.leg.context.close()
    stage.until(lambda: graph.nodes() == ["/lab/eye/looking"])


def test_g4_two_nodes_of_one_name(stage: Stage) -> None:
    graph = stage.node("looking").graph
    twins = [stage.node("twin", "lab") for _ in range(2)]
    stage.until(lambda: graph.nodes() == ["/lab/twin", "/lab/twin", "/looking"])
    twins[0].destroy()
    stage.until(lambda: graph.nodes() == ["/lab/twin", "/looking"])


def test_an_executor_is_told_of_changes(stage: Stage) -> None:
    company = Company(stage).seen()
    told: list[list[str]] = []
    watch = company.looking.graph.on_change(lambda graph: told.append(graph.nodes()))
    stage.until(lambda: told)
    assert told[0] == company.looking.graph.nodes(), "what is there already is told at once"
    late = stage.node("late")
    stage.until(lambda: "/late" in told[-1])
    late.destroy()
    stage.until(lambda: "/late" not in told[-1])
    watch.destroy()
    count = len(told)
    stage.node("later")
    stage.until(lambda: "/later" in company.looking.graph.nodes())
    assert len(told) == count
    assert watch not in company.looking.context.handles


def test_a_node_leaves_nothing_of_its_graph(stage: Stage) -> None:
    company = Company(stage).seen()
    company.looking.graph.on_change(nothing)
    company.looking.destroy()
    assert company.looking.context.handles == []
    stage.until(lambda: company.arm.graph.nodes() == ["/lab/arm", "/leg"])


class Beside(Spun):
    """Somebody beside the test, who makes things when told."""

    def __init__(self, stage: Stage) -> None:
        super().__init__(stage.way.open())
        self.node: Node = self.context.node("beside")
        self.start()


@pytest.fixture
def beside(stage: Stage) -> Iterator[Beside]:
    """Somebody beside the test."""
    made = Beside(stage)
    yield made
    made.close()
    assert made.raised == []


def test_waiting_for_a_service(stage: Stage, beside: Beside) -> None:
    client = stage.node("asker").client(AddTwoInts, "add")
    assert not client.wait_for_service(timeout=0.05)
    assert not client.service_is_ready()
    beside.do(
        lambda: beside.node.service(
            AddTwoInts, "add", lambda asked: AddTwoInts.Response(sum=asked.a + asked.b)
        )
    )
    assert client.wait_for_service(timeout=PATIENCE)
    assert client.service_is_ready()
    assert client.call(AddTwoInts.Request(a=2, b=3), timeout=PATIENCE).sum == 5


def test_waiting_for_nodes_and_topics(stage: Stage, beside: Beside) -> None:
    node = stage.node("asker")
    publisher = node.publisher(Int32, "count")
    assert node.graph.wait_for_node("beside", timeout=PATIENCE)
    assert not node.graph.wait_for_node("nobody", timeout=0.02)
    assert not publisher.wait_for_subscriptions(timeout=0.02)
    beside.do(lambda: beside.node.subscription(Int32, "count", nothing))
    assert publisher.wait_for_subscriptions(timeout=PATIENCE)
    assert publisher.count_subscriptions() == 1
    assert node.graph.wait_for_subscriptions("count", timeout=PATIENCE)
    beside.do(lambda: beside.node.publisher(String, "words"))
    beside.do(lambda: beside.node.service(AddTwoInts, "add", nothing))
    assert node.graph.wait_for_publishers("words", timeout=PATIENCE)
    assert node.graph.wait_for_service("add", timeout=PATIENCE)
    assert node.graph.wait(lambda graph: len(graph.topics()) == 2, timeout=PATIENCE)
    assert not node.graph.wait_for_publishers("words", count=2, timeout=0.02)


def test_a_reliable_message_is_confirmed(stage: Stage, beside: Beside) -> None:
    got: list[int] = []
    beside.do(lambda: beside.node.subscription(Int32, "count", lambda message: got.append(message.data)))
    node = stage.node("talker")
    publisher = node.publisher(Int32, "count")
    assert publisher.wait_for_subscriptions(timeout=PATIENCE)
    assert publisher.publish(Int32(data=1), timeout=PATIENCE)
    publisher.session_timeout = PATIENCE
    assert publisher.publish(Int32(data=2))
    assert node.publisher(Int32, "other", "sensor_data").session_timeout == 0
    client = node.client(AddTwoInts, "add")
    client.session_timeout = PATIENCE
    stage.until(lambda: client.send(AddTwoInts.Request(), nothing))


def test_who_waits_in_vain_for_an_agent_without_a_graph_is_told() -> None:
    world = World()
    alice, _ = two(world)
    world.core.graph.made = lambda proxy: None  # type: ignore[method-assign]
    problems: list[tuple[int, str]] = []
    alice.context.on_problem(lambda code, text: problems.append((code, text)))
    alice.connect()
    assert not alice.node.graph.wait_for_node("/nobody", timeout=0.5)
    assert not alice.node.client(AddTwoInts, "add").wait_for_service(timeout=0.5)
    assert not alice.node.graph.known
    assert [code for code, _ in problems] == [NO_GRAPH], "once"
    assert "a plain DDS-XRCE agent does not" in problems[0][1]


def test_enclaves_are_seen() -> None:
    space = open_space("local:")
    context = Context(space, args=["--ros-args", "--enclave", "/lab/arm"])
    context.node("arm")
    assert [node.enclave for node in space.graph.nodes] == ["/lab/arm"]
    context.close()
