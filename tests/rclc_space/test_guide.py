"""The programs of the guide do straight on a space what they do through an agent."""

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from tests.rclc_space.ways import PATIENCE, Direct, Stage
from tests.test_guides import programs

from std_msgs.msg import Int32, String

GUIDE = programs("docs/write-a-node.md")


class Running:
    """A program of the guide on a thread of its own, and what it prints."""

    def __init__(self, number: int, url: str) -> None:
        source = GUIDE[number].replace('Udp("127.0.0.1", 8888)', '"local:"').replace('"local:"', f'"{url}"')
        assert f'Context("{url}")' in source
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
def stage(url: str) -> Iterator[Stage]:
    """Nodes of ours."""
    made = Stage(Direct(url))
    yield made
    made.close()


def test_the_counter(stage: Stage, url: str) -> None:
    bench = stage.node("bench")
    got: list[int] = []
    bench.subscription(Int32, "/demo/count", lambda message: got.append(message.data))
    say = bench.publisher(String, "/demo/say")
    running = Running(0, url)
    stage.until(lambda: len(got) > 1 and running.lines, lambda: say.publish(String(data="hello")))
    assert got[:2] == [1, 2]
    assert running.lines[0] == "hello"
    running.leave()


def test_the_service_and_who_asks(url: str) -> None:
    adder = Running(1, url)
    asker = Running(2, url)
    asker.end()
    assert asker.lines == ["66"]
    adder.leave()


def test_the_trigger_waits_for_both(stage: Stage, url: str) -> None:
    bench = stage.node("bench")
    laser, imu = bench.publisher(Int32, "/laser"), bench.publisher(Int32, "/imu")
    running = Running(3, url)
    stage.meet(laser, imu)
    for i in range(5):
        laser.publish(Int32(data=i))
    stage.until(lambda: running.names["laser"].ready(0))
    assert running.lines == [], "a laser alone is not enough"
    imu.publish(Int32(data=9))
    stage.until(lambda: len(running.lines) >= 2)
    assert running.lines == ["laser 0", "imu 9"]
    running.leave()


def test_two_contexts_in_one_process(url: str) -> None:
    running = Running(4, url)
    running.end()
    assert running.lines == ["42"]
