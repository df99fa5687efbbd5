"""The graph for clients: when it is published, what it says, and that nothing is left of it. In virtual time."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from muros import interfaces
from muros.rclc.graph import NODE, TOPIC, TYPE, read_untrusted
from muros.space import Qos, Reader, Service, Topic
from tests.client.world import STRING, World

GRAPH: Any = interfaces.message(TYPE)
DDS_TYPE = interfaces.dds_type_name(TYPE)
ADD = Service(
    "/add",
    "rq/addRequest",
    "rr/addReply",
    "example_interfaces::srv::dds_::AddTwoInts_Request_",
    "example_interfaces::srv::dds_::AddTwoInts_Response_",
)
PUBLISHER, SUBSCRIPTION, SERVER, CLIENT = range(4)


class Lab:
    """A world with a client that reads the graph."""

    def __init__(self, **session: Any) -> None:
        self.world = World()
        self.session = self.world.client(**session)
        self.node = self.session.participant("/lab/board")
        self.got: list[Any] = []
        self.reader: Any = None

    def read(self) -> "Lab":
        """The client reads the graph from now on."""
        self.got.clear()
        self.reader = self.session.reader(self.node, TOPIC, TYPE, "status", self._take)
        self.world.until(lambda: self.got)
        return self

    def nodes(self) -> dict[str, list[tuple[int, str, list[str]]]]:
        """The newest graph, node by node."""
        return {
            f"{node.node_namespace.rstrip('/')}/{node.node_name}": sorted(
                (one.entity_type, one.name, list(one.types)) for one in node.entities
            )
            for node in self.got[-1].nodes
        }

    @property
    def publishers(self) -> int:
        """Who writes graphs in the space."""
        topic = self.world.space.graph.topic(TOPIC)
        return len(topic.writers) if topic else 0

    def _take(self, buf: Any, off: int, n: int) -> None:
        self.got.append(GRAPH.deserialize(bytes(memoryview(buf)[off : off + n])))


def test_nobody_asks_and_nothing_is_published() -> None:
    lab = Lab()
    lab.world.run(500)
    assert lab.publishers == 0
    assert TOPIC not in [topic.name for topic in lab.world.space.graph.topics]


def test_what_it_says() -> None:
    lab = Lab()
    robot = lab.world.space.participant("robot")
    robot.writer(Topic("rt/scan", "sensor_msgs::msg::dds_::LaserScan_"))
    robot.reader(Topic("rt/scan", "sensor_msgs::msg::dds_::LaserScan_"))
    robot.reader(Topic("rt/scan", STRING))
    robot.writer(Topic("plain_dds", "Plain"))
    robot.replier(ADD)
    lab.world.space.participant("")
    lab.world.space.participant("elsewhere", domain=3).writer(Topic("rt/far", STRING))
    lab.session.requester(lab.node, "/add", "example_interfaces/srv/AddTwoInts", lambda *reply: None)
    lab.world.run(200)
    lab.read()
    lab.world.run(200)
    assert lab.nodes() == {
        "/host": [],
        "/robot": [
            (PUBLISHER, "/scan", ["sensor_msgs/msg/LaserScan"]),
            (SUBSCRIPTION, "/scan", ["sensor_msgs/msg/LaserScan", "std_msgs/msg/String"]),
            (SERVER, "/add", ["example_interfaces/srv/AddTwoInts"]),
        ],
        "/lab/board": [(CLIENT, "/add", ["example_interfaces/srv/AddTwoInts"])],
    }
    (writer,) = lab.world.space.graph.topic(TOPIC).writers  # type: ignore[union-attr]
    assert str(writer.qos) == "reliable, transient local, keep last 1"


def test_names_that_ros_does_not_have_are_left_out() -> None:
    lab = Lab().read()
    strange = lab.world.space.participant("caf\u00e9")
    strange.writer(Topic("rt/one", STRING))
    long = lab.world.space.participant("long")
    long.writer(Topic("rt/" + "x" * 300, STRING))
    long.writer(Topic("rt/\udcff", STRING))
    long.writer(Topic("rt/two", "y" * 300))
    long.writer(Topic("rt/three", STRING))
    lab.world.space.participant("z" * 300)
    lab.world.run(300)
    assert lab.nodes() == {
        "/host": [],
        "/lab/board": [],
        "/long": [(PUBLISHER, "/three", ["std_msgs/msg/String"])],
    }


def test_a_client_that_creates_in_xml_as_micro_ros_does() -> None:
    lab = Lab(creation="xml").read()
    lab.world.run(200)
    assert list(lab.nodes()) == ["/host", "/lab/board"]


def test_changes_that_come_together_are_published_once() -> None:
    lab = Lab().read()
    lab.world.run(300)
    before = len(lab.got)
    for n in range(20):
        lab.world.space.participant(f"node_{n}").writer(Topic(f"rt/topic_{n}", STRING))
    lab.world.run(300)
    assert len(lab.got) == before + 1
    assert len(lab.nodes()) == 22
    lab.world.run(2000)
    assert len(lab.got) == before + 1, "what does not change is not published again"


def test_changes_that_show_nothing_new_are_not_published() -> None:
    lab = Lab().read()
    lab.world.run(300)
    before = len(lab.got)
    lab.world.space.participant("").writer(Topic("plain", "Plain"))
    lab.world.run(300)
    assert len(lab.got) == before


def test_with_the_last_reader_it_is_gone() -> None:
    lab = Lab().read()
    other = lab.session.reader(lab.node, TOPIC, TYPE, "status", lambda *sample: None)
    lab.world.run(200)
    assert lab.publishers == 1
    lab.reader.destroy()
    lab.world.run(300)
    assert lab.publishers == 1
    other.destroy()
    lab.world.run(300)
    assert lab.publishers == 0
    lab.read()
    assert lab.publishers == 1
    lab.session.close()
    lab.world.run(300)
    assert lab.publishers == 0


def test_each_domain_has_its_own() -> None:
    lab = Lab().read()
    far = lab.session.participant("/far", 5)
    got: list[bytes] = []
    lab.session.reader(far, TOPIC, TYPE, "status", lambda buf, off, n: got.append(bytes(buf[off : off + n])))
    lab.world.until(lambda: got)
    lab.world.run(200)
    assert [node.node_name for node in GRAPH.deserialize(got[-1]).nodes] == ["far"]
    assert "/far" not in lab.nodes()


def test_an_agent_that_stops_takes_it_along() -> None:
    lab = Lab().read()
    lab.world.core.graph.close()
    assert lab.publishers == 0


def test_another_type_under_that_name_is_none() -> None:
    lab = Lab()
    lab.session.reader(lab.node, TOPIC, "std_msgs/msg/String", "status", lambda *sample: None)
    lab.world.run(300)
    assert lab.publishers == 0


def test_a_program_in_the_space_reads_it_too() -> None:
    lab = Lab().read()
    got: list[bytes] = []

    def take(reader: Reader) -> None:
        while (sample := reader.take()) is not None:
            got.append(sample.data)

    lab.world.participant.reader(Topic(TOPIC, DDS_TYPE), Qos.preset("action_status_default"), take)
    lab.world.run(200)
    assert got


names = st.text("abc_/", min_size=1, max_size=12)
entities = st.lists(st.tuples(st.integers(0, 3), names, st.lists(names, max_size=3)), max_size=4)


@given(st.lists(st.tuples(names, names, entities), max_size=4))
def test_what_is_written_is_read(nodes: list[tuple[str, str, list[tuple[int, str, list[str]]]]]) -> None:
    kinds = [interfaces.message(f"micro_ros_msgs/msg/{name}") for name in ("Node", "Entity")]
    made = GRAPH()
    expected: list[Any] = []
    for namespace, name, inside in nodes:
        node: Any = kinds[0](node_namespace=namespace, node_name=name)
        full = namespace + ("" if namespace.endswith("/") else "/") + name
        expected.append((full, NODE, "", []))
        for kind, entity, types in inside:
            node.entities.append(kinds[1](entity_type=kind, name=entity, types=types))
            expected.append((full, kind, entity, types))
        made.nodes.append(node)
    data = made.serialize()
    got: list[Any] = []
    read_untrusted(data, 0, len(data), lambda *visited: got.append(visited))
    assert got == expected


@given(st.binary(max_size=200))
def test_bytes_that_are_no_graph(data: bytes) -> None:
    try:
        read_untrusted(data, 0, len(data), lambda *visited: None)
    except ValueError:
        return
    assert len(data) >= 4
