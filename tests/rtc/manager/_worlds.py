"""A world in memory for managers of one test: name servers, other managers, no ORB."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from muros.rtc.codes import PeerLostError, ReturnCode
from muros.rtc.component import Component
from muros.rtc.manager import Manager, Settings
from muros.rtc.manager._defaults import DEFAULTS
from muros.rtc.manager._world import RemoteManager
from muros.rtc.ports import Port
from muros.rtc.profiles import PeerPort
from muros.rtc.properties import Properties


class Names:
    """A name server that several worlds share."""

    def __init__(self) -> None:
        self.bound: dict[str, object] = {}


class MemoryWorld:
    """What a manager reaches: `managers` by address, names at `server`."""

    def __init__(self, server: Names | None = None, managers: dict[str, FakeManager] | None = None) -> None:
        self.server = server or Names()
        self.managers = managers if managers is not None else {}
        self.offered: dict[str, Component] = {}
        self.connected: list[tuple[Sequence[str], Mapping[str, str]]] = []
        self.activated: list[str] = []
        self.closed = False

    def properties(self) -> Mapping[str, str]:
        return {"corba.endpoints": "127.0.0.1:1"}

    def offer_component(self, component: Component, key: str) -> object:
        self.offered[key] = component
        return ("reference", component)

    def withdraw_component(self, component: Component) -> None:
        self.offered = {key: one for key, one in self.offered.items() if one is not component}

    def offer_manager(self, manager: Manager, key: str) -> object:
        return ("manager", manager)

    def withdraw_manager(self) -> None: ...

    def bind(self, names: Iterable[str], reference: object) -> None:
        for name in names:
            self.server.bound.setdefault(name, reference)

    def unbind(self, names: Iterable[str]) -> None:
        for name in names:
            self.server.bound.pop(name, None)

    def update_names(self) -> None: ...

    def part_with_the_gone(self) -> None: ...

    def is_free(self, name: str) -> bool:
        return name not in self.server.bound

    def instance_names(self) -> set[str]:
        return {name.rpartition("/")[2].removesuffix(".rtc") for name in self.server.bound}

    def manager_at(self, address: str) -> RemoteManager:
        if address not in self.managers:
            raise PeerLostError(f"no manager at {address}")
        return self.managers[address]

    def port_reference(self, port: Port) -> object:
        return port

    def ports_in(self, context: str, kind: str) -> Sequence[tuple[str, PeerPort]]:
        return [
            (name.rpartition("/")[2].removesuffix(f".{kind}"), port)
            for name, port in self.server.bound.items()
            if name.startswith(f"{context}/") and name.endswith(f".{kind}") and isinstance(port, Port)
        ]

    def member(self, name: str) -> None: ...

    def components_at(self, address: str) -> Sequence[object]:
        return ()

    def connect(
        self, ports: Sequence[str], local: Mapping[str, object], name: str, properties: Mapping[str, str]
    ) -> None:
        self.connected.append((tuple(ports), properties))

    def activate_at(self, address: str) -> None:
        self.activated.append(address)

    def close(self) -> None:
        self.closed = True


class FakeManager:
    """A manager of another process, as far as one asks it."""

    def __init__(self, name: str = "other", *, makes: bool = True) -> None:
        self._name = name
        self.makes = makes
        self.gone = False
        self.made: list[str] = []
        self.names: set[str] = set()
        self.known_slaves: list[object] = []
        self.known_masters: list[object] = []

    @property
    def reference(self) -> object:
        return self

    def _answer(self) -> None:
        if self.gone:
            raise PeerLostError(f"{self._name} does not answer")

    def name(self) -> str:
        self._answer()
        return self._name

    def language(self) -> str:
        self._answer()
        return "Python"

    def instance_names(self) -> set[str]:
        self._answer()
        return self.names

    def create_component(self, request: str) -> object | None:
        self._answer()
        if not self.makes:
            return None
        self.made.append(request)
        return ("made", request)

    def delete_component(self, name: str) -> ReturnCode:
        self._answer()
        if name not in self.names:
            return ReturnCode.BAD_PARAMETER
        self.names.remove(name)
        return ReturnCode.RTC_OK

    def listed(self, what: str) -> Sequence[Any]:
        self._answer()
        return [f"{what} of {self._name}"]

    def components_by_name(self, name: str) -> Sequence[object]:
        self._answer()
        return [f"{name} of {self._name}"] if name.rpartition("/")[2] in self.names else []

    def add_slave(self, slave: object) -> ReturnCode:
        self._answer()
        self.known_slaves.append(slave)
        return ReturnCode.RTC_OK

    def remove_slave(self, slave: object) -> ReturnCode:
        self._answer()
        if slave not in self.known_slaves:
            return ReturnCode.BAD_PARAMETER
        self.known_slaves.remove(slave)
        return ReturnCode.RTC_OK

    def add_master(self, master: object) -> ReturnCode:
        self._answer()
        self.known_masters.append(master)
        return ReturnCode.RTC_OK

    def remove_master(self, master: object) -> ReturnCode:
        self._answer()
        if master not in self.known_masters:
            return ReturnCode.BAD_PARAMETER
        self.known_masters.remove(master)
        return ReturnCode.RTC_OK

    def knows_slave(self, slave: object) -> bool:
        self._answer()
        return slave in self.known_slaves

    def shutdown(self) -> ReturnCode:
        self._answer()
        self.gone = True
        return ReturnCode.RTC_OK


def manager_in(folder: Path, world: MemoryWorld | None = None, /, **texts: str) -> Manager:
    """A manager whose settings are the defaults and `texts` (with `__` for dots); it writes no log."""
    properties = Properties(defaults=DEFAULTS)
    properties.update(
        {"logger.enable": "NO", "os.hostname": "robot", "manager.modules.load_path": str(folder)}
    )
    properties.update({key.replace("__", "."): text for key, text in texts.items()})
    return Manager(Settings(properties, None), world=lambda manager: world or MemoryWorld())
