"""The commands against real ROS 2: what a node of rclpy does is seen, heard, called and answered."""

from collections.abc import Iterator
from typing import NamedTuple

import pytest

from tests.cli.shell import Shell
from tests.dds.domains import free_domain
from tests.dds.peers import Peer, start

STRING = "std_msgs/msg/String"


class Lab(NamedTuple):
    """A shell, and a node /lab/robot of ROS 2 in its domain."""

    shell: Shell
    ros: Peer
    node: int


@pytest.fixture(scope="module", params=["jazzy", "kilted"])
def lab(request: pytest.FixtureRequest) -> Iterator[Lab]:
    with start(request.param, discovery="localhost") as ros, free_domain() as domain:
        node = ros.do("node", name="robot", namespace="/lab", domain=int(domain), parameters={"speed": 0.5})
        yield Lab(Shell(domain), ros, node)


def test_node_and_its_topics_and_services_are_seen(lab: Lab) -> None:
    lab.ros.do("publisher", node=lab.node, topic="scan", type="sensor_msgs/msg/LaserScan")
    lab.ros.do("service", node=lab.node, name="/reset", type="std_srvs/srv/Trigger")
    nodes, topics, services, info, about = lab.shell.outputs(
        "node list", "topic list -t", "service list -t", "node info /lab/robot", "topic info -v /lab/scan"
    )
    assert nodes == "/lab/robot\n"
    assert "/lab/scan [sensor_msgs/msg/LaserScan]\n" in topics
    assert "/rosout [rcl_interfaces/msg/Log]\n" in topics
    assert "/reset [std_srvs/srv/Trigger]\n" in services
    assert "  Publishers:\n    /lab/scan: sensor_msgs/msg/LaserScan\n" in info
    assert "    /reset: std_srvs/srv/Trigger\n" in info
    assert "Node name: robot\nNode namespace: /lab\n" in about
    assert (
        "Topic type hash: RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828\n" in about
    )


def test_pub_reaches_ros(lab: Lab) -> None:
    heard = lab.ros.do("subscription", node=lab.node, topic="/command", type=STRING)
    done = lab.shell.run(f"topic pub --once /command {STRING} 'data: forward'")
    assert done.returncode == 0
    assert lab.ros.do("take", subscription=heard) == [{"data": "forward"}]


def test_echo_hears_ros(lab: Lab) -> None:
    teller = lab.ros.do("publisher", node=lab.node, topic="/state", type=STRING)
    with lab.shell.running("topic echo /state --times 3") as echo:
        assert lab.ros.do("matched", thing=teller, count=1) == 1
        lab.ros.do("publish", publisher=teller, message={"data": "moving "}, count=3, number="data")
        assert echo.out.read() == "data: moving 0\n---\ndata: moving 1\n---\ndata: moving 2\n---\n"
        assert echo.process.wait(20) == 0


def test_what_ros_keeps_for_late_readers_is_printed(lab: Lab) -> None:
    qos = {"durability": "transient_local", "depth": 1}
    teller = lab.ros.do("publisher", node=lab.node, topic="/map_name", type=STRING, qos=qos)
    lab.ros.do("publish", publisher=teller, message={"data": "kitchen"})
    assert lab.shell.run("topic echo /map_name --once --field data").stdout == "kitchen\n---\n"


def test_parameters_of_a_node_are_asked_by_a_service_call(lab: Lab) -> None:
    done = lab.shell.run("service call /lab/robot/get_parameters '{names: [speed]}'")
    assert "double_value=0.5" in done.stdout


def test_types_nobody_told_us_about_are_learned_from_the_node(lab: Lab) -> None:
    lab.ros.do("subscription", node=lab.node, topic="/nested", type="test_msgs/msg/Nested")
    teller = lab.ros.do("publisher", node=lab.node, topic="/nested", type="test_msgs/msg/Nested")
    with lab.shell.running("topic echo /nested --once --field basic_types_value.int32_value") as echo:
        lab.ros.do("matched", thing=teller, count=2)
        lab.ros.do("publish", publisher=teller, message={})
        assert echo.out.read() == "0\n---\n"
        assert echo.err == "muros: /lab/robot told the definition of test_msgs/msg/Nested\n"
    done = lab.shell.run(
        "topic pub --once /nested test_msgs/msg/Nested 'basic_types_value: {int32_value: 7}'"
    )
    assert "int32_value=7" in done.stdout


def test_doctor_is_content_with_ros(lab: Lab) -> None:
    done = lab.shell.run("doctor")
    assert "ok     1 node, " in done.stdout
    assert "WRONG" not in done.stdout
    assert done.returncode == 0
