"""A program on MicroPython waits for its service through the real agent, and asks it."""

import threading
from pathlib import Path

from muros.client import Udp
from muros.interfaces import board
from muros.links import UdpLink
from muros.rclc import Context, Executor
from tests.client.agent_thread import RunningAgent
from tests.micropython.runtimes import ROOT, require
from tests.micropython.unix import run_mpy

from example_interfaces.srv import AddTwoInts

PATIENCE = 10.0

PROGRAM = """
import sys
from muros.client import Session, Udp
from muros.rclc import Context
from example_interfaces.srv import AddTwoInts


class Ready:
    TYPE = "std_msgs/msg/Empty"


context = Context(Session(Udp("127.0.0.1", int(sys.argv[1])), 7, largest=4000))
node = context.node("board", "lab")
client = node.client(AddTwoInts, "add")
print(client.wait_for_service(0.2))
node.publisher(Ready, "ready")
print(client.wait_for_service(20))
print(client.call(AddTwoInts.Request(a=2, b=3), 10).sum)
context.close()
"""


def test_a_board_waits_for_its_service(tmp_path: Path) -> None:
    require("unix")
    board.generate(["example_interfaces/srv/AddTwoInts"], tmp_path)
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    host = Context(Udp("127.0.0.1", link.port))
    node = host.node("host")
    over = threading.Event()

    def serve() -> None:
        """Serves once the board has waited in vain."""
        executor = Executor(host)
        while not over.is_set() and not node.graph.publishers("/lab/ready"):
            executor.spin_some(0.02)
        node.service(AddTwoInts, "/lab/add", lambda asked: AddTwoInts.Response(sum=asked.a + asked.b))
        while not over.is_set():
            executor.spin_some(0.02)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        printed = run_mpy(PROGRAM, [str(link.port)], library=[ROOT / "src", tmp_path], timeout=50.0)
    finally:
        over.set()
        thread.join(PATIENCE)
        host.close()
        agent.stop()
    assert printed == "False\nTrue\n5\n"
