"""The ROS 2 graph between processes: programs straight in it, and boards behind an agent that is in it."""

import asyncio
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from muros.agent import Agent
from muros.client import Udp
from muros.links import UdpLink
from muros.rclc import Context, Executor, Node
from tests.running import Running

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32

PING_PONG = Path(__file__).parents[2] / "examples" / "ping_pong.py"
PATIENCE = 20.0
"""Seconds until what must come has come."""


class Process(Running):
    """A ping-pong process and its lines."""

    def __init__(self, *words: str) -> None:
        super().__init__([sys.executable, "-u", str(PING_PONG), *words, "0.1"])

    def pongs(self) -> int:
        """Answers it has heard to its own pings."""
        return sum(line.startswith("Pong for seq") for line in self.lines)

    def interrupt(self) -> tuple[int, str]:
        """Ctrl-C; its status and what it said on standard error."""
        return self.end(signal.SIGINT)


@pytest.fixture
def start() -> Iterator[Callable[..., Process]]:
    """Starts ping-pong processes."""
    started: list[Process] = []

    def begin(*words: str) -> Process:
        started.append(Process(*words))
        return started[-1]

    yield begin
    for process in started:
        process.stop()


@pytest.fixture
def port(dds_url: str) -> Iterator[int]:
    """The UDP port of an agent whose boards are in the graph."""
    link = UdpLink(0, "127.0.0.1")
    up = threading.Event()
    ends: list[Callable[[], object]] = []

    async def serve() -> None:
        agent = Agent(dds_url, domain=int(dds_url.partition(":")[2]))
        agent.add_link(link)
        loop = asyncio.get_running_loop()
        ends.append(lambda: loop.call_soon_threadsafe(agent.close))
        await agent.start()
        up.set()
        assert agent._closed is not None
        await agent._closed.wait()

    thread = threading.Thread(target=lambda: asyncio.run(serve()), daemon=True)
    thread.start()
    assert up.wait(PATIENCE)
    yield link.port
    ends[0]()
    thread.join(PATIENCE)
    assert not thread.is_alive()


def until(condition: Callable[[], Any]) -> None:
    """Waits for a condition."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"it did not come about within {PATIENCE} s"
        time.sleep(0.01)


def test_two_programs_play_ping_pong(dds_url: str, start: Callable[..., Process]) -> None:
    alice, bob = start("alice", dds_url), start("bob", dds_url)
    until(lambda: alice.pongs() >= 3 and bob.pongs() >= 3)
    assert alice.interrupt() == bob.interrupt() == (0, "")
    assert alice.lines[0] == "state CONNECTED"
    assert alice.lines[-1] == "state WAITING"


def test_a_program_that_was_killed_may_come_again(dds_url: str, start: Callable[..., Process]) -> None:
    alice, bob = start("alice", dds_url), start("bob", dds_url)
    until(lambda: alice.pongs() >= 1)
    bob.process.kill()
    bob.process.wait()
    heard = alice.pongs()
    again = start("bob", dds_url)
    until(lambda: alice.pongs() > heard + 2 and again.pongs() >= 3)
    assert alice.interrupt() == (0, "")


def spinning(context: Context, stop: threading.Event) -> threading.Thread:
    """A context that a thread of its own spins."""
    executor = Executor(context)

    def spin() -> None:
        while not stop.is_set():
            executor.spin_some(0.05)

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    return thread


@pytest.mark.parametrize("behind", ["talker", "listener"])
def test_boards_and_programs_hear_each_other(dds_url: str, port: int, behind: str) -> None:
    domain = int(dds_url.partition(":")[2])
    board, program = Context(Udp("127.0.0.1", port), domain_id=domain), Context(dds_url)
    talker, listener = (board, program) if behind == "talker" else (program, board)
    got: list[int] = []
    publisher = talker.node("talker", "lab").publisher(Int32, "value")
    listener.node("listener", "lab").subscription(Int32, "value", lambda message: got.append(message.data))
    executors = [Executor(board), Executor(program)]

    sent: list[int] = []

    def more() -> bool:
        for executor in executors:
            executor.spin_some(0.005)
        if len(sent) - (got[-1] if got else len(sent)) < 5 and publisher.publish(Int32(data=len(sent))):
            sent.append(len(sent))
        return len(got) >= 20

    until(more)
    assert got == list(range(got[0], got[0] + len(got))), "from the first that was heard, none is missing"
    board.close()
    program.close()


@pytest.mark.parametrize("behind", ["server", "client"])
def test_boards_and_programs_serve_each_other(dds_url: str, port: int, behind: str) -> None:
    domain = int(dds_url.partition(":")[2])
    board, program = Context(Udp("127.0.0.1", port), domain_id=domain), Context(dds_url)
    server, asker = (board, program) if behind == "server" else (program, board)
    node: Node = server.node("server")
    node.service(AddTwoInts, "add", lambda request: AddTwoInts.Response(sum=request.a + request.b))
    client = asker.node("client").client(AddTwoInts, "add")
    stop = threading.Event()
    thread = spinning(server, stop)
    try:
        for i in range(5):
            reply = client.call(AddTwoInts.Request(a=i, b=100), timeout=PATIENCE)
            assert reply is not None
            assert reply.sum == 100 + i
    finally:
        stop.set()
        thread.join(PATIENCE)
        board.close()
        program.close()
