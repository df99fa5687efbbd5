"""Parameters of a program on MicroPython, with the types that boards have, through the real agent; and how it asks."""

import threading
import time
from pathlib import Path

import pytest

from muros.client import Udp
from muros.interfaces import board
from muros.links import UdpLink
from muros.rclc import Context, Executor, ParameterClient, ParameterRejectedError
from tests.client.agent_thread import RunningAgent
from tests.micropython.runtimes import ROOT, require
from tests.micropython.unix import run_mpy

PATIENCE = 10.0
TYPES = [
    *(
        f"rcl_interfaces/srv/{name}"
        for name in (
            "GetParameters",
            "GetParameterTypes",
            "SetParameters",
            "SetParametersAtomically",
            "ListParameters",
            "DescribeParameters",
        )
    ),
    "rcl_interfaces/msg/ParameterEvent",
]

PROGRAM = """
import sys
from muros.client import Session, Udp
from muros.compat import ticks_diff, ticks_ms
from muros.rclc import Context, Executor, ParameterClient

context = Context(Session(Udp("127.0.0.1", int(sys.argv[1])), 7))
node = context.node("board", "lab")
parameters = node.parameters()
parameters.declare("gain", 1.5, range=(0, 10, 0.5), description="loop gain")
parameters.declare("words", ["a", "b"])
parameters.declare("stop", False)
other = ParameterClient(node, "/host")
executor = Executor(context)
start = ticks_ms()
got = []
asked = 0
while not parameters.get("stop") or len(got) < 3:
    assert ticks_diff(ticks_ms(), start) < 20000, (context.state, got)
    executor.spin_some(0.02)
    if asked == len(got) < 3 and context.state == "CONNECTED":
        try:
            (lambda: other.list(then=got.append), lambda: other.set("speed", 2.5, then=got.append),
             lambda: other.get("speed", then=got.append))[asked]()
            asked += 1
        except Exception as error:
            if "try again" not in str(error):
                raise
for _ in range(20):
    executor.spin_some(0.02)
print(got, parameters.get("gain"), parameters.get("words"), parameters.lost)
context.close()
"""


def test_parameters_on_micropython(tmp_path: Path) -> None:
    require("unix")
    board.generate(TYPES, tmp_path)
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    host, asker = (Context(Udp("127.0.0.1", link.port)) for _ in range(2))
    ours = host.node("host").parameters()
    ours.declare("speed", 1.0)
    over = threading.Event()

    def serve() -> None:
        executor = Executor(host)
        while not over.is_set():
            executor.spin_some(0.05)
        host.close()

    serving = threading.Thread(target=serve, daemon=True)
    serving.start()
    printed: list[str] = []

    def run() -> None:
        printed.append(run_mpy(PROGRAM, [str(link.port)], library=[ROOT / "src", tmp_path], timeout=25.0))

    running = threading.Thread(target=run)
    running.start()
    try:
        remote = ParameterClient(asker.node("asker"), "/lab/board", PATIENCE)
        assert remote.wait(PATIENCE)
        events: list[list[str]] = []
        remote.on_event(lambda event: events.append([p.name for p in event.changed_parameters]))
        assert remote.list() == ["gain", "stop", "words"]
        assert remote.get(["gain", "words"]) == {"gain": 1.5, "words": ["a", "b"]}
        assert remote.types(["gain", "words"]) == {"gain": 3, "words": 9}
        found = remote.describe("gain")
        assert (found.range, found.description) == ((0.0, 10.0, 0.5), "loop gain")
        remote.set("gain", 2.5)
        with pytest.raises(ParameterRejectedError, match="floating point range"):
            remote.set("gain", 2.25)
        remote.update({"gain": 3.0, "words": ["c"]})
        remote.set("stop", True)
        executor = Executor(asker)
        end = time.monotonic() + PATIENCE
        while ["stop"] not in events:
            assert time.monotonic() < end, events
            executor.spin_some(0.05)
    finally:
        running.join(30.0)
        asker.close()
        over.set()
        serving.join(PATIENCE)
        agent.stop()
    assert printed == ["[['speed'], '', 2.5] 3.0 ['c'] 0\n"]
    assert ours.get("speed") == 2.5
    assert events == [["gain"], ["gain", "words"], ["stop"]]
