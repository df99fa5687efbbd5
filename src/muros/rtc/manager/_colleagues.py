"""Master and slave managers: who they are, how a slave finds its master, how a master gets a slave that it lacks.

A master makes no components itself. It asks a slave, and starts one where there is none that may do it.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from muros.rtc.codes import PeerLostError, ReturnCode, RtcError
from muros.rtc.manager._world import RemoteManager, World
from muros.rtc.profiles import Reference
from muros.rtc.properties import Properties, split_address
from muros.rtc.reports import Reporter

__all__ = ["Colleagues"]

START_TIME: Final = 10.0
"""Seconds that a slave has to report to the master that started it."""

OWN_KEYS: Final = ("manager.", "corba.", "os.", "config_file")
"""Beginnings of the settings that a slave does not share with the master that starts it."""

LOOK_TIME: Final = 0.2
"""Seconds between two looks at whether a slave that was started still runs."""

END_TIME: Final = 5.0
"""Seconds that slaves started here have to end before they are killed."""

LIMIT: Final = 1000
"""Managers that are known at most."""


class Colleagues:
    """The other managers that one knows. Any thread may call; no lock is held over a call to another process."""

    def __init__(self, world: World, settings: Properties, reporter: Reporter) -> None:
        self._world: Final = world
        self._settings: Final = settings
        self._reporter: Final = reporter
        self._own: Reference | None = None
        self._masters: list[RemoteManager] = []
        self._slaves: list[RemoteManager] = []
        self._started: list[subprocess.Popen[bytes]] = []
        self._own_slaves: set[RemoteManager] = set()
        self._changed = threading.Condition()
        self._closed = False

    @property
    def masters(self) -> tuple[RemoteManager, ...]:
        """Those that this one obeys."""
        return tuple(self._masters)

    @property
    def slaves(self) -> tuple[RemoteManager, ...]:
        """Those that obey this one."""
        return tuple(self._slaves)

    def begin(self, own: Reference) -> None:
        """`own` is how others are told of this manager."""
        self._own = own

    def find_master(self) -> None:
        """Report to the master of `corba.master_manager` if it is there and does not know this one. Raises nothing."""
        if self._own is None or self._closed or self._settings.flag("manager.is_master"):
            return
        for known in self.masters:
            try:
                if known.knows_slave(self._own):
                    return
            except RtcError:
                pass
            self._drop(self._masters, known)
        try:
            master = self._world.manager_at(self._settings["corba.master_manager"])
            master.add_slave(self._own)
            self.add_master(master)
        except RtcError:
            pass  # most managers have no master

    def add_master(self, master: RemoteManager) -> ReturnCode:
        """Obey `master` from now on."""
        return self._add(self._masters, master)

    def add_slave(self, slave: RemoteManager) -> ReturnCode:
        """`slave` obeys from now on."""
        return self._add(self._slaves, slave)

    def remove_master(self, master: RemoteManager) -> ReturnCode:
        """Forget it. BAD_PARAMETER where it is not known."""
        return self._drop(self._masters, master)

    def remove_slave(self, slave: RemoteManager) -> ReturnCode:
        """Forget it. BAD_PARAMETER where it is not known."""
        return self._drop(self._slaves, slave)

    def instance_names(self) -> set[str]:
        """The names of all components of this node: of the master and all its slaves, or of one's own slaves."""
        names = set[str]()
        self.find_master()
        for other in self.masters or self.slaves:
            names |= self.ask(other, lambda one: one.instance_names(), set())
        return names

    def gather(self, what: str) -> list[Any]:
        """What the slaves list, one after the other."""
        found: list[Any] = []
        for slave in self.slaves:
            found += self.ask(slave, lambda one: one.listed(what), ())
        return found

    def components_by_name(self, name: str) -> list[Reference]:
        """The slaves' components that fit."""
        found: list[Reference] = []
        for slave in self.slaves:
            found += self.ask(slave, lambda one: one.components_by_name(name), ())
        return found

    def delete(self, name: str) -> ReturnCode:
        """Let the slave that has a component end it. BAD_PARAMETER where none has it."""
        for slave in self.slaves:
            code: ReturnCode = self.ask(
                slave, lambda one: one.delete_component(name), ReturnCode.BAD_PARAMETER
            )
            if code is not ReturnCode.BAD_PARAMETER:
                return code
        return ReturnCode.BAD_PARAMETER

    def create(self, request: str, *, name: str = "", language: str = "Python") -> Reference:
        """Let a slave make a component: the one called `name`, else any that can. One is started if need be.

        Slaves that came by themselves (any program with components does) may lack its module, or have enough to do:
        one that is started here counts. RtcError where none could.
        """
        fitting = [
            slave
            for slave in self.slaves
            if (
                self.ask(slave, lambda one: one.name(), "") == name if name else self._speaks(slave, language)
            )
        ]
        for slave in fitting:
            made: Reference | None = self.ask(slave, lambda one: one.create_component(request), None)
            if made is not None:
                return made
        if fitting and (name or not self._own_slaves.isdisjoint(fitting)):
            raise RtcError(f"none of the {len(fitting)} slave managers could make {request}; see their logs")
        slave = self.start(name, language)
        self._own_slaves.add(slave)
        made = slave.create_component(request)
        if made is None:
            raise RtcError(f"the slave manager could not make {request}; see its log")
        return made

    def ask_master(self, request: str) -> Reference:
        """Let the master see to a component of another manager. RtcError where there is none, or it could not."""
        self.find_master()
        for master in self.masters:
            made: Reference | None = self.ask(master, lambda one: one.create_component(request), None)
            if made is not None:
                return made
        told = (
            "the master manager could not make it; see its log"
            if self.masters
            else "there is no master manager"
        )
        raise RtcError(f"{request}: {told}")

    def start(self, name: str, language: str) -> RemoteManager:
        """Start a slave process and wait until it has reported. RtcError where it does not."""
        process = subprocess.Popen(
            self._command(language, name), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )
        wanted = name or f"manager_{process.pid}"
        asked = set[RemoteManager]()
        deadline = time.monotonic() + START_TIME
        with self._changed:
            self._started.append(process)
        while time.monotonic() < deadline and process.poll() is None and not self._closed:
            for slave in self.slaves:
                if slave not in asked and self.ask(slave, lambda one: one.name(), "") == wanted:
                    return slave
                asked.add(slave)
            with self._changed:
                self._changed.wait_for(lambda: self._closed or set(self._slaves) - asked, LOOK_TIME)
        raise RtcError(
            f"a slave manager was started (pid {process.pid}) and did not report within {START_TIME:g} s; "
            "see its log, and whether corba.master_manager leads here"
        )

    def close(self) -> None:
        """Take leave of masters and slaves; slaves started here end."""
        with self._changed:
            self._closed = True
            masters, slaves, started = list(self._masters), list(self._slaves), list(self._started)
            self._masters.clear()
            self._slaves.clear()
            self._changed.notify_all()
        own = self._own
        if own is not None:
            for master in masters:
                self.ask(master, lambda one: one.remove_slave(own), None)
            for slave in slaves:
                self.ask(slave, lambda one: one.remove_master(own), None)
        for process in started:
            if process.poll() is None:
                process.terminate()
        deadline = time.monotonic() + END_TIME
        for process in started:
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def ask(self, other: RemoteManager, question: Callable[[RemoteManager], Any], otherwise: Any) -> Any:
        """The answer of another manager; `otherwise` where there is none. One that has gone is forgotten."""
        try:
            return question(other)
        except PeerLostError:
            self._drop(self._slaves, other)
            self._drop(self._masters, other)
        except RtcError as error:
            self._reporter.report(
                "manager-refused",
                who="manager",
                what="another manager did not do what it was asked for",
                why=str(error),
                remedy="See its log.",
            )
        return otherwise

    def _speaks(self, slave: RemoteManager, language: str) -> bool:
        return not language or self.ask(slave, lambda one: one.language(), "") == language

    def _add(self, where: list[RemoteManager], other: RemoteManager) -> ReturnCode:
        with self._changed:
            if other in where:
                return ReturnCode.RTC_OK
            if len(where) >= LIMIT:
                return ReturnCode.OUT_OF_RESOURCES
            where.append(other)
            self._changed.notify_all()
        return ReturnCode.RTC_OK

    def _drop(self, where: list[RemoteManager], other: RemoteManager) -> ReturnCode:
        with self._changed:
            if other not in where:
                return ReturnCode.BAD_PARAMETER
            where.remove(other)
            self._changed.notify_all()
        return ReturnCode.RTC_OK

    def _command(self, language: str, name: str) -> Sequence[str]:
        settings = self._settings
        command = settings.get(f"manager.modules.{language}.manager_cmd", "")
        words = shlex.split(command)
        if not words:
            raise RtcError(
                f"no command starts a manager for {language}: set manager.modules.{language}.manager_cmd"
            )
        if words[0] == "muros" or (words[0] == "rtcd2_python" and shutil.which(words[0]) is None):
            words = [sys.executable, "-m", "muros", *(words[1:] or ["rtcd"])]
        passed = {
            "manager.is_master": "NO",
            "manager.corba_servant": "YES",
            "corba.master_manager": settings["corba.master_manager"],
            "corba.nameservers": settings["corba.nameservers"],
            "manager.modules.load_path": settings["manager.modules.load_path"],
        }
        if name:
            passed["manager.name"] = passed["manager.instance_name"] = name
        else:
            passed["manager.instance_name"] = "manager_%p"
        if settings.get("config_file"):
            words += ["-f", settings["config_file"]]
        # Where the master stays on one address, so does its slave, on a port of its own.
        endpoints = settings.get("corba.endpoints", "all").split(",")[0].strip()
        if endpoints not in ("", "all"):
            passed["corba.endpoints"] = f"{split_address(endpoints)[0]}:"
        for key in settings:
            if not key.startswith(OWN_KEYS):
                passed.setdefault(key, settings[key])
        return [*words, *(word for key, text in passed.items() for word in ("-o", f"{key}:{text}"))]
