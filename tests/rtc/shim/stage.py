"""Old components as processes, with a name server of their own, driven as a tool drives them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import RTC
from OpenRTM_aist import CORBA_RTCUtil, CorbaNaming, Properties
from tests.rtc.conftest import find_free_port

COMPONENTS = Path(__file__).parent / "components"
PATIENCE = 20.0
"""Seconds that anything may take."""


class Program:
    """A process, and what it has printed."""

    def __init__(self, command: Sequence[str], folder: Path, environment: dict[str, str]) -> None:
        self.lines: list[str] = []
        self.process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def said(self, words: str) -> list[str]:
        """Wait until it has printed a line with `words`; all such lines."""

        def there() -> list[str]:
            found = [line for line in list(self.lines) if words in line]
            if not found and self.process.poll() is not None:
                raise AssertionError(f"it ended with {self.process.returncode}: {self.lines}")
            return found

        lines: list[str] = wait_for(there, lambda: f"nobody said {words!r}, but {self.lines}")
        return lines

    def type(self, line: str) -> None:
        """Type a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def over(self) -> int:
        """Wait until it has ended by itself; its status."""
        status = self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        return status

    def end(self) -> int:
        """End it by SIGTERM; its status. One that does not end has to say where its threads stand."""
        if self.process.stdin is not None and not self.process.stdin.closed:
            self.process.stdin.close()
        if self.process.poll() is None:
            self.process.terminate()
        try:
            return self.over()
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGABRT)
            self.over()
            raise AssertionError("\n".join(("it does not end, and says:", *self.lines))) from None

    def _read(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                self.lines.append(line.rstrip("\n"))


class Stage:
    """Starts programs that meet at one name server, and finds their components."""

    def __init__(self, orb: Any, names: str, folder: Path) -> None:
        self.names = names
        self.folder = folder
        self._naming = CorbaNaming(orb, names)
        self._programs: list[Program] = []
        (folder / "rtc.conf").write_text(
            f"corba.nameservers: {names}\ncorba.endpoints: 127.0.0.1:\nnaming.formats: %n.rtc\n"
            f"corba.master_manager: 127.0.0.1:{find_free_port()}\n"
            "logger.enable: NO\nexec_cxt.periodic.rate: 100\n"
        )

    def python(self, name: str, *words: str) -> Program:
        """Run a component's file, as `python NAME.py`."""
        return self._start([sys.executable, str(COMPONENTS / f"{name}.py"), *words])

    def script(self, text: str) -> Program:
        """Run a program's text."""
        return self._start([sys.executable, "-c", text])

    def muros(self, *words: str) -> Program:
        """Run `muros ...`."""
        return self._start([sys.executable, "-m", "muros", *words])

    def tool(self, name: str, *words: str, typed: str = "") -> subprocess.CompletedProcess[str]:
        """Run a tool of rtshell; `@` in words is the name server's path."""
        command = [
            str(Path(sys.executable).parent / name),
            *(w.replace("@", f"/{self.names}/") for w in words),
        ]
        return subprocess.run(
            command,
            cwd=self.folder,
            env=self._environment(),
            input=typed,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )

    def component(self, name: str) -> Any:
        """The component of an instance name, once it is there."""

        def look() -> Any:
            try:
                return self._naming.resolve(f"{name}.rtc")._narrow(RTC.RTObject)
            except Exception:
                return None

        return wait_for(
            look, lambda: f"{name} is not bound; programs said {[p.lines for p in self._programs]}"
        )

    def connect(self, one: str, other: str, **properties: str) -> Any:
        """Join two ports, `Foo0.out` and `Bar0.in`; the return code."""
        ports = [
            CORBA_RTCUtil.get_port_by_name(self.component(owner), port)
            for owner, port in (one.split("."), other.split("."))
        ]
        prop = Properties(defaults_map={key.replace("__", "."): text for key, text in properties.items()})
        return CORBA_RTCUtil.connect(properties.get("name", "wire"), prop, *ports)

    def activate(self, *names: str) -> None:
        """Activate components."""
        for name in names:
            code = CORBA_RTCUtil.activate(self.component(name))
            assert code == RTC.RTC_OK, f"{name}: {code}"

    def close(self) -> None:
        """End all programs."""
        for program in self._programs:
            program.end()

    def _start(self, command: Sequence[str]) -> Program:
        program = Program(command, self.folder, self._environment())
        self._programs.append(program)
        return program

    def _environment(self) -> dict[str, str]:
        return {
            **os.environ,
            "OMNIORB_CONFIG": os.devnull,
            "PYTHONFAULTHANDLER": "1",
            "PYTHONUNBUFFERED": "1",
            "RTCTREE_NAMESERVERS": self.names,
            "XDG_CACHE_HOME": str(self.folder / "cache"),
        }


def wait_for(look: Callable[[], Any], otherwise: Callable[[], str]) -> Any:
    """What `look` finds, once it finds something."""
    end = time.monotonic() + PATIENCE
    while not (found := look()):
        if time.monotonic() > end:
            raise AssertionError(otherwise())
        time.sleep(0.02)
    return found
