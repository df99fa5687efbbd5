"""Other people's DDS, as processes that tests command: ROS 2 from PyPI, cyclonedds-python, Fast DDS in C++.

=======  =====================================  =============================================================
peer     what it is                             why
=======  =====================================  =============================================================
jazzy    rclpy of ROS 2 Jazzy, Fast DDS 2.14    the ROS 2 that most people run
kilted   rclpy of ROS 2 Kilted, Fast DDS 3.2    the newest; strict about type information
cyclone  cyclonedds-python 11.0.1               a second vendor; plays the services of rmw_cyclonedds
fastdds  a C++ program on Fast DDS 2.9          as old as Humble's
=======  =====================================  =============================================================

`tools/setup.sh` installs them. Where one cannot be installed the tests that need it are skipped and say so; in
continuous integration (``CI=true``) they fail, so that a green run never hides a missing peer.

`start("jazzy")` runs `programs/ros.py` in that environment; the commands are its methods:

    with start("jazzy") as ros, free_domain() as domain:
        node = ros.do("node", name="talker", domain=domain)

Everything stays on this machine: the peers look for others on the loopback interface only.
"""

import asyncio
import json
import os
import select
import signal
import subprocess
import sys
import time
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, Self

import pytest

__all__ = ["ENVIRONMENTS", "Peer", "PeerError", "environment", "python_of", "require", "start"]

ROOT: Final = Path(__file__).resolve().parents[2]
PROGRAMS: Final = Path(__file__).resolve().parent / "programs"
FOLDER: Final = ROOT / "build/peers"

ENVIRONMENTS: Final = {"jazzy": "ros.py", "kilted": "ros.py", "cyclone": "cyclone.py", "fastdds": "peer"}
"""The peers and the program each runs."""

CYCLONE_LO: Final = """<CycloneDDS><Domain><General><Interfaces>
<NetworkInterface name="lo" multicast="true"/></Interfaces></General>{discovery}</Domain></CycloneDDS>"""
CYCLONE_LOCALHOST: Final = """<Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer Address="127.0.0.1"/></Peers></Discovery>"""

WAIT: Final = 30.0
"""Seconds that peers wait for what a command waits for, unless told otherwise."""

SPARE_TIME: Final = 20.0
"""Seconds an answer may take longer than the wait that was asked for, on a machine that is busy."""


class PeerError(AssertionError):
    """A peer could not do what it was told, or did not answer; the text says what it printed."""


def require(peer: str, package: str = "") -> None:
    """Skips the running test, or fails it under ``CI=true``, unless `peer` is installed.

    `package` is one that the set-up compiles into a ROS 2 from PyPI.
    """
    lacking = _lacking(peer)
    if not lacking and package and not any((FOLDER / peer).glob("package-*")):
        lacking = f"the package {package} was not compiled"
    if not lacking:
        return
    reason = f"DDS peer {peer!r}: {lacking} (tools/setup.sh installs it)"
    if os.environ.get("CI") == "true":
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


def python_of(peer: str) -> Path:
    """The Python that has the peer's packages."""
    return Path(sys.executable) if peer == "cyclone" else FOLDER / peer / "bin/python"


def environment(peer: str, *, discovery: str = "multicast", shared_memory: bool = False) -> dict[str, str]:
    """Environment variables that keep `peer` on this machine.

    `discovery` is "multicast" (group traffic on the loopback interface) or "localhost" (ROS's LOCALHOST range:
    well-known unicast ports of 127.0.0.1). `shared_memory` lets Fast DDS offer it besides UDP.
    """
    if discovery not in ("multicast", "localhost"):
        raise ValueError(f"unknown discovery {discovery!r}: multicast or localhost")
    ours = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(("ROS_", "RMW_", "FASTDDS_", "FASTRTPS_", "CYCLONEDDS_", "PYTHON", "AMENT_"))
    }
    ours["PYTHONUNBUFFERED"] = "1"
    ours["CYCLONEDDS_URI"] = CYCLONE_LO.format(
        discovery=CYCLONE_LOCALHOST if discovery == "localhost" else ""
    )
    if discovery == "localhost":
        ours["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        if not shared_memory:
            ours["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
        return ours
    variable = "FASTDDS_DEFAULT_PROFILES_FILE" if peer == "kilted" else "FASTRTPS_DEFAULT_PROFILES_FILE"
    ours[variable] = str(PROGRAMS / ("fastdds_lo_and_memory.xml" if shared_memory else "fastdds_lo.xml"))
    return ours


class Peer:
    """A peer that runs. Ends with the `with` block, politely if it can, else killed."""

    def __init__(self, name: str, process: "subprocess.Popen[bytes]", log: Path) -> None:
        self.name = name
        self.process = process
        self._log = log
        self._unread = b""
        self.unanswered = 0
        """Commands begun whose answer was not fetched."""

    @property
    def printed(self) -> str:
        """What it printed so far, warnings of its libraries mostly."""
        return self._log.read_text(errors="replace")

    def do(self, command: str, **arguments: Any) -> Any:
        """Carry out a command and return its result. PeerError if it failed or took too long."""
        self.begin(command, **arguments)
        return self.result(arguments.get("wait", WAIT) + SPARE_TIME)

    async def ask(self, command: str, **arguments: Any) -> Any:
        """`do` beside a running event loop."""
        return await asyncio.to_thread(self.do, command, **arguments)

    def begin(self, command: str, **arguments: Any) -> None:
        """Send a command; `result` (or `ready`) fetches its answer."""
        assert self.process.stdin is not None
        if self.process.poll() is not None:
            raise self._error(f"ended with code {self.process.returncode}")
        try:
            self.process.stdin.write(json.dumps({"do": command, **arguments}).encode() + b"\n")
            self.process.stdin.flush()
            self.unanswered += 1
        except BrokenPipeError:
            raise self._error("has ended") from None

    def ready(self, wait: float = 0.0) -> bool:
        """Whether an answer is there, at the latest after `wait` seconds."""
        assert self.process.stdout is not None
        end = time.monotonic() + wait
        while b"\n" not in self._unread:
            left = max(0.0, end - time.monotonic())
            if not select.select([self.process.stdout], [], [], left)[0]:
                return False
            piece = os.read(self.process.stdout.fileno(), 1 << 20)
            if not piece:
                raise self._error(f"ended with code {self.process.wait(5)}")
            self._unread += piece
        return True

    def fileno(self) -> int:
        """Readable when an answer is there: for `loop.add_reader`."""
        assert self.process.stdout is not None
        return self.process.stdout.fileno()

    def result(self, wait: float = WAIT) -> Any:
        """The answer to the oldest command begun."""
        if not self.ready(wait):
            raise self._error(f"did not answer within {wait:.0f} s")
        line, _, self._unread = self._unread.partition(b"\n")
        self.unanswered -= 1
        answer = json.loads(line)
        if "error" in answer:
            raise PeerError(f"{self.name}: {answer['error']}")
        return answer["result"]

    def stop(self) -> None:
        """Let it leave politely; killed when that takes longer than 5 s."""
        if self.process.stdin is not None:
            with suppress(BrokenPipeError):
                self.process.stdin.close()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.kill()
        self._tidy()

    def kill(self) -> None:
        """End it as a power cut would."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(10)
        self._tidy()

    def pause(self) -> None:
        """Stop it where it stands, until `resume`."""
        self.process.send_signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Let it go on."""
        self.process.send_signal(signal.SIGCONT)

    def _error(self, what: str) -> PeerError:
        return PeerError(f"{self.name} {what}; it printed:\n{self.printed[-4000:]}")

    def _tidy(self) -> None:
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None and not pipe.closed:
                with suppress(BrokenPipeError):
                    pipe.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.stop()
        self._tidy()
        self._log.unlink(missing_ok=True)


def start(
    peer: str,
    *,
    discovery: str = "multicast",
    shared_memory: bool = False,
    program: Path | None = None,
    more: dict[str, str] | None = None,
) -> Peer:
    """Run a peer; skips or fails the running test when it is not installed (`require`).

    `program` runs another Python file in the peer's environment, which speaks the same lines; `more` are further
    environment variables.
    """
    require(peer)
    own = [str(FOLDER / "fastdds/peer")]
    command = (
        own if peer == "fastdds" else [str(python_of(peer)), str(program or PROGRAMS / ENVIRONMENTS[peer])]
    )
    logs = ROOT / "build/peers/logs"
    logs.mkdir(parents=True, exist_ok=True)
    log = logs / f"{peer}-{os.getpid()}-{time.monotonic_ns()}.log"
    with log.open("wb") as printed:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=printed,
            env=environment(peer, discovery=discovery, shared_memory=shared_memory) | (more or {}),
            cwd=logs,
        )
    return Peer(peer, process, log)


def _lacking(peer: str) -> str:
    if peer == "cyclone":
        return "" if find_spec("cyclonedds") else "the package cyclonedds is not installed"
    if peer not in ENVIRONMENTS:
        raise ValueError(f"unknown peer {peer!r}: {', '.join(ENVIRONMENTS)}")
    if any((FOLDER / peer).glob("ready-*")):
        return ""
    return f"build/peers/{peer} is not there"
