"""The graph as agents tell it, read on boards: a client waits until its service is there."""

from struct import pack

from muros.client import Session
from muros.rclc import Context
from muros.rclc.graph import CLIENT, NODE, PUBLISHER, SERVER, read_untrusted, wait_for_service
from tests.board.agent import Agent
from tests.board.harness import raises

TYPE_CHECKING = 0
if TYPE_CHECKING:
    from typing import Any

ADD = "example_interfaces/srv/AddTwoInts"


class AddTwoInts:
    """A service of which nothing is called."""

    TYPE = ADD


def text(data: bytearray, value: str) -> None:
    """Writes a string."""
    while len(data) & 3:
        data.append(0)
    said = value.encode() + b"\0"
    data.extend(pack("<I", len(said)) + said)


def number(data: bytearray, value: int) -> None:
    """Writes a count."""
    while len(data) & 3:
        data.append(0)
    data.extend(pack("<I", value))


def graph(*nodes: "tuple[str, str, list[tuple[int, str, list[str]]]]") -> bytes:
    """A Graph: nodes, each with namespace, name and entities."""
    data = bytearray()
    number(data, len(nodes))
    for namespace, name, entities in nodes:
        text(data, namespace)
        text(data, name)
        number(data, len(entities))
        for kind, entity, types in entities:
            data.append(kind)
            text(data, entity)
            number(data, len(types))
            for one in types:
                text(data, one)
    return bytes(data)


LAB = graph(
    ("/", "leg", []),
    (
        "/lab",
        "arm",
        [(PUBLISHER, "/a", ["std_msgs/msg/Int32"]), (SERVER, "/lab/add", [ADD]), (CLIENT, "/x", [])],
    ),
)


def seen(data: bytes, before: int = 0) -> "list[Any]":
    """What is visited in a sample that stands behind other bytes."""
    found: "list[Any]" = []
    buf = bytes(before) + data
    read_untrusted(buf, before, len(data), lambda *visited: found.append(visited))
    return found


def test_a_graph_is_read() -> None:
    expected = [
        ("/leg", NODE, "", []),
        ("/lab/arm", NODE, "", []),
        ("/lab/arm", PUBLISHER, "/a", ["std_msgs/msg/Int32"]),
        ("/lab/arm", SERVER, "/lab/add", [ADD]),
        ("/lab/arm", CLIENT, "/x", []),
    ]
    assert seen(LAB) == expected
    assert seen(LAB, 3) == expected, "alignment counts from the sample"
    assert seen(graph()) == []


def test_a_graph_that_is_cut_short_or_lies() -> None:
    for n in range(len(LAB)):
        with raises(ValueError):
            seen(LAB[:n])
    with raises(ValueError):
        seen(b"\xff\xff\xff\xff" + LAB[4:])
    with raises(ValueError):
        seen(LAB.replace(b"arm\0", b"arm!"))


class Telling(Agent):
    """An agent that tells graphs, one at each time that somebody waits; time goes on then."""

    def __init__(self, *graphs: bytes) -> None:
        super().__init__()
        self.graphs = list(graphs)
        self.now = 0
        self.reader = 0

    def wait(self, timeout: int) -> None:
        """Tells the next graph."""
        self.now += 10
        if self.graphs and self.reader and not self.inbox:
            self.inbox.append(self.data(self.reader, self.graphs.pop(0)))

    def handle(self, message: bytes) -> None:
        """Remembers who reads."""
        at = 4
        while len(message) - at >= 8:
            if message[at] == 8 and message[at + 7] & 15 == 6:  # READ_DATA of a datareader
                self.reader = message[at + 6] << 8 | message[at + 7]
            at += 4 + (message[at + 2] | message[at + 3] << 8) + 3 & ~3
        super().handle(message)


def waiting(agent: "Telling", service: str, timeout: float) -> "tuple[bool, Any]":
    """Whether a client of a service finds it."""
    context = Context(Session(agent, 1))
    context.clock = lambda: agent.now
    node: "Any" = context.node("board", "lab")
    entity = context.middleware.requester(node.participant, service, ADD, lambda *reply: None)
    client: "Any" = Stub(context, entity)
    return wait_for_service(client, timeout), context


class Stub:
    """What of a client is looked at."""

    def __init__(self, context: "Any", entity: "Any") -> None:
        self.context = context
        self.entity = entity


def test_a_client_waits_until_its_service_is_there() -> None:
    agent = Telling(graph(), b"\1\0\0", LAB)
    found, context = waiting(agent, "/lab/add", 5)
    assert found
    assert not agent.graphs
    assert len(context.middleware.entities) == 2, "the reader has gone"


def test_a_client_waits_in_vain() -> None:
    agent = Telling(LAB, graph())
    found, _ = waiting(agent, "/lab/sub", 0.5)
    assert not found
    assert agent.now >= 500
    silent, _ = waiting(Telling(), "/lab/add", 0.2)
    assert not silent
