"""Graph, names and time beside rclpy: boards see its nodes through an agent, its names are ours, it sets our clock."""

import json
import subprocess
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from muros.client import Udp
from muros.links import UdpLink
from muros.rclc import Context, Executor, RosArguments
from muros.rclc.host.remapping import remap, remap_node
from tests.client.agent_thread import RunningAgent
from tests.dds.peers import Peer, environment, python_of, require
from tests.rclc_space.ways import PATIENCE

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import String
from std_srvs.srv import Trigger

SETTLE = "rcl_interfaces/srv/SetParameters"
BOOL = 1


@pytest.fixture
def domain(dds_url: str, ros: Peer) -> Iterator[int]:
    """The test's domain; what rclpy made goes with it."""
    yield int(dds_url.partition(":")[2])
    ros.do("reset")


@pytest.fixture
def board(dds_url: str, domain: int) -> Iterator[Context]:
    """A context through an agent in the graph of ROS 2."""
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link, space=dds_url)
    context = Context(Udp("127.0.0.1", link.port), domain_id=domain)
    yield context
    context.close()
    agent.stop()


def test_a_board_sees_the_nodes_of_rclpy(board: Context, ros: Peer, domain: int) -> None:
    node = board.node("board", "lab")
    node.publisher(String, "words")
    client = node.client(AddTwoInts, "/add")
    assert not client.wait_for_service(timeout=0.1)
    theirs = ros.do("node", name="robot", namespace="/lab", domain=domain)
    ros.do("subscription", node=theirs, topic="words", type="std_msgs/msg/String")
    ros.do("service", node=theirs, name="/reset", type="std_srvs/srv/Trigger")
    graph = node.graph
    assert graph.wait_for_node("robot", timeout=PATIENCE)
    assert graph.wait_for_subscriptions("words", timeout=PATIENCE)
    assert graph.wait_for_service("/reset", timeout=PATIENCE)
    assert graph.wait_for_publishers("/parameter_events", timeout=PATIENCE)
    assert graph.nodes() == ["/lab/board", "/lab/robot"]
    assert graph.topics()["/lab/words"] == ["std_msgs/msg/String"]
    assert graph.services()["/reset"] == ["std_srvs/srv/Trigger"]
    assert [end.node for end in graph.publishers("/parameter_events")] == ["/lab/robot"]
    assert [end.node for end in graph.servers(node="robot") if end.name == "/reset"] == ["/lab/robot"]
    ros.do("reset")
    assert graph.wait(lambda seen: seen.nodes() == ["/lab/board"], timeout=PATIENCE)


def test_no_request_is_lost_to_a_service_that_was_waited_for(
    board: Context, dds_url: str, ros: Peer, domain: int
) -> None:
    straight = Context(dds_url)
    nodes = [board.node("board"), straight.node("program")]
    theirs = ros.do("node", name="robot", domain=domain)
    for n in range(5):
        ros.do(
            "service", node=theirs, name=f"/reset_{n}", type="std_srvs/srv/Trigger", rule="{'success': True}"
        )
        for node in nodes:
            client = node.client(Trigger, f"/reset_{n}")
            assert client.wait_for_service(timeout=PATIENCE)
            reply = client.call(Trigger.Request(), timeout=PATIENCE)
            assert reply is not None, (n, node.full_name)
            assert reply.success
            client.destroy()
    straight.close()


def test_rclpy_sets_our_clock_and_our_levels(dds_url: str, ros: Peer, domain: int) -> None:
    context = Context(dds_url)
    node = context.node("arm", "lab")
    parameters = node.parameters()
    clock = node.clock
    log = node.logger(show=None, services=True)
    thread = threading.Thread(target=Executor(context).spin, daemon=True)
    thread.start()
    theirs = ros.do("node", name="asker", domain=domain)
    set_parameters = ros.do("client", node=theirs, name="/lab/arm/set_parameters", type=SETTLE)
    wanted = {"name": "use_sim_time", "value": {"type": BOOL, "bool_value": True}}
    (answer,) = ros.do("call", client=set_parameters, request={"parameters": [wanted]})
    assert [result["successful"] for result in answer["results"]] == [True]
    assert (parameters.get("use_sim_time"), clock.simulated) == (True, True)
    levels = ros.do(
        "client", node=theirs, name="/lab/arm/set_logger_levels", type="rcl_interfaces/srv/SetLoggerLevels"
    )
    (answer,) = ros.do("call", client=levels, request={"levels": [{"name": "lab.arm", "level": 40}]})
    assert [result["successful"] for result in answer["results"]] == [True]
    assert log.level == 40
    context.close()
    thread.join(PATIENCE)


PROGRAM = """
import json, sys, rclpy
results = []
for arguments, name, namespace, topics in json.load(sys.stdin):
    context = rclpy.Context()
    rclpy.init(args=["program", "--ros-args", *arguments], context=context)
    node = rclpy.create_node(name, namespace=namespace, context=context, start_parameter_services=False)
    results.append([
        node.get_fully_qualified_name(),
        [node.resolve_topic_name(topic) for topic in topics],
        [node.resolve_service_name(topic) for topic in topics],
    ])
    node.destroy_node()
    rclpy.shutdown(context=context)
print(json.dumps(results))
"""

NAMES = ["chatter", "/chatter", "~/chatter", "lab/chatter", "a", "b"]
CASES = [
    (rules.split(), "arm", namespace)
    for namespace in ("/", "/lab")
    for rules in (
        "",
        "-r chatter:=talk",
        "-r chatter:=/talk",
        "-r /chatter:=~/talk",
        "-r ~/chatter:=talk",
        "-r a:=b -r b:=c",
        "-r a:=b -r a:=c",
        "-r arm:chatter:=talk -r leg:a:=x",
        "-r rostopic://a:=t -r rosservice://b:=s",
        "-r __node:=leg -r leg:a:=x -r arm:b:=y",
        "-r __ns:=/there -r chatter:=talk",
        "-r arm:__node:=leg -r leg:__ns:=/here -r arm:__ns:=/there",
        "-r chatter:=/x/y -r a:=~/x/y",
        "--remap __name:=leg --remap /lab/chatter:=talk",
    )
]


@pytest.mark.parametrize("distro", ["jazzy", "kilted"])
def test_rules_give_the_names_that_rclpy_has(distro: str) -> None:
    require(distro)
    asked = [(rules, name, namespace, NAMES) for rules, name, namespace in CASES]
    done = subprocess.run(
        [str(python_of(distro)), "-c", PROGRAM],
        input=json.dumps(asked),
        env=environment(distro, discovery="localhost"),
        capture_output=True,
        text=True,
        timeout=50,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for case, theirs in zip(CASES, json.loads(done.stdout), strict=True):
        assert ours(*case) == theirs, case


def ours(arguments: list[str], name: str, namespace: str) -> list[Any]:
    """What muros makes of rules."""
    rules = RosArguments.parse(["--ros-args", *arguments]).rules
    name, namespace = remap_node(name, namespace, rules)
    full = [expanded(topic, name, namespace) for topic in NAMES]
    return [
        f"{namespace.rstrip('/')}/{name}",
        [remap(topic, "topic", name, namespace, rules) for topic in full],
        [remap(topic, "service", name, namespace, rules) for topic in full],
    ]


def expanded(topic: str, name: str, namespace: str) -> str:
    """A full name."""
    if topic.startswith("/"):
        return topic
    inner = topic.replace("~", name)
    return f"{namespace.rstrip('/')}/{inner}"
