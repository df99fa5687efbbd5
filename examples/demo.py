"""The main job in under a minute: boards play ping-pong, the agent is killed, they come back, and ROS 2 sees it all.

Four boards run `ping_pong.py`: two are MicroPython interpreters, two CPython; of each, one speaks UDP and one a serial
line. At the end an ordinary ROS 2 node listens (rclpy, where it is installed; else `muros topic echo`). Everything
stays on this machine. The exit status is 0 when every board heard pongs and was back within 2 s, and the graph of ROS 2
had their nodes and messages.
"""

import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE.parent / "src"
BACK_WITHIN = 2.0
"""Seconds that a board may take to be connected again once the agent is up."""
LISTENS_FOR = 5.0
"""Seconds that the listener in the ROS 2 graph takes."""
_COLOURS = {
    "agent": "1",
    "ros2": "34",
    "mpy-udp": "32",
    "mpy-serial": "36",
    "py-udp": "33",
    "py-serial": "35",
}


@dataclass
class Board:
    """A board process and what its lines said."""

    name: str
    process: subprocess.Popen[str] | None = None
    pongs: int = 0
    pings: int = 0
    answered: int = 0
    states: list[tuple[float, str]] = field(default_factory=list)

    def read(self, line: str) -> None:
        """Takes one line of its output."""
        if line.startswith("Pong for"):
            self.pongs += 1
        elif line.startswith("Ping send"):
            self.pings += 1
        elif line.startswith("Ping received"):
            self.answered += 1
        elif line.startswith("state "):
            self.states.append((time.monotonic(), line.removeprefix("state ")))

    def connected_after(self, moment: float) -> float | None:
        """Seconds from ``moment`` to its next CONNECTED, None if there was none."""
        return next((at - moment for at, state in self.states if at >= moment and state == "CONNECTED"), None)


class Stage:
    """The processes of the demo and their lines on the terminal."""

    def __init__(self, folder: Path, *, colour: bool) -> None:
        self.folder = folder
        self.colour = colour
        self.start = time.monotonic()
        self.boards: list[Board] = []
        self.agent: subprocess.Popen[str] | None = None
        self.port = _free_port()
        self.lines = [folder / "ttyBoard0", folder / "ttyBoard1"]
        # The graph of ROS 2, on this machine only; nobody else's settings of ROS 2 count.
        self.environment = {k: v for k, v in os.environ.items() if not k.startswith(("ROS_", "RMW_"))}
        self.environment.update(ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST", PYTHONUNBUFFERED="1")
        self._lock = threading.Lock()
        self._readers: list[threading.Thread] = []

    def say(self, who: str, line: str) -> None:
        """Prints a line with the time and who says it."""
        stamp = f"{time.monotonic() - self.start:6.2f}"
        name = f"{who:>10}"
        if self.colour:
            name = f"\x1b[{_COLOURS.get(who, '1')}m{name}\x1b[0m"
        with self._lock:
            print(f"{stamp} {name} | {line}", flush=True)

    def start_agent(self) -> None:
        """Starts the agent on UDP and two serial lines."""
        lines = [word for line in self.lines for word in ("pseudoterminal", "-D", str(line))]
        command = [
            sys.executable,
            "-m",
            "muros",
            "agent",
            "udp4",
            "-p",
            str(self.port),
            "--bind",
            "127.0.0.1",
            *lines,
        ]
        self.agent = self._spawn(command, self.environment, "agent", None)

    def kill_agent(self) -> None:
        """Kills it, as a power cut would."""
        assert self.agent is not None
        self.agent.kill()
        self.agent.wait()

    def start_board(
        self, name: str, interpreter: list[str], words: list[str], environment: dict[str, str]
    ) -> None:
        """Starts a board of that name."""
        board = Board(name)
        self.boards.append(board)
        command = [*interpreter, str(HERE / "ping_pong.py"), name.replace("-", "_"), *words, "1.0"]
        board.process = self._spawn(command, environment, name, board)

    def listen(self, command: list[str], seconds: float) -> int:
        """Runs a listener in the ROS 2 graph to its end, at most ``seconds``; returns its exit status."""
        process = self._spawn(command, self.environment, "ros2", None)
        try:
            return process.wait(seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()

    def close(self) -> None:
        """Stops every process."""
        for process in [board.process for board in self.boards] + [self.agent]:
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGINT if process is self.agent else signal.SIGKILL)
        for process in [board.process for board in self.boards] + [self.agent]:
            if process is not None:
                process.wait(5)
        for reader in self._readers:
            reader.join(2)

    def _spawn(
        self, command: list[str], environment: dict[str, str], who: str, board: Board | None
    ) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, bufsize=1
        )

        def read() -> None:
            assert process.stdout is not None
            for line in process.stdout:
                if board is not None:
                    board.read(line.rstrip())
                self.say(who, line.rstrip())

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        self._readers.append(reader)
        return process


def main() -> int:
    """Runs the demo; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--play", type=float, default=8.0, help="seconds of play before and after the restart"
    )
    parser.add_argument("--no-color", action="store_true")
    options = parser.parse_args()
    micropython = _micropython()
    with tempfile.TemporaryDirectory(prefix="muros-demo-") as folder:
        stage = Stage(Path(folder), colour=sys.stdout.isatty() and not options.no_color)
        try:
            return play(stage, micropython, options.play)
        finally:
            stage.close()


def play(stage: Stage, micropython: str | None, seconds: float) -> int:
    """The story: agent, boards, play, kill, restart, play, summary."""
    stage.say("demo", "starting the agent: UDP and two serial lines (pseudoterminals)")
    stage.start_agent()
    _wait_for(lambda: all(line.exists() for line in stage.lines), "the agent's serial lines")
    board_path = stage.folder / "lib"
    udp, serial = ["udp", "127.0.0.1", str(stage.port)], ["serial", str(stage.lines[0]), "115200"]
    python = dict(os.environ, PYTHONUNBUFFERED="1")
    if micropython is None:
        stage.say("demo", "no MicroPython for this machine on PyPI: its boards run on CPython too")
    else:
        from muros.interfaces.board import generate

        generate(["std_msgs/msg/Header"], board_path)
    boards = dict(os.environ, MICROPYPATH=f"{SOURCE}:{board_path}:.frozen") if micropython else python
    interpreter = [micropython] if micropython else [sys.executable]
    stage.say("demo", "starting four boards, all running examples/ping_pong.py")
    stage.start_board("mpy-udp", interpreter, udp, boards)
    stage.start_board("mpy-serial", interpreter, serial, boards)
    stage.start_board("py-udp", [sys.executable], udp, python)
    stage.start_board("py-serial", [sys.executable], ["serial", str(stage.lines[1]), "115200"], python)
    time.sleep(seconds)

    stage.say("demo", "killing the agent (SIGKILL): the boards are on their own")
    stage.kill_agent()
    before = {board.name: board.pongs for board in stage.boards}
    time.sleep(2.0)
    stage.say("demo", "starting the agent again; nobody touches the boards")
    stage.start_agent()
    restarted = time.monotonic()
    time.sleep(seconds)
    heard = _ros2(stage)

    stage.say("demo", "what happened")
    failed = False
    for board in stage.boards:
        back = board.connected_after(restarted)
        fine = back is not None and back <= BACK_WITHIN and board.pongs > before[board.name] > 0
        failed |= not fine
        stage.say(
            board.name,
            f"{board.pings} pings sent, {board.pongs} pongs, {board.answered} pings answered; "
            + (
                "did not come back"
                if back is None
                else f"back {back:.2f} s after the agent was started again"
            )
            + ("" if fine else "  <- not as it should be"),
        )
    stage.say(
        "ros2", "saw the boards' nodes and messages" if heard else "saw nothing  <- not as it should be"
    )
    failed |= not heard
    said = f"every board came back by itself within {BACK_WITHIN:.0f} s, and ROS 2 saw it"
    stage.say("demo", "FAILED" if failed else said)
    return 1 if failed else 0


def _ros2(stage: Stage) -> bool:
    """The boards as ROS 2 sees them: by a node of rclpy where that is installed, else by our own commands."""
    python = _rclpy()
    if python is not None:
        stage.say("demo", "an ordinary ROS 2 node (rclpy) joins: what does it see of the boards?")
        return stage.listen([python, str(HERE / "ros2_listener.py"), str(LISTENS_FOR)], 30.0) == 0
    stage.say(
        "demo",
        "no rclpy here; muros looks into the ROS 2 graph itself: muros node list, muros topic echo /ping",
    )
    muros = [sys.executable, "-m", "muros"]
    saw = stage.listen([*muros, "node", "list"], 30.0) == 0
    return (
        stage.listen([*muros, "topic", "echo", "/ping", "std_msgs/msg/Header", "--once"], 30.0) == 0 and saw
    )


def _rclpy() -> str | None:
    """A Python that has rclpy: of a ROS 2 that was sourced, or of the environments of the tests."""
    peers = sorted((HERE.parent / "build/peers").glob("*/bin/python"))
    for python in [sys.executable, shutil.which("python3"), *map(str, peers)]:
        if (
            python
            and subprocess.run([python, "-c", "import rclpy, std_msgs"], capture_output=True).returncode == 0
        ):
            return python
    return None


def _micropython() -> str | None:
    beside = Path(sys.executable).with_name("micropython")
    return str(beside) if beside.exists() else shutil.which("micropython")


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _wait_for(condition: Callable[[], bool], what: str, limit: float = 10.0) -> None:
    end = time.monotonic() + limit
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f"demo: {what} did not come up within {limit:.0f} s")
        time.sleep(0.02)


if __name__ == "__main__":
    sys.exit(main())
