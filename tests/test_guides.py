"""Every program in the README and the guides runs, against a real agent on loopback, and does what is said of it."""

import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from muros.client import CONNECTED, Session, Udp
from muros.links import UdpLink
from muros.rclc import Context, Executor, Node
from tests.client.agent_thread import RunningAgent
from tests.running import Running

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String

ROOT = Path(__file__).parents[1]
PATIENCE = 20.0
"""Seconds until what must come has come."""
COUNTS = {
    "README.md": 2,
    "docs/write-a-node.md": 5,
    "docs/client.md": 1,
    "docs/types.md": 3,
    "docs/connect-a-board.md": 0,
}
"""The programs of each document, so that a new one cannot go untested."""


def programs(document: str) -> list[str]:
    """The Python programs of a document."""
    text = (ROOT / document).read_text()
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


class Guided(Running):
    """A program of a document as a process."""

    def __init__(self, source: str, port: int, folder: Path) -> None:
        source = re.sub(r'"192\.168\.\d+\.\d+"', '"127.0.0.1"', source).replace("8888", str(port))
        script = folder / "program.py"
        script.write_text(source)
        super().__init__([sys.executable, "-u", str(script)], {**os.environ, "HOME": str(folder)})


class Bench:
    """An agent, a node of ours, and the programs that run."""

    def __init__(self, folder: Path) -> None:
        self.link = UdpLink(0, "127.0.0.1")
        self.agent = RunningAgent(self.link)
        self.events: list[str] = []
        self.agent._agent.on_event(lambda event: self.events.append(type(event).__name__))
        self.context = Context(Udp("127.0.0.1", self.link.port))
        self.node: Node = self.context.node("bench")
        self.running: list[Running] = []
        self._folder = folder

    def start(self, document: str, number: int) -> Running:
        """Starts a program of a document."""
        running = Guided(programs(document)[number], self.link.port, self._folder)
        self.running.append(running)
        return running

    def until(self, condition: Callable[[], Any], every: Callable[[], object] | None = None) -> None:
        """Spins our node until a condition holds, doing something now and then."""
        executor = Executor(self.context)
        end = time.monotonic() + PATIENCE
        while not condition():
            printed = [running.lines for running in self.running]
            assert time.monotonic() < end, f"nothing came of it within {PATIENCE} s; printed: {printed}"
            executor.spin_some(0.05)
            if every is not None:
                every()

    def says_goodbye(self, running: Running) -> None:
        """Ctrl-C ends a program without a word, and the agent is told."""
        before = self.events.count("ClientGone")
        assert running.end(signal.SIGINT) == (0, "")
        self.until(lambda: self.events.count("ClientGone") > before)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A bench."""
    made = Bench(tmp_path)
    yield made
    for running in made.running:
        running.stop()
    made.context.close()
    made.agent.stop()


@pytest.mark.parametrize("document", COUNTS)
def test_no_program_goes_untested(document: str) -> None:
    assert len(programs(document)) == COUNTS[document]


def test_the_thermometer_of_the_readme(bench: Bench) -> None:
    got: list[int] = []
    bench.node.subscription(Int32, "/greenhouse/temperature", lambda message: got.append(message.data))
    message = bench.node.publisher(String, "/greenhouse/message", "sensor_data")
    running = bench.start("README.md", 0)
    bench.until(lambda: got, lambda: message.publish(String(data="water me")))
    bench.until(lambda: running.lines, lambda: message.publish(String(data="water me")))
    assert got[0] == 21
    assert running.lines[0] == "water me"
    bench.says_goodbye(running)


def test_the_agent_of_the_readme(tmp_path: Path) -> None:
    with free_port() as port:
        running = Guided(programs("README.md")[1], port, tmp_path)
    session = Session(Udp("127.0.0.1", port), client_key=0xCAFE, retry=100)
    session.on_problem = lambda code, text: None  # until it listens
    try:
        end = time.monotonic() + PATIENCE
        while session.state != CONNECTED or not any(
            "client 0x0000CAFE connected" in s for s in running.lines
        ):
            assert time.monotonic() < end, running.lines
            session.spin_once()
            session.wait(20)
    finally:
        session.close()
        running.stop()


def test_the_counter(bench: Bench) -> None:
    got: list[int] = []
    bench.node.subscription(Int32, "/demo/count", lambda message: got.append(message.data))
    say = bench.node.publisher(String, "/demo/say")
    running = bench.start("docs/write-a-node.md", 0)
    bench.until(lambda: len(got) > 1 and running.lines, lambda: say.publish(String(data="hello")))
    assert got[1] == got[0] + 1
    assert running.lines[0] == "hello"
    bench.says_goodbye(running)


def test_the_service_and_who_asks(bench: Bench) -> None:
    adder = bench.start("docs/write-a-node.md", 1)
    client = bench.node.client(AddTwoInts, "add_two_ints")
    reply = None
    end = time.monotonic() + PATIENCE
    while reply is None:
        assert time.monotonic() < end
        reply = client.call(AddTwoInts.Request(a=1, b=2), timeout=1.0)
    assert reply.sum == 3
    asker = bench.start("docs/write-a-node.md", 2)
    assert asker.end() == (0, "")
    assert asker.lines == ["66"]
    bench.says_goodbye(adder)


def test_the_trigger_waits_for_both(bench: Bench) -> None:
    running = bench.start("docs/write-a-node.md", 3)
    laser, imu = bench.node.publisher(Int32, "/laser"), bench.node.publisher(Int32, "/imu")
    bench.until(lambda: bench.events.count("ClientReady") >= 2)
    for _ in range(20):
        laser.publish(Int32(data=1))
        Executor(bench.context).spin_some(0.02)
    assert running.lines == [], "a laser alone is not enough"
    bench.until(lambda: running.lines, lambda: (laser.publish(Int32(data=1)), imu.publish(Int32(data=2))))
    bench.until(lambda: len(running.lines) >= 2)
    assert running.lines[0].startswith("laser ")
    assert running.lines[1] == "imu 2"
    bench.says_goodbye(running)


def test_the_session_without_rclc(bench: Bench) -> None:
    limit = bench.node.publisher(Int32, "/limit")
    running = bench.start("docs/client.md", 0)
    bench.until(lambda: running.lines, lambda: limit.publish(Int32(data=7)))
    assert running.lines[0] == r"b'\x07\x00\x00\x00'"
    status, said = running.end(signal.SIGINT)
    assert status == -signal.SIGINT
    assert said.endswith("KeyboardInterrupt\n")
    bench.until(lambda: "ClientGone" in bench.events)


@pytest.mark.parametrize("number", range(COUNTS["docs/types.md"]))
def test_types(number: int, tmp_path: Path) -> None:
    package = tmp_path / "robot_ws" / "src" / "my_msgs" / "msg"
    package.mkdir(parents=True)
    (package / "Probe.msg").write_text("float64 depth\n")
    source = programs("docs/types.md")[number]
    if number == 2:
        source = re.sub(
            r"^(interfaces\..*?)  # (RIHS01_\w+|\w+|[\w/:]+)(?=\.\.\.|,|;|$).*$",
            r"assert str(\1).startswith('\2'), \1",
            source,
            flags=re.MULTILINE,
        )
        assert source.count("assert") == 5
    running = Guided(source, 0, tmp_path)
    try:
        assert running.end() == (0, "")
    finally:
        running.stop()


@contextmanager
def free_port() -> Iterator[int]:
    """The number of a UDP port that is free when the block ends."""
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as held:
        held.bind(("127.0.0.1", 0))
        number: int = held.getsockname()[1]
        yield number
