"""The command `muros` as processes, in a DDS domain of the test's own, on this host only."""

import os
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import IO

from tests.dds.domains import Domain

LIMIT = 30.0
"""Seconds after which a command that should have ended counts as hanging."""


class Process:
    """A command that runs until the test stops it. What it prints is read line by line."""

    def __init__(self, process: "subprocess.Popen[str]", errors: IO[str]) -> None:
        self.process = process
        self._errors = errors
        assert process.stdout is not None
        self.out = process.stdout

    @property
    def err(self) -> str:
        """What it said besides, so far."""
        self._errors.seek(0)
        return self._errors.read()

    def line(self, containing: str) -> str:
        """The next line with this text; fails when the output ends before."""
        for line in self.out:
            if containing in line:
                return line
        raise AssertionError(f"no line with {containing!r}; besides it said {self.err!r}")

    def stop(self, number: int = signal.SIGINT) -> tuple[int, str]:
        """Send a signal; the exit status and the rest of the output."""
        self.process.send_signal(number)
        rest = self.out.read()
        return self.process.wait(LIMIT), rest


class Shell:
    """Runs `muros` in one domain."""

    def __init__(self, domain: Domain) -> None:
        self.domain = int(domain)
        self.environment = {
            k: v for k, v in os.environ.items() if not k.startswith(("ROS_", "RMW_", "MUROS_"))
        }
        self.environment.update(ROS_DOMAIN_ID=str(self.domain), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")

    def run(self, line: str) -> "subprocess.CompletedProcess[str]":
        """A command to its end."""
        return subprocess.run(
            [sys.executable, "-m", "muros", *shlex.split(line)],
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=LIMIT,
            check=False,
        )

    def outputs(self, *lines: str) -> list[str]:
        """What several commands print, run at once: they mostly wait for the network."""
        with ThreadPoolExecutor(len(lines)) as pool:
            return [done.stdout for done in pool.map(self.run, lines)]

    @contextmanager
    def running(self, line: str) -> Iterator[Process]:
        """A command beside the test, killed at the end if it still runs."""
        command = [sys.executable, "-m", "muros", *shlex.split(line)]
        with tempfile.TemporaryFile("w+") as errors:
            process = subprocess.Popen(
                command, env=self.environment, stdout=subprocess.PIPE, stderr=errors, text=True, bufsize=1
            )
            try:
                yield Process(process, errors)
            finally:
                process.kill()
                process.wait(LIMIT)
                if process.stdout is not None:
                    process.stdout.close()
