"""Diagnostics of a board on MicroPython, through an agent and a bridge: the cases D1 to D6 on the board's side."""

from pathlib import Path
from typing import Any

from muros.diagnostics import Bridge, read_table_untrusted
from muros.interfaces import board, message
from tests.diagnostics.test_bridge import TABLE, pairs
from tests.micropython.test_lifecycle import Board, stage
from tests.rclc_space.ways import PATIENCE, Stage

__all__ = ["stage"]

TYPES = ["micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticStatus", "std_msgs/msg/Empty"]
ARRAY = message("diagnostic_msgs/msg/DiagnosticArray")

PROGRAM = """
import sys
from muros.client import Udp
from muros.rclc import CapacityError, Context, DiagnosticUpdater, Executor
from muros.rclc.diagnostics import FAILED, WARN

context = Context(Udp("127.0.0.1", int(sys.argv[1])))
told = []
context.on_problem(lambda code, text: told.append(text) if code == FAILED else None)
updater = DiagnosticUpdater(context.node("board"), tasks=2)
executor = Executor(context)

last = -17

def check(task):
    task.set(0, 12.5, WARN)
    task.lookup(1, 1)
    task.set(2, True)
    task.set(7, last)

def broken(task):
    raise OSError("no motor")

updater.task(1, 7, check)
updater.task(2, 8, broken)
try:
    updater.task(3, 8, check)
except CapacityError as error:
    print(error.code)
while context.state != "CONNECTED":
    executor.spin_some(0.01)
sent = []
for _ in range(3):
    sent.append(updater.update())
    executor.spin_some(0.01)
last = -18  # which tells the host to go on
sent.append(updater.update())
while not all(task.fresh for task in updater.tasks):
    executor.spin_some(0.02)
sent.append(updater.update())
print(sent, told)
for _ in range(20):
    executor.spin_some(0.01)
context.close()
"""


def test_diagnostics_of_a_board(stage: Stage, tmp_path: Path) -> None:
    way: Any = stage.way
    heard: list[Any] = []
    node = stage.node("tool")
    node.subscription(ARRAY, "diagnostics", lambda array: heard.extend(array.status))
    force = node.publisher(message("std_msgs/msg/Empty"), "diagnostics_uros/force_update")
    Bridge(stage.node("bridge"), read_table_untrusted(TABLE))
    assert all(context.wait_connected(PATIENCE) for context in stage.contexts)
    board.generate(TYPES, tmp_path, constants=())
    running = Board(PROGRAM, way.link.port, tmp_path)
    stage.until(lambda: len(heard) == 3)
    stage.until(
        lambda: len(heard) >= 5 and running.ended, lambda: force.publish(message("std_msgs/msg/Empty")())
    )
    assert [(status.name, status.level) for status in heard[:2]] == [("battery", 1), ("motor", 2)]
    assert pairs(heard[0]) == [
        ("voltage", "12.5"),
        ("mode", "in use"),
        ("present", "True"),
        ("NOTFOUND", "-17"),
    ]
    assert heard[0].hardware_id == "left arm"
    assert heard[1].values == []
    assert pairs(heard[2])[3] == ("NOTFOUND", "-18")
    assert [status.name for status in heard[3:]] == ["battery", "motor"]
    assert running.lines() == ["1", f"[2, 0, 0, 1, 2] {['diagnostic task 2 raised OSError: no motor'] * 3}"]
