"""A board on MicroPython asks the agent for the time."""

import time
from pathlib import Path
from typing import Any

from tests.micropython.test_lifecycle import Board, stage
from tests.rclc_space.ways import Stage

__all__ = ["stage"]

PROGRAM = """
import sys
from muros.client import Udp
from muros.rclc import Context, Epoch

context = Context(Udp("127.0.0.1", int(sys.argv[1])))
context.node("board")
epoch = Epoch(context)
print(epoch.synchronized, epoch.millis())
print(epoch.sync(20))
print(epoch.synchronized, epoch.millis())
context.close()
"""


def test_c6_epoch(stage: Stage, tmp_path: Path) -> None:
    way: Any = stage.way
    before = time.time_ns() // 10**6
    lines = Board(PROGRAM, way.link.port, tmp_path).lines()
    after = time.time_ns() // 10**6
    assert lines[:2] == ["False 0", "True"]
    known, millis = lines[2].split()
    assert known == "True"
    assert before - 5000 <= int(millis) <= after + 5000
