"""The programs of the guide to logging and simulated time do what is said of them, on MicroPython as well."""

from pathlib import Path
from typing import Any

import pytest

from muros.interfaces import board, message
from tests.micropython.runtimes import require
from tests.micropython.unix import run_mpy
from tests.test_guides import ROOT, Bench, bench, programs

__all__ = ["bench"]

GUIDE = "docs/logging-and-time.md"
LOG: Any = message("rcl_interfaces/msg/Log")
CLOCK: Any = message("rosgraph_msgs/msg/Clock")


def test_no_program_goes_untested() -> None:
    assert len(programs(GUIDE)) == 4


def test_logging(bench: Bench) -> None:
    got: list[Any] = []
    bench.node.subscription(LOG, "/rosout", got.append, qos="rosout")
    running = bench.start(GUIDE, 0)
    bench.until(lambda: got and len(running.lines) >= 2)
    assert (got[0].level, got[0].name, got[0].msg) == (30, "greenhouse.thermometer", "it is too hot")
    assert got[0].stamp.sec > 1_700_000_000
    assert got[0].file.endswith("program.py")
    assert running.lines[0].startswith("[DEBUG] [")
    assert running.lines[1].endswith("] [greenhouse.thermometer]: it is too hot")
    running.stop()


@pytest.mark.parametrize("number", [1, 2])
def test_simulated_time(bench: Bench, number: int) -> None:
    publisher = bench.node.publisher(CLOCK, "/clock")
    running = bench.start(GUIDE, number)
    now = 5_000

    def step() -> None:
        nonlocal now
        now += 20
        clock = CLOCK()
        clock.clock.sec, rest = divmod(now, 1000)
        clock.clock.nanosec = rest * 1_000_000
        publisher.publish(clock)

    bench.until(lambda: len(running.lines) >= 2, step)
    assert running.lines[0].startswith("step at (")
    bench.says_goodbye(running)


def test_the_time_since_1970(bench: Bench) -> None:
    running = bench.start(GUIDE, 3)
    bench.until(lambda: len(running.lines) >= 2)
    assert running.lines[0] == "synchronized"
    assert int(running.lines[1].split("it is ")[1].split(" ")[0]) > 1_700_000_000_000
    bench.says_goodbye(running)


BOARD = """
import sys
from muros.client import Udp
from muros.rclc import Context, Executor, RosTime

context = Context(Udp("127.0.0.1", int(sys.argv[1])))
node = context.node("board", "lab")
time = RosTime(node)
log = node.logger(time=time.now)
executor = Executor(context)
while context.state != "CONNECTED":
    executor.spin_some(0.05)
steps = []
time.timer(0.1, lambda: steps.append(time.now()))
clock = node.publisher(type(time.subscription._message), "/clock")
message = type(time.subscription._message)()
for now in (50, 99, 149, 150, 250):
    message.clock.sec = 5
    message.clock.nanosec = now * 1000000
    while time.now() != (5, now * 1000000):
        clock.publish(message)
        executor.spin_some(0.02)
    executor.spin_some(0.02)
assert steps == [(5, 150000000), (5, 250000000)], steps
log.debug("nothing")
while not log.warn("done"):
    executor.spin_some(0.02)
for _ in range(10):
    executor.spin_some(0.02)
context.close()
"""


def test_both_on_micropython(bench: Bench, tmp_path: Path) -> None:
    require("unix")
    board.generate(["rcl_interfaces/msg/Log", "rosgraph_msgs/msg/Clock"], tmp_path, constants=())
    got: list[Any] = []
    bench.node.subscription(LOG, "/rosout", got.append, qos="rosout")
    bench.until(lambda: bench.events.count("ClientReady") >= 1)
    shown = run_mpy(BOARD, [str(bench.link.port)], library=(ROOT / "src", tmp_path))
    assert shown.splitlines()[-1] == "[WARN] [5.250000000] [lab.board]: done"
    bench.until(lambda: got)
    assert (got[-1].level, got[-1].name, got[-1].msg) == (30, "lab.board", "done")
    assert (got[-1].stamp.sec, got[-1].stamp.nanosec) == (5, 250_000_000)
