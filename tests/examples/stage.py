"""Where the examples are run: as processes of CPython or MicroPython, through an agent or straight in the graph."""

import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from muros.links import Link, UdpLink
from tests.client.agent_thread import RunningAgent
from tests.dds.domains import Domain
from tests.micropython.runtimes import UNIX
from tests.running import PATIENCE, Running

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
TYPES = (
    "std_msgs/msg/Int32",
    "std_msgs/msg/String",
    "std_msgs/msg/UInt8MultiArray",
    "std_msgs/msg/Empty",
    "micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticStatus",
    "sensor_msgs/msg/JointState",
    "example_interfaces/srv/AddTwoInts",
    "rcl_interfaces/srv/GetParameters",
    "rcl_interfaces/srv/GetParameterTypes",
    "rcl_interfaces/srv/SetParameters",
    "rcl_interfaces/srv/SetParametersAtomically",
    "rcl_interfaces/srv/ListParameters",
    "rcl_interfaces/srv/DescribeParameters",
    "rcl_interfaces/msg/ParameterEvent",
)
"""What the examples import on boards."""


class Program(Running):
    """An example that runs, and what it prints."""

    def __init__(self, name: str, words: list[str], environment: dict[str, str], micropython: bool) -> None:
        self.name = name
        interpreter = [str(UNIX)] if micropython else [sys.executable, "-u"]
        super().__init__([*interpreter, str(EXAMPLES / f"{name}.py"), *words], environment)

    def ends(self, number: int | None = None) -> None:
        """Waits for its end, with a signal first if one is given; it ends well and has complained of nothing."""
        assert self.end(number) == (0, ""), self.lines


class Stage:
    """A domain, an agent for those who need one, and the programs that run."""

    def __init__(self, board: Path, domain: Domain) -> None:
        self.domain = domain
        self.environment = {
            key: value
            for key, value in os.environ.items()
            if not key.startswith(("ROS_", "RMW_", "MUROS_", "MICROPY"))
        }
        self.environment.update(ROS_DOMAIN_ID=str(int(domain)), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
        self.board = dict(self.environment, MICROPYPATH=f".frozen:{ROOT / 'src'}:{board}")
        self.programs: list[Program] = []
        self.link = UdpLink(0, "127.0.0.1")
        self.running: RunningAgent | None = None

    def agent(self, *links: Link, space: str = "local:") -> str:
        """Starts an agent; the way to it."""
        self.running = RunningAgent(self.link, *links, space=space)
        return f"udp:127.0.0.1:{self.link.port}"

    def start(self, name: str, *words: object, on: str = "python") -> Program:
        """Starts an example."""
        micropython = on == "micropython"
        program = Program(
            name, list(map(str, words)), self.board if micropython else self.environment, micropython
        )
        self.programs.append(program)
        return program

    def until(self, condition: Callable[[], Any]) -> None:
        """Waits for what the programs print."""
        end = time.monotonic() + PATIENCE
        while not condition():
            ended = [p.name for p in self.programs if p.process.poll() not in (None, 0)]
            said = {program.name: program.lines for program in self.programs}
            assert not ended, f"{ended} ended: {said}, {self._errors()}"
            assert time.monotonic() < end, f"it did not come about within {PATIENCE} s: {said}"
            time.sleep(0.01)

    def _errors(self) -> list[str]:
        return [
            p.process.stderr.read()
            for p in self.programs
            if p.process.poll() and p.process.stderr is not None
        ]

    def close(self) -> None:
        """Ends them all."""
        for program in self.programs:
            program.stop()
        if self.running is not None:
            self.running.stop()


def interrupt(program: Program) -> None:
    """Ctrl-C ends a program of CPython without a word."""
    program.ends(signal.SIGINT)
