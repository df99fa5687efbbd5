"""A process of ours with the components of programs/tools.py, for tests that meet it from outside."""

import os
import queue
import re
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from muros.rtc.corba import NameServer, Orb, RunningNameServer

WAIT = 15.0
"""Seconds that anything may take."""

BIN = Path(sys.executable).parent
PROGRAM = Path(__file__).parents[1] / "programs" / "tools.py"


class Process:
    """A process of ours with the components of programs/tools.py, and what it prints."""

    def __init__(self, conf: Path, *options: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "muros", "rtc", "run", str(PROGRAM), "-f", str(conf), *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.lines = queue.Queue[str]()
        self.said: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def end(self, *, kill: bool = False) -> int:
        """End it, as a person does or by force; its exit status."""
        (self.process.kill if kill else self.process.terminate)()
        status = self.process.wait(WAIT)
        self._reader.join(WAIT)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return status

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said.append(line.rstrip())
            self.lines.put(line.rstrip())

    def until(self, pattern: str) -> str:
        """The next line that the pattern matches."""
        while True:
            try:
                line = self.lines.get(timeout=WAIT)
            except queue.Empty:
                pytest.fail(f"nothing like {pattern!r} was said, only {self.said[-5:]}")
            if re.search(pattern, line):
                return line

    def forget(self) -> None:
        """Do not look at what has been said so far."""
        while not self.lines.empty():
            self.lines.get_nowait()


class World:
    """A name server and a process of ours, for the tools."""

    def __init__(self, orb: Orb, server: RunningNameServer, folder: Path) -> None:
        self.folder = folder
        self.server = NameServer(orb, server.address)
        self.conf = folder / "rtc.conf"
        self.conf.write_text(
            f"corba.nameservers: {server.address}\ncorba.endpoints: 127.0.0.1:\nlogger.enable: NO\n"
            "naming.formats: test.host_cxt/%n.rtc\nmanager.shutdown_on_nortcs: NO\nmanager.shutdown_auto: NO\n"
        )
        self.root = f"/{server.address}"
        self.giver = f"{self.root}/test.host_cxt/Giver0.rtc"
        self.taker = f"{self.root}/test.host_cxt/Taker0.rtc"
        self.process = self.start()

    def start(self) -> Process:
        """Another process with both components, when these can be reached."""
        process = Process(self.conf)
        for name in ("Giver0", "Taker0"):
            self.until(lambda name=name: self.is_there(name), process)  # type: ignore[misc]
        return process

    def is_there(self, name: str) -> bool:
        """Whether a living component has that name."""
        found = self.server.resolve(f"test.host_cxt/{name}.rtc")
        try:
            return found is not None and not found._non_existent()
        except Exception:
            return False

    def until(self, holds: Callable[[], bool], process: Process | None = None) -> None:
        """Wait until something holds."""
        tries = threading.Event()
        for _ in range(int(WAIT / 0.05)):
            if holds():
                return
            assert process is None or process.process.poll() is None, process.said
            tries.wait(0.05)
        pytest.fail("it does not come to hold")

    def run(self, command: str, *arguments: str, status: int = 0) -> str:
        """What a tool prints."""
        done = subprocess.run(
            [str(BIN / command), *arguments],
            env={**os.environ, "RTCTREE_NAMESERVERS": self.root[1:], "OMNIORB_CONFIG": os.devnull},
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=40,
            check=False,
        )
        assert done.returncode == status, f"{done.stdout}{done.stderr}"
        return done.stdout + done.stderr

    def state(self, path: str) -> str:
        """Active, Inactive or Error."""
        return self.run("rtcat", path).splitlines()[0].split()[-1]
