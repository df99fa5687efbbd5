"""A program straight in the graph and a node of ROS 2: topics, services and names, both ways."""

import time
from collections.abc import Iterator
from typing import Any

import pytest

from muros.rclc import Context
from tests.dds.peers import Peer
from tests.rclc_space.spun import Spun
from tests.rclc_space.ways import PATIENCE

from std_msgs.msg import String
from std_srvs.srv import SetBool

SWITCH = "std_srvs/srv/SetBool"
STRING = "std_msgs/msg/String"


class Program(Spun):
    """A program of ours, straight in the graph."""

    def __init__(self, url: str) -> None:
        super().__init__(Context(url))


@pytest.fixture
def program(dds_url: str, ros: Peer) -> Iterator[Program]:
    """A program of ours."""
    made = Program(dds_url)
    yield made
    made.close()
    ros.do("reset")


def test_a_program_and_rclpy(program: Program, ros: Peer, dds_url: str) -> None:
    node = program.context.node("board", "lab/bench")
    publisher = node.publisher(String, "talk")
    node.subscription(String, "listen", lambda message: publisher.publish(String(data=message.data + "!")))
    turned: list[bool] = []

    def turn(request: Any) -> Any:
        turned.append(request.data)
        return SetBool.Response(success=request.data, message=f"turn {len(turned)}")

    node.service(SetBool, "light", turn)
    client = node.client(SetBool, "/horn")
    answers: list[Any] = []

    def ask() -> None:
        timer.cancel()
        assert client.send(SetBool.Request(data=True), answers.append, timeout=PATIENCE)

    timer = node.timer(0.001, ask)
    program.start()

    theirs = ros.do("node", name="ros", domain=int(dds_url.partition(":")[2]))
    ros.do(
        "service", node=theirs, name="/horn", type=SWITCH, rule='{"success": request.data, "message": "toot"}'
    )
    heard = ros.do("subscription", node=theirs, topic="/lab/bench/talk", type=STRING)
    said = ros.do("publisher", node=theirs, topic="/lab/bench/listen", type=STRING)
    asking = ros.do("client", node=theirs, name="/lab/bench/light", type=SWITCH)

    assert "/lab/bench/board" in ros.do("nodes", node=theirs, names=["/lab/bench/board"])
    assert ros.do("matched", thing=heard) == ros.do("matched", thing=said) == 1
    ros.do("publish", publisher=said, message={"data": "n"}, count=5, period=0.01, number="data")
    assert [m["data"] for m in ros.do("take", subscription=heard, count=5)] == [f"n{i}!" for i in range(5)]
    got = ros.do("call", client=asking, request={"data": True}, count=10)
    assert got == [{"success": True, "message": f"turn {i}"} for i in range(1, 11)]
    found = ros.do(
        "of_node",
        node=theirs,
        name="board",
        namespace="/lab/bench",
        names=["/lab/bench/talk", "/lab/bench/light", "/horn"],
    )
    assert found["publishers"] == {"/lab/bench/talk": [STRING]}
    assert found["services"] == {"/lab/bench/light": [SWITCH]}
    assert found["clients"] == {"/horn": [SWITCH]}
    end = time.monotonic() + PATIENCE
    while not answers:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert (answers[0].success, answers[0].message) == (True, "toot")
    assert program.problems == []
