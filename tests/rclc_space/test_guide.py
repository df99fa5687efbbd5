"""The programs of the guide do straight on a space what they do through an agent."""

import threading
from typing import Any

import pytest

from muros.rclc import Executor
from tests.rclc_space.ways import PATIENCE, Direct, Stage
from tests.test_guides import programs

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String

GUIDE = programs("docs/write-a-node.md")
URL = "local:"


class Running:
    """A program of the guide on a thread of its own, and what it prints."""

    def __init__(self, number: int) -> None:
        source = GUIDE[number].replace('Udp("127.0.0.1", 8888)', f'"{URL}"')
        assert f'"{URL}"' in source
        self.lines: list[str] = []
        self.names: dict[str, Any] = {"print": self._print}
        self._thread = threading.Thread(target=lambda: exec(source, self.names), daemon=True)
        self._thread.start()

    def _print(self, *words: object) -> None:
        self.lines.append(" ".join(map(str, words)))

    def leave(self) -> None:
        """Has it leave."""
        self.names["context"].close()
        self.end()

    def end(self) -> None:
        """It has ended."""
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()


@pytest.fixture
def stage() -> Any:
    """Nodes of ours."""
    made = Stage(Direct(URL))
    yield made
    made.close()


def test_the_counter(stage: Stage) -> None:
    bench = stage.node("bench")
    got: list[int] = []
    bench.subscription(Int32, "/demo/count", lambda message: got.append(message.data))
    say = bench.publisher(String, "/demo/say")
    running = Running(0)
    stage.until(lambda: len(got) > 1 and running.lines, lambda: say.publish(String(data="hello")))
    assert got[:2] == [1, 2]
    assert running.lines[0] == "hello"
    running.leave()


def test_the_service_and_who_asks() -> None:
    adder = Running(1)
    asker = Running(2)
    asker.end()
    assert asker.lines == ["66"]
    adder.leave()


def test_the_trigger_waits_for_both(stage: Stage) -> None:
    bench = stage.node("bench")
    laser, imu = bench.publisher(Int32, "/laser"), bench.publisher(Int32, "/imu")
    running = Running(3)
    stage.meet(laser, imu)
    for i in range(5):
        laser.publish(Int32(data=i))
    stage.until(lambda: running.names["laser"].ready(0))
    assert running.lines == [], "a laser alone is not enough"
    imu.publish(Int32(data=9))
    stage.until(lambda: len(running.lines) >= 2)
    assert running.lines == ["laser 0", "imu 9"]
    running.leave()


def test_two_contexts_in_one_process() -> None:
    running = Running(4)
    running.end()
    assert running.lines == ["42"]


def test_a_client_of_its_own_executor(stage: Stage) -> None:
    server = stage.node("server")
    server.service(AddTwoInts, "add", lambda request: AddTwoInts.Response(sum=request.a * 2))
    client = server.client(AddTwoInts, "add")
    answers: list[int] = []
    client.send(AddTwoInts.Request(a=4), lambda reply: answers.append(reply.sum))
    Executor(server.context)
    stage.until(lambda: answers)
    assert answers == [8]
