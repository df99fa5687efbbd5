"""Managers over CORBA: RTM::Manager as a servant, managers of other processes, the world that a manager lives in."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

import omniORB
from omniORB import any

from muros.rtc.codes import PeerLostError, ReturnCode, RtcError
from muros.rtc.corba._conversion import to_nv_list, to_return_code
from muros.rtc.corba._lost import peer
from muros.rtc.corba._naming import Names, NameServer, _quoted, is_same, lives, split_path
from muros.rtc.corba._orb import Orb, current_orb, start_orb
from muros.rtc.corba._organization import ForeignMember
from muros.rtc.corba._setup import set_up
from muros.rtc.corba._stubs import RTC, RTM, RTM__POA
from muros.rtc.properties import Properties
from muros.rtc.reports import Reporter

if TYPE_CHECKING:
    from muros.rtc.component import Component
    from muros.rtc.manager import Manager
    from muros.rtc.ports import Port
    from muros.rtc.profiles import PeerPort

__all__ = ["CorbaWorld", "ManagerServant", "PeerManager"]

DEFAULT_KEY: Final = "manager"
"""The object key of a manager whose address has none."""

MASTER_PORT: Final = 2810
"""TCP port of a master manager whose address has none."""

SETTINGS: Final = 10_000
"""Settings that a manager may have before others can add no more."""

SETTING_LENGTH: Final = 65536
"""Characters that others may set at once."""

NAME_TIMEOUT: Final = 2.0
"""Seconds that one question to a name server may take."""

AWAY: Final = 5.0
"""Seconds for which a name server that did not answer is not asked whether names are free."""


class ManagerServant(RTM__POA.Manager):  # type: ignore[misc]
    """RTM::Manager. No operation raises: what cannot be done is a return code, nil or an empty list, and a finding."""

    def __init__(self, manager: Manager, world: CorbaWorld) -> None:
        self._manager = manager
        self._world = world

    # Modules

    def load_module(self, pathname: str, initfunc: str) -> Any:
        return self._code(f"load_module({pathname})", lambda: self._manager.load_module(pathname, initfunc))

    def unload_module(self, pathname: str) -> Any:
        return self._code(f"unload_module({pathname})", lambda: self._manager.unload_module(pathname))

    def get_loadable_modules(self) -> list[Any]:
        own = [_module(spec) for spec in self._manager.modules.loadable()]
        return own + self._manager.colleagues.gather("get_loadable_modules")

    def get_loaded_modules(self) -> list[Any]:
        own = [_module(module.properties()) for module in self._manager.modules.loaded]
        return own + self._manager.colleagues.gather("get_loaded_modules")

    def get_factory_profiles(self) -> list[Any]:
        own = [_module(factory.properties) for factory in self._manager.factories.all]
        return own + self._manager.colleagues.gather("get_factory_profiles")

    # Components

    def create_component(self, module_name: str) -> Any:
        made: list[Any] = []
        self._code(f"create_component({module_name})", lambda: made.append(self._manager.create(module_name)))
        if not made:
            return None
        reference = made[0]
        from muros.rtc.component import Component

        return self._manager.reference_of(reference) if isinstance(reference, Component) else reference

    def delete_component(self, instance_name: str) -> Any:
        return to_return_code(self._manager.delete_component(instance_name))

    def get_components(self) -> list[Any]:
        own = [self._manager.reference_of(component) for component in self._manager.components]
        return own + self._manager.colleagues.gather("get_components")

    def get_component_profiles(self) -> list[Any]:
        own = [
            self._manager.reference_of(component).get_component_profile()  # type: ignore[attr-defined]
            for component in self._manager.components
        ]
        return own + self._manager.colleagues.gather("get_component_profiles")

    def get_components_by_name(self, name: str) -> list[Any]:
        own = [self._manager.reference_of(component) for component in self._manager.components_by_name(name)]
        return own + self._manager.colleagues.components_by_name(name)

    # The manager itself

    def get_profile(self) -> Any:
        settings = self._manager.configuration()
        own = {key.removeprefix("manager."): v for key, v in settings.items() if key.startswith("manager.")}
        return RTM.ManagerProfile(to_nv_list(own))

    def get_configuration(self) -> list[Any]:
        return to_nv_list(self._manager.configuration())

    def set_configuration(self, name: str, value: str) -> Any:
        settings = self._manager.settings
        if len(name) + len(value) > SETTING_LENGTH or (name not in settings and len(settings) >= SETTINGS):
            return RTC.OUT_OF_RESOURCES
        settings[name] = value
        return RTC.RTC_OK

    def is_master(self) -> bool:
        return self._manager.is_master

    def get_master_managers(self) -> list[Any]:
        return [master.reference for master in self._manager.colleagues.masters]

    def add_master_manager(self, mgr: Any) -> Any:
        return self._about(mgr, self._manager.colleagues.add_master)

    def remove_master_manager(self, mgr: Any) -> Any:
        return self._about(mgr, self._manager.colleagues.remove_master)

    def get_slave_managers(self) -> list[Any]:
        return [slave.reference for slave in self._manager.colleagues.slaves]

    def add_slave_manager(self, mgr: Any) -> Any:
        return self._about(mgr, self._manager.colleagues.add_slave)

    def remove_slave_manager(self, mgr: Any) -> Any:
        return self._about(mgr, self._manager.colleagues.remove_slave)

    def fork(self) -> Any:
        """A process with threads cannot be doubled; whoever wants a second manager starts one."""
        return RTC.UNSUPPORTED

    def shutdown(self) -> Any:
        self._manager.shutdown()
        return RTC.RTC_OK

    def restart(self) -> Any:
        return RTC.UNSUPPORTED

    def get_service(self, name: str) -> Any:
        return None

    def _about(self, reference: Any, act: Callable[[PeerManager], ReturnCode]) -> Any:
        return to_return_code(ReturnCode.BAD_PARAMETER if reference is None else act(PeerManager(reference)))

    def _code(self, what: str, act: Callable[[], object]) -> Any:
        """Do what was asked for; what it could not is a finding, and RTC_ERROR."""
        try:
            act()
        except RtcError as error:
            self._manager.reporter.report(
                "manager-could-not",
                who=self._manager.name,
                what=f"{what} failed",
                why=str(error),
                subject=what,
            )
        except Exception as error:
            self._manager.reporter.failed("manager-could-not", self._manager.name, f"{what} failed", error)
        else:
            return RTC.RTC_OK
        return RTC.RTC_ERROR


class PeerManager:
    """A manager of another process: `muros.rtc.manager`'s `RemoteManager`."""

    def __init__(self, reference: Any) -> None:
        self._reference = reference

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PeerManager) and is_same(self._reference, other._reference)

    def __hash__(self) -> int:
        return hash(self._reference._hash(0x7FFFFFFF))

    @property
    def reference(self) -> Any:
        return self._reference

    def name(self) -> str:
        return self._property("instance_name")

    def language(self) -> str:
        return self._property("language")

    def instance_names(self) -> set[str]:
        with peer("the manager"):
            return {profile.instance_name for profile in self._reference.get_component_profiles()}

    def create_component(self, request: str) -> Any | None:
        with peer("the manager"):
            return self._reference.create_component(request)

    def delete_component(self, name: str) -> ReturnCode:
        return self._code("delete_component", name)

    def listed(self, what: str) -> Sequence[Any]:
        with peer("the manager"):
            found: Sequence[Any] = getattr(self._reference, what)()
            return found

    def components_by_name(self, name: str) -> Sequence[Any]:
        with peer("the manager"):
            found: Sequence[Any] = self._reference.get_components_by_name(name)
            return found

    def add_slave(self, slave: Any) -> ReturnCode:
        return self._code("add_slave_manager", slave)

    def remove_slave(self, slave: Any) -> ReturnCode:
        return self._code("remove_slave_manager", slave)

    def add_master(self, master: Any) -> ReturnCode:
        return self._code("add_master_manager", master)

    def remove_master(self, master: Any) -> ReturnCode:
        return self._code("remove_master_manager", master)

    def knows_slave(self, slave: Any) -> bool:
        return any_same(self.listed("get_slave_managers"), slave)

    def shutdown(self) -> ReturnCode:
        return self._code("shutdown")

    def _code(self, operation: str, *arguments: object) -> ReturnCode:
        with peer("the manager"):
            return ReturnCode(getattr(self._reference, operation)(*arguments)._v)

    def _property(self, name: str) -> str:
        with peer("the manager"):
            values = self._reference.get_profile().properties
        return next((str(any.from_any(one.value)) for one in values if one.name == name), "")


class CorbaWorld:
    """The ORB of the process, and what is reached through it: `muros.rtc.manager`'s `World`."""

    def __init__(self, settings: Properties, reporter: Reporter) -> None:
        self._reporter = reporter
        self._owns_orb = not _runs()
        self._orb: Final[Orb] = start_orb(
            _endpoints(settings),
            arguments=["-ORBsupportPerThreadTimeOut", "1", *settings.get("corba.args", "").split()],
        )
        servers = settings.words("corba.nameservers") if settings.flag("naming.enable") else ()
        self._names: Final = Names(self._orb, servers, report=reporter.take)
        self._rebind = settings.flag("naming.update.rebind")
        self._waiting: dict[str, Any] = {}
        """Names that living objects of others have."""
        self._asked: dict[str, float] = {}
        """When each name server did not answer last."""
        self._asking: list[threading.Thread] = []
        self._lock = threading.Lock()
        self._manager: ManagerServant | None = None
        self._objects: Final = set_up(self._orb, report=reporter.take)

    @property
    def orb(self) -> Orb:
        return self._orb

    def properties(self) -> Mapping[str, str]:
        return {"corba.id": "omniORB"}

    # What others can call

    def offer_manager(self, manager: Manager, key: str) -> Any:
        self._manager = ManagerServant(manager, self)
        return self._orb.activate(self._manager, key)._narrow(RTM.Manager)

    def withdraw_manager(self) -> None:
        if self._manager is not None:
            self._orb.deactivate(self._manager)
            self._manager = None

    def offer_component(self, component: Component, key: str) -> Any:
        return self._objects.offer(component, key)

    def withdraw_component(self, component: Component) -> None:
        self._objects.withdraw(component)

    # Names

    def bind(self, names: Iterable[str], reference: Any) -> None:
        for name in names:
            try:
                if self.is_free(name):
                    self._bind(name, reference)
                    continue
            except RtcError as error:
                self._tell_name(name, str(error), "Mend naming.formats")
                continue
            with self._lock:
                self._waiting[name] = reference
            self._tell_name(
                name,
                "another component that lives has this name",
                "Give it another instance_name, or end the other one: it is bound as soon as the name is free",
            )

    def _bind(self, name: str, reference: Any) -> None:
        """Bind a name; where a server is away this goes on in the background, so that nobody waits for it."""
        split_path(name)
        self._ask(lambda: self._names.bind(name, reference))

    def unbind(self, names: Iterable[str]) -> None:
        for name in names:
            with self._lock:
                waited = self._waiting.pop(name, None)
            if waited is None and name in self._names.bound:
                self._ask(lambda name=name: self._names.unbind(name))  # type: ignore[misc]

    def _ask(self, question: Callable[[], object]) -> None:
        """Ask all name servers; in the background where one of them is away, so that nobody waits for it."""

        def ask() -> None:
            begin = time.monotonic()
            with _patience(NAME_TIMEOUT):
                question()
            if time.monotonic() - begin > NAME_TIMEOUT:  # one has not answered; which one, only `Names` knows
                self._asked.update(
                    dict.fromkeys((one.address for one in self._names.servers), time.monotonic())
                )

        if len(self._answering()) == len(self._names.servers):
            ask()
            return
        thread = threading.Thread(target=ask, name="rtc-names", daemon=True)
        with self._lock:
            self._asking = [one for one in self._asking if one.is_alive()]
            self._asking.append(thread)
        thread.start()

    def update_names(self) -> None:
        self._names.update()
        with self._lock:
            waiting = dict(self._waiting)
        for name, reference in waiting.items():
            if self.is_free(name):
                self._names.bind(name, reference)
                with self._lock:
                    self._waiting.pop(name, None)

    def is_free(self, name: str) -> bool:
        with _patience(NAME_TIMEOUT):
            for server in self._answering():
                try:
                    bound = server.resolve(name)
                except PeerLostError:
                    self._asked[server.address] = time.monotonic()
                    continue
                if bound is not None and not is_same(bound, self._names.bound.get(name)) and lives(bound):
                    return False
        return True

    def instance_names(self) -> set[str]:
        names = set[str]()
        for server in self._answering():
            try:
                names |= {binding.name for _, binding in server.walk() if binding.kind == "rtc"}
            except PeerLostError:
                self._asked[server.address] = time.monotonic()
        return names

    def _answering(self) -> list[NameServer]:
        now = time.monotonic()
        return [
            server for server in self._names.servers if now - self._asked.get(server.address, -AWAY) >= AWAY
        ]

    def _tell_name(self, name: str, why: str, remedy: str) -> None:
        self._reporter.report(
            "name-not-bound",
            who="naming",
            what=f"{name} is not bound",
            why=why,
            remedy=remedy,
            subject=name,
        )

    # Other managers and components

    def manager_at(self, address: str) -> PeerManager:
        reference = self._orb.to_reference(_manager_location(address))
        with peer(f"the manager at {address}"):
            manager = reference._narrow(RTM.Manager) if reference is not None else None
        if manager is None:
            raise RtcError(f"{address} is no manager")
        return PeerManager(manager)

    def remote_manager(self, reference: Any) -> PeerManager:
        return PeerManager(reference)

    def is_same(self, one: Any, other: Any) -> bool:
        return is_same(one, other)

    def port_reference(self, port: Port) -> Any:
        return self._objects.port(port)

    def ports_in(self, context: str, kind: str) -> list[tuple[str, PeerPort]]:
        found: list[tuple[str, PeerPort]] = []
        with _patience(NAME_TIMEOUT):
            for server in self._answering():
                try:
                    names = [one.name for one in server.list(context) if one.kind == kind]
                    paths = [(name, f"{context}/{_quoted(name)}.{kind}") for name in names]
                    bound = [(name, server.resolve(path)) for name, path in paths]
                except PeerLostError:
                    self._asked[server.address] = time.monotonic()
                    continue
                except RtcError:
                    continue  # nobody has that topic there
                found += [(name, self._objects.port_behind(one)) for name, one in bound if lives(one)]
        return found

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

    def close(self) -> None:
        self._ask(self._names.unbind_all)
        end = time.monotonic() + 2 * NAME_TIMEOUT
        for thread in self._asking:
            thread.join(max(0.0, end - time.monotonic()))
        if self._owns_orb:
            self._orb.shutdown()

    def _component_at(self, address: str) -> Any:
        """`rtcname://HOST[:PORT]/PATH` (HOST may be `*`, the path's `.rtc` left out) or `rtcloc://HOST:PORT/CATEGORY/NAME`."""
        kind, _, rest = address.partition("://")
        place, _, path = rest.partition("/")
        if kind == "rtcloc":
            found = list(self.manager_at(place).components_by_name(path))
        elif kind == "rtcname":
            servers = self._names.servers if place in ("*", "") else (NameServer(self._orb, place),)
            found = [one for server in servers for one in _named(server, path)]
        else:
            raise RtcError(f"{address}: write rtcname://HOST/NAME or rtcloc://HOST:PORT/CATEGORY/NAME")
        for one in found:
            with peer(address):
                component = one._narrow(RTC.RTObject)
            if component is not None:
                return component
        raise RtcError(f"{address}: there is no such component")


@contextmanager
def _patience(seconds: float) -> Iterator[None]:
    """Calls of this thread to other processes take no longer than that, inside the block."""
    omniORB.setClientThreadCallTimeout(round(seconds * 1000))
    try:
        yield
    finally:
        omniORB.setClientThreadCallTimeout(0)


def any_same(references: Iterable[Any], one: Any) -> bool:
    """Whether one of `references` leads to the same object."""
    return bool([other for other in references if is_same(other, one)])


def _named(server: NameServer, path: str) -> list[Any]:
    """What has the path, without `.rtc`, at a server; else everything of that name anywhere."""
    reference = server.resolve(path if path.endswith(".rtc") else f"{path}.rtc")
    if reference is not None:
        return [reference]
    if "/" in path:
        return []
    paths = [place for place, binding in server.walk() if (binding.name, binding.kind) == (path, "rtc")]
    return [found for place in paths if (found := server.resolve(place)) is not None]


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
    host, colon, port = place.rpartition(":")
    if not colon or place.endswith("]"):
        host, port = place, str(MASTER_PORT)
    return f"corbaloc:iiop:{host}:{port}/{key or DEFAULT_KEY}"


def _endpoints(settings: Properties) -> str:
    """`corba.endpoints`; a master is reached at the port of `corba.master_manager`, too."""
    endpoints = settings.get("corba.endpoints", "all")
    if not settings.flag("manager.is_master"):
        return endpoints
    host, _, port = settings["corba.master_manager"].partition("/")[0].rpartition(":")
    if not host:
        port = str(MASTER_PORT)
    first = endpoints.split(",")[0].strip()
    own = "" if first in ("", "all") else first.rpartition(":")[0] if ":" in first else first
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


def _module(properties: Mapping[str, str]) -> Any:
    return RTM.ModuleProfile(to_nv_list(properties))
