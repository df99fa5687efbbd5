"""Managers as processes of their own, on loopback, ended by pid."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from muros.rtc.corba._world import CorbaWorld
from muros.rtc.manager._defaults import DEFAULTS
from muros.rtc.properties import Properties
from muros.rtc.reports import Reporter
from tests.rtc.conftest import find_free_port

ENVIRONMENT = {**os.environ, "OMNIORB_CONFIG": os.devnull, "PYTHONUNBUFFERED": "1"}

PATIENCE = 20.0
"""Seconds that anything may take."""


class Managers:
    """Starts managers whose name server is `names`; all end with the block."""

    def __init__(self, folder: Path, names: str) -> None:
        self.folder = folder
        self.master_address = f"127.0.0.1:{find_free_port()}"
        self._names = names
        self._processes: list[subprocess.Popen[str]] = []
        self._said: dict[int, list[str]] = {}
        self._readers: list[threading.Thread] = []

    def start(
        self, *words: str, command: tuple[str, ...] = ("rtcd",), environment: Mapping[str, str] | None = None
    ) -> subprocess.Popen[str]:
        """A manager with these options over those that keep it to this test; it runs when this returns."""
        return self.start_command(self.command(*words, command=command), environment)

    def start_command(
        self, command: list[str], environment: Mapping[str, str] | None = None
    ) -> subprocess.Popen[str]:
        """The same for a whole command line."""
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=self.folder,
            env={**ENVIRONMENT, **(environment or {})},
        )
        self._processes.append(process)
        self._said[process.pid] = []
        reader = threading.Thread(target=self._read, args=(process,))
        reader.start()
        self._readers.append(reader)
        self.wait_for(process, " is up")
        return process

    def command(self, *words: str, command: tuple[str, ...] = ("rtcd",)) -> list[str]:
        """The command line of such a manager."""
        settings = {
            "corba.nameservers": self._names,
            "corba.endpoints": "127.0.0.1:",
            "corba.master_manager": self.master_address,
            "manager.modules.load_path": str(self.folder),
            "os.hostname": "robot",
            "logger.file_name": "stderr",
            "manager.shutdown_auto": "NO",
        }
        if "-p" in words:
            place = words.index("-p")
            settings["corba.endpoints"] = f"127.0.0.1:{words[place + 1]}"
            words = (*words[:place], *words[place + 2 :])
        options = [word for key, text in settings.items() for word in ("-o", f"{key}:{text}")]
        return [sys.executable, "-m", "muros", *command, *options, *words]

    def said(self, process: subprocess.Popen[str]) -> str:
        """What a manager has written so far."""
        return "".join(self._said[process.pid])

    def wait_for(self, process: subprocess.Popen[str], words: str) -> None:
        """Wait until a manager has written `words`."""

        def there() -> bool:
            if words not in self.said(process) and process.poll() is not None:
                raise AssertionError(
                    f"it has ended with {process.returncode} and said:\n{self.said(process)}"
                )
            return words in self.said(process)

        wait_until(there)

    def __enter__(self) -> Managers:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        for reader in self._readers:
            reader.join(PATIENCE)

    def _read(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout as lines:
            for line in lines:
                self._said[process.pid].append(line)


@contextmanager
def world_beside(names: str) -> Iterator[CorbaWorld]:
    """This process's place beside managers whose name server is `names`."""
    world = CorbaWorld(Properties({"corba.nameservers": names}, defaults=DEFAULTS), Reporter())
    try:
        yield world
    finally:
        world.close()


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait until `condition` holds; AssertionError where it takes longer than PATIENCE."""
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise AssertionError("it did not happen in time")
        time.sleep(0.02)
