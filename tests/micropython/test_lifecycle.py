"""A managed node on MicroPython, moved through an agent, and one that moves others."""

import threading
from pathlib import Path
from typing import Any

import pytest

from muros.interfaces import board
from muros.rclc import Executor, LifecycleClient
from tests.micropython.runtimes import ROOT, require
from tests.micropython.unix import run_mpy
from tests.rclc_space.ways import PATIENCE, Stage, ThroughAgent

KINDS = ("ChangeState", "GetState", "GetAvailableStates", "GetAvailableTransitions")
TYPES = ["lifecycle_msgs/msg/TransitionEvent", *(f"lifecycle_msgs/srv/{kind}" for kind in KINDS)]

MANAGED = """
import sys
from muros.client import Udp
from muros.compat import loans
from muros.rclc import Context, Executor, TransitionError

context = Context(Udp("127.0.0.1", int(sys.argv[1])))
context.on_problem(lambda code, text: print("problem", code, text) if code in (13, 14, 15) else None)
node = context.node("camera", "lab")

def crash():
    raise ValueError("no lens")

lifecycle = node.lifecycle(
    on_configure=lambda: print("configure"),
    on_activate=lambda: print("activate", lifecycle.state),
    on_deactivate=lambda: False,
    on_shutdown=crash,
    on_error=lambda: print("error", repr(lifecycle.error)),
    time=lambda: (7, 8),
)
try:
    lifecycle.activate()
except TransitionError as error:
    print(error.code, error)
executor = Executor(context)
while lifecycle.callbacks[4] is crash and lifecycle.error is None:
    executor.spin_some(0.05)
for i in range(20):
    executor.spin_some(0.01)
print(lifecycle.id, lifecycle.lost, "muros.rclc.lifecycles" in sys.modules, loans)
context.close()
"""

MOVER = """
import sys
from muros.client import Udp
from muros.rclc import Context, Executor, LifecycleClient

context = Context(Udp("127.0.0.1", int(sys.argv[1])))
node = context.node("mover")
client = LifecycleClient(node, "/lab/lidar")
while client.state(timeout=1.0) is None:
    pass
print(client.state(), len(client.states()), client.transitions())
print(client.change("configure"), client.change("activate"), client.state())
answers = []
client.change("shutdown", on_done=answers.append)
executor = Executor(context)
while not answers:
    executor.spin_some(0.05)
print(answers, client.state())
context.close()
"""


class Board:
    """A program on MicroPython, in a thread."""

    def __init__(self, program: str, port: int, folder: Path) -> None:
        require("unix")
        board.generate(TYPES, folder, constants=())
        self.output = ""
        self._failed: Exception | None = None
        self._thread = threading.Thread(target=self._run, args=(program, port, folder), daemon=True)
        self._thread.start()

    def _run(self, program: str, port: int, folder: Path) -> None:
        try:
            self.output = run_mpy(program, [str(port)], library=(ROOT / "src", ROOT, folder))
        except Exception as error:
            self._failed = error

    @property
    def ended(self) -> bool:
        """Whether it has; raises what was wrong."""
        if self._failed is not None:
            raise self._failed
        return not self._thread.is_alive()

    def lines(self) -> list[str]:
        """What it printed until its end."""
        self._thread.join(PATIENCE)
        assert self.ended
        return self.output.splitlines()


@pytest.fixture
def stage() -> Any:
    """Nodes on hosts."""
    made = Stage(ThroughAgent())
    yield made
    made.close()


def test_a_managed_node(stage: Stage, tmp_path: Path) -> None:
    way: Any = stage.way
    running = Board(MANAGED, way.link.port, tmp_path)
    node = stage.node("mover")
    client = LifecycleClient(node, "/lab/camera")
    events: list[tuple[str, str]] = []
    client.on_event(lambda start, goal: events.append((start, goal)))
    answers: list[Any] = []

    def ask(question: str, *given: Any) -> Any:
        answers.clear()
        method = getattr(client, question)
        stage.until(lambda: running.ended or method(*given, on_done=answers.append, timeout=20.0))
        stage.until(lambda: running.ended or answers)
        return answers[0]

    assert ask("state") == "unconfigured"
    assert len(ask("states")) == 11
    assert [row[1] for row in ask("transitions")] == ["configure", "shutdown"]
    assert ask("change", "cleanup") is False
    assert ask("change", "configure") is True
    assert ask("change", "activate") is True
    assert ask("change", "deactivate") is False
    assert ask("change", "shutdown") is False
    assert running.lines() == [
        "1 node camera is unconfigured: there is no transition 'activate' from here, only configure, shutdown",
        "problem 14 node camera is unconfigured: there is no transition 'cleanup' from here, only configure, shutdown",
        "configure",
        "activate activating",
        "problem 15 on_shutdown of node camera raised ValueError: no lens",
        "error ValueError('no lens',)",
        "1 0 False []",
    ]
    stage.until(lambda: len(events) == 9)
    assert events[-3:] == [
        ("active", "shuttingdown"),
        ("shuttingdown", "errorprocessing"),
        ("errorprocessing", "unconfigured"),
    ]


def test_who_moves_others(stage: Stage, tmp_path: Path) -> None:
    way: Any = stage.way
    node = stage.node("lidar", "lab")
    lifecycle = node.lifecycle()
    executor = Executor(node.context)
    stage.until(lambda: node.context.state == "CONNECTED")
    running = Board(MOVER, way.link.port, tmp_path)
    stage.until(lambda: running.ended, lambda: executor.spin_some(0.01))
    assert running.lines() == [
        "unconfigured 11 [(1, 'configure', 'unconfigured', 'configuring'), "
        "(5, 'shutdown', 'unconfigured', 'shuttingdown')]",
        "True True active",
        "[True] finalized",
    ]
    assert lifecycle.state == "finalized"
