"""Programs that tests run as processes, and what they print."""

import subprocess
import threading
from collections.abc import Mapping, Sequence

PATIENCE = 30.0
"""Seconds until a program that should end has ended."""


class Running:
    """A program as a process; ``lines`` is what it has printed."""

    def __init__(self, command: Sequence[str], environment: Mapping[str, str] | None = None) -> None:
        self.lines: list[str] = []
        self.process = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def end(self, number: int | None = None) -> tuple[int, str]:
        """Waits for its end, with a signal first if one is given; its status and what it said on standard error."""
        if number is not None:
            self.process.send_signal(number)
        status = self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        assert self.process.stderr is not None
        return status, self.process.stderr.read()

    def stop(self) -> None:
        """Ends it whatever happened."""
        self.process.kill()
        self.process.wait()
        self._reader.join(PATIENCE)
        for stream in (self.process.stdout, self.process.stderr):
            assert stream is not None
            stream.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\r\n"))
