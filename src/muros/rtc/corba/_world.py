"""The world that a manager lives in, over CORBA: the process's ORB, its names, other managers and components."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from threading import Thread
from typing import TYPE_CHECKING, Any, Final

from muros.rtc.codes import PeerLostError, RtcError
from muros.rtc.corba._conversion import to_nv_list
from muros.rtc.corba._lost import QUICK_SECONDS, asked_again, peer, quick_answer
from muros.rtc.corba._manager import ManagerServant, PeerManager
from muros.rtc.corba._naming import NameServer
from muros.rtc.corba._orb import Orb, current_orb, start_orb
from muros.rtc.corba._organization import ForeignMember
from muros.rtc.corba._registration import Registration
from muros.rtc.corba._setup import set_up
from muros.rtc.corba._stubs import RTC, RTM
from muros.rtc.properties import Properties, split_address
from muros.rtc.reports import Reporter

if TYPE_CHECKING:
    from muros.rtc.component import Component
    from muros.rtc.manager import Manager
    from muros.rtc.ports import Port
    from muros.rtc.profiles import PeerPort

__all__ = ["CorbaWorld"]

DEFAULT_KEY: Final = "manager"
"""The object key of a manager whose address has none."""

MASTER_PORT: Final = 2810
"""TCP port of a master manager whose address has none."""

ANYWHERE: Final = "*/"
"""Before a component's name: in any context of a name server."""

MANAGER_TIMEOUT: Final = 2.0
"""Seconds within which a manager says that it is one."""


class CorbaWorld:
    """The ORB of the process, and what is reached through it: `muros.rtc.manager`'s `World`."""

    def __init__(self, settings: Properties, reporter: Reporter) -> None:
        self._owns_orb = not _runs()
        self.orb: Final[Orb] = start_orb(
            _endpoints(settings),
            arguments=["-ORBsupportPerThreadTimeOut", "1", *settings.get("corba.args", "").split()],
        )
        servers = settings.words("corba.nameservers") if settings.flag("naming.enable") else ()
        self._registration: Final = Registration(self.orb, servers, reporter)
        self._objects: Final = set_up(self.orb, report=reporter.take)
        self._manager: ManagerServant | None = None
        self._looking: Thread | None = None

    def properties(self) -> Mapping[str, str]:
        return {"corba.id": "omniORB"}

    def close(self) -> None:
        self._registration.close()
        if self._looking is not None:
            self._looking.join(2 * QUICK_SECONDS)
        if self._owns_orb:
            self.orb.shutdown()

    # What others can call

    def offer_manager(self, manager: Manager, key: str) -> Any:
        self._manager = ManagerServant(manager)
        return self.orb.activate(self._manager, key)._narrow(RTM.Manager)

    def withdraw_manager(self) -> None:
        if self._manager is not None:
            self.orb.deactivate(self._manager)
            self._manager = None

    def offer_component(self, component: Component, key: str) -> Any:
        return self._objects.offer(component, key)

    def withdraw_component(self, component: Component) -> None:
        self._objects.withdraw(component)

    def port_reference(self, port: Port) -> Any:
        return self._objects.port(port)

    # Names

    def bind(self, names: Iterable[str], reference: Any) -> None:
        self._registration.bind(names, reference)

    def unbind(self, names: Iterable[str]) -> None:
        self._registration.unbind(names)

    def update_names(self) -> None:
        self._registration.update()

    def part_with_the_gone(self) -> None:
        """In a thread of its own, for those asked may be silent; while it asks, no other one starts."""
        if self._looking is not None and self._looking.is_alive():
            return
        if self._objects.belonging_elsewhere():
            self._looking = Thread(target=self._objects.part_with_the_gone, name="rtc-gone", daemon=True)
            self._looking.start()

    def is_free(self, name: str) -> bool:
        return self._registration.is_free(name)

    def instance_names(self) -> set[str]:
        return self._registration.instance_names()

    def ports_in(self, context: str, kind: str) -> list[tuple[str, PeerPort]]:
        found = self._registration.objects_in(context, kind)
        return [(name, self._objects.port_behind(one)) for name, one in found]

    # Other managers and components

    def manager_at(self, address: str) -> PeerManager:
        reference = self.orb.to_reference(_manager_location(address))
        with peer(f"the manager at {address}"), quick_answer(MANAGER_TIMEOUT):
            manager = reference._narrow(RTM.Manager) if reference is not None else None
        if manager is None:
            raise RtcError(f"{address} is no manager")
        return PeerManager(manager)

    def member(self, name: str) -> ForeignMember | None:
        try:
            return ForeignMember(self._component_at(f"rtcname://*/{name}"), self._objects)
        except RtcError:
            return None

    def connect(
        self, ports: Sequence[str], local: Mapping[str, Any], name: str, properties: Mapping[str, str]
    ) -> None:
        references = []
        for address in ports:
            component, _, port = address.rpartition(".")
            owner = local[component] if component in local else self._component_at(component)
            references.append(_port(owner, port, address))
        profile = RTC.ConnectorProfile(name, "", references, to_nv_list(properties))
        with peer(ports[0]):
            code, _ = references[0].connect(profile)
        if code != RTC.RTC_OK:
            raise RtcError(f"{name} cannot be connected: {code}")

    def activate_at(self, address: str) -> None:
        component = self._component_at(address)
        with peer(address):
            for context in component.get_owned_contexts():
                code = context.activate_component(component)
                if code != RTC.RTC_OK:
                    raise RtcError(f"{address} cannot be activated: {code}")

    def components_at(self, address: str) -> list[Any]:
        kind, _, rest = address.partition("://")
        place, _, path = rest.partition("/")
        asked: list[Callable[[], Iterable[Any]]]
        if kind == "rtcloc":
            asked = [lambda: self.manager_at(place).components_by_name(path)]
        elif kind == "rtcname":
            servers = self._registration.servers if place in ("*", "") else (NameServer(self.orb, place),)
            asked = [partial(_named, server, path) for server in servers]
        else:
            raise RtcError(f"{address}: write rtcname://HOST/NAME or rtcloc://HOST:PORT/CATEGORY/NAME")
        found: list[Any] = []
        failure: RtcError | None = None
        for ask in asked:
            try:
                references = list(ask())
            except RtcError as error:
                failure = error
                continue
            for one in references:
                try:
                    component = _component(one, address)
                except RtcError as error:
                    failure = error
                    continue
                if component is not None:
                    found.append(component)
        if not found:
            raise failure or RtcError(f"{address}: there is no such component")
        return found

    def _component_at(self, address: str) -> Any:
        return self.components_at(address)[0]


def _named(server: NameServer, path: str) -> Iterator[Any]:
    """What has the path, without `.rtc`, at a server; else, and for `*/NAME`, everything of that name anywhere."""
    plain = path.removeprefix(ANYWHERE).removesuffix(".rtc")
    if not path.startswith(ANYWHERE):
        reference = server.resolve(f"{plain}.rtc")
        if reference is not None:
            yield reference
            return
    if "/" in plain:
        return
    for place, binding in server.walk():
        if (binding.name, binding.kind) == (plain, "rtc"):
            reference = server.resolve(place)
            if reference is not None:
                yield reference


def _component(reference: Any, address: str) -> Any:
    """The component behind a reference; None where it is none. PeerLostError if it does not answer, or has ended."""
    with peer(address):
        component = asked_again(lambda: reference._narrow(RTC.RTObject))
        if component is not None and asked_again(component._non_existent):
            raise PeerLostError(f"{address} has ended")
        return component


def _port(component: Any, name: str, address: str) -> Any:
    with peer(address):
        for port in component.get_ports():
            if port.get_port_profile().name.rpartition(".")[2] == name:
                return port
    raise RtcError(f"{address}: the component has no port {name!r}")


def _manager_location(address: str) -> str:
    """The corbaloc of `HOST[:PORT][/KEY]`."""
    if address.startswith(("corbaloc:", "IOR:")):
        return address
    place, _, key = address.strip().partition("/")
    host, port = split_address(place, str(MASTER_PORT))
    return f"corbaloc:iiop:{host}:{port}/{key or DEFAULT_KEY}"


def _endpoints(settings: Properties) -> str:
    """`corba.endpoints`; a master is reached at the port of `corba.master_manager`, too."""
    endpoints = settings.get("corba.endpoints", "all")
    if not settings.flag("manager.is_master"):
        return endpoints
    _, port = split_address(settings["corba.master_manager"].partition("/")[0], str(MASTER_PORT))
    first = endpoints.split(",")[0].strip()
    own = "" if first in ("", "all") else split_address(first)[0]
    at_master = f"{own}:{port}"
    if at_master in [part.strip() for part in endpoints.split(",")]:
        return endpoints
    return at_master if first in ("", "all") else f"{at_master}, {endpoints}"


def _runs() -> bool:
    """Whether somebody has started the process's ORB, who then ends it, too."""
    try:
        current_orb()
    except RtcError:
        return False
    return True
