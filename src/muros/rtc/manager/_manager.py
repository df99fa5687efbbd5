"""Manager: makes components, names them, connects them, ends them, as `rtc.conf` and other programs ask.

Its life: `start` brings the ORB, the name service and the log up and does what the settings list (preload, precreate,
preconnect, preactivation); `wait` returns when it is to end; `close` takes everything back. `shutdown` may be called
from anywhere: it only says that the end has come.

Calls come from the ORB's threads, the timer's and the user's. No lock is held over a component's actions or a call to
another process.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Final

from muros.findings import Severity
from muros.rtc.codes import ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.composite import PeriodicECSharedComposite
from muros.rtc.formats import expand
from muros.rtc.listeners import Listeners
from muros.rtc.manager._colleagues import Colleagues
from muros.rtc.manager._components import Components, CreateError, ManagerEvent
from muros.rtc.manager._defaults import DEFAULTS
from muros.rtc.manager._factories import Factories, Factory
from muros.rtc.manager._instances import POLICIES, fields_of
from muros.rtc.manager._logger import Log
from muros.rtc.manager._modules import LoadedModule, ModuleError, Modules
from muros.rtc.manager._requests import (
    CreateRequest,
    parse_connect_untrusted,
    parse_create_untrusted,
)
from muros.rtc.manager._settings import Settings
from muros.rtc.manager._timer import Timer
from muros.rtc.manager._topics import Topics
from muros.rtc.manager._world import World
from muros.rtc.ports import Port
from muros.rtc.profiles import ConnectorProfile, Reference
from muros.rtc.properties import ConfError, Properties
from muros.rtc.reports import Reporter

__all__ = ["Manager"]

LEAST_WAIT: Final = 1.0
"""Seconds that a component's end may take at least; `manager.termination_waittime` may allow more."""

CONNECT_AGAIN: Final = 1.0
"""Seconds after which a connection of `preconnect` is tried again while one of its components is missing."""


class Manager:
    """The manager of a process.

    `settings` as `read_settings` gives them; `world` what it is connected to others by (None: CORBA); `log` where to
    write (None: as the settings say). ConfError for settings that cannot be.
    """

    def __init__(self, settings: Settings, *, world: Callable[[Manager], World] | None = None) -> None:
        self.settings: Final = settings.properties
        self.folder: Final = Path.cwd()
        self.reporter: Final = Reporter()
        self.factories: Final = Factories()
        self.modules: Final = Modules(self.settings.node("manager.modules"), self.folder)
        self.listeners: Final = Listeners[ManagerEvent](
            lambda event, error: self.reporter.failed(
                "listener-failed", self.name, f"a listener of {event.value} raised", error
            )
        )
        self.timer: Final = Timer(
            lambda error: self.reporter.failed("task-failed", self.name, "a timer's task raised", error)
        )
        for key in ("manager.instance_name", "manager.name"):
            self.settings[key] = self._expand(self.settings[key])
        if self.settings["manager.components.naming_policy"] not in POLICIES:
            raise ConfError(
                f"manager.components.naming_policy: there is no {self.settings['manager.components.naming_policy']!r};"
                f" there are {', '.join(POLICIES)}"
            )
        self.log: Final = Log(self.settings.node("logger"), fields_of(self.settings))
        self._end_log = self.reporter.on_finding(self.log.finding)
        self._make_world = world
        self._world: World | None = None
        self._colleagues: Colleagues | None = None
        self._topics: Topics | None = None
        self._components: Final = Components(self, self._component_ended)
        self._modules_of: dict[Path, list[Factory]] = {}
        self._loading: Path | None = None
        self._lock = threading.RLock()
        self._load_lock = threading.RLock()  # as Python's own lock for imports, held while modules run
        # Signals interrupt the main thread wherever it is: what says that the end has come must need no lock that it
        # may hold. A simple queue needs none; whoever takes the one thing in it puts it back for the others.
        self._is_ending = False
        self._end = SimpleQueue[None]()
        self._closed = False
        self.register(
            PeriodicECSharedComposite.spec(),
            lambda manager: PeriodicECSharedComposite(
                lambda name: manager.component(name) or manager.world.member(name)
            ),
        )

    # What it is

    @property
    def name(self) -> str:
        """What other managers and tools call it."""
        return self.settings["manager.instance_name"]

    @property
    def is_master(self) -> bool:
        """Whether it only directs slaves."""
        return self.settings.flag("manager.is_master")

    @property
    def world(self) -> World:
        """The ORB and what it leads to. RtcError before `start`."""
        if self._world is None:
            raise _not_started()
        return self._world

    @property
    def colleagues(self) -> Colleagues:
        """The other managers. RtcError before `start`."""
        if self._colleagues is None:
            raise _not_started()
        return self._colleagues

    @property
    def topics(self) -> Topics:
        """The topics that ports meet in. RtcError before `start`."""
        if self._topics is None:
            raise _not_started()
        return self._topics

    def configuration(self) -> dict[str, str]:
        """All settings, defaults among them."""
        return {**DEFAULTS, **self.settings}

    # Its life

    def start(self, init: Callable[[Manager], object] | None = None) -> None:
        """Bring it up: the ORB, its own servant, names, the timer's tasks; then `init`, then what the settings list.

        ConfError for settings that cannot be, RtcError where the ORB does not start. What the settings list and
        cannot be done is a finding; the rest goes on.
        """
        if self._world is not None:
            raise RtcError("the manager has been started already")
        self._world = world = (self._make_world or _corba_world)(self)
        self.settings.update(world.properties())
        self._topics = Topics(world, self.reporter)
        self._colleagues = Colleagues(world, self.settings, self.reporter)
        self._bind_to_processors()
        self.log.logger.info(
            "manager %s starts (pid %s, %s)",
            self.name,
            os.getpid(),
            self.settings.get("config_file", "no rtc.conf"),
        )
        if self.settings.flag("manager.corba_servant"):
            own = world.offer_manager(self, self.settings["manager.name"])
            if self.is_master and self.settings.flag("naming.enable"):
                world.bind(self._names_of_manager(), own)
            self._colleagues.begin(own)
            if not self.is_master:
                self.timer.after(0, self._colleagues.find_master)  # it may be far away, or silent
                if self.settings.flag("corba.update_master_manager.enable"):
                    self._every("corba.update_master_manager.interval", self._colleagues.find_master)
        if self.settings.flag("naming.enable") and self.settings.flag("naming.update.enable"):
            self._every("naming.update.interval", world.update_names)
            self._every("naming.update.interval", self._topics.update)
        self._every("naming.update.interval", world.part_with_the_gone)
        self.timer.every(1.0, self.reporter.tick)
        for name in self.settings.words("manager.modules.preload"):
            self._try("preload", name, partial(self.load_module, name))
        if init is not None:
            init(self)
        for request in self.settings.words("manager.components.precreate"):
            self._try("precreate", request, partial(self.create, request))
        for request in self.settings.words("manager.components.preconnect"):
            self._preconnect(request)
        for name in self.settings.words("manager.components.preactivation"):
            self._try("preactivation", name, partial(self.activate, name))
        self._shut_down_when_empty()
        self.log.logger.info("manager %s is up", self.name)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is to end. False: `timeout` seconds passed before."""
        try:
            self._end.get(timeout=timeout)
        except Empty:
            return False
        self._end.put(None)
        return True

    def shutdown(self) -> None:
        """Say that the end has come; whoever `wait`s then calls `close`. Any thread or signal, any number of times."""
        if not self._is_ending:
            self._is_ending = True
            self._end.put(None)
            self.listeners.tell(ManagerEvent.SHUTDOWN)

    @property
    def is_ending(self) -> bool:
        """Whether the end has come."""
        return self._is_ending

    def close(self) -> None:
        """End all components, take names back, end the ORB and the log. Twice is once; not in a call from outside."""
        self.shutdown()
        with self._lock:
            if self._closed:
                return
            self._closed = True
        self.timer.close()
        self._end_components()
        if self._colleagues is not None:
            self._colleagues.close()
        if self._world is not None:
            self._world.unbind(self._names_of_manager() if self.is_master else ())
            self._world.withdraw_manager()
            self._world.close()
        self.log.logger.info("manager %s has ended", self.name)
        self._end_log()
        self.log.close()

    def __enter__(self) -> Manager:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # Modules and factories

    def register(
        self,
        kind: type[Component] | Mapping[str, str],
        create: Callable[[Manager], Component] | None = None,
        delete: Callable[[Component], object] | None = None,
    ) -> bool:
        """Make a kind of component known: a class, or a specification with what makes one. False if it is known.

        `delete` is called with each component of this kind after its end.
        """
        if isinstance(kind, type):
            component = kind
            factory = Factory(
                component.spec(), create or (lambda manager: component()), delete, self._loading
            )
        elif create is None:
            raise RtcError("a specification needs a function that creates the component")
        else:
            factory = Factory(dict(kind), create, delete, self._loading)
        new = self.factories.add(factory)
        if new and factory.module is not None:
            self._modules_of.setdefault(factory.module, []).append(factory)
        return new

    def load_module(self, name: str, init: str = "") -> LoadedModule:
        """Load a module and register what is in it. ModuleError says what was wrong."""
        return self.load_file(self.modules.find(name), init)

    def load_file(self, path: Path, init: str = "") -> LoadedModule:
        """The same for a file, wherever it lies."""
        with self._load_lock:
            module = self.modules.load_file(path, init)
            if module.path in self._modules_of:
                return module
            self._loading = module.path
            self._modules_of[module.path] = []
            try:
                if module.init is not None:
                    module.init(self)
                for component in module.components:
                    self.register(component)
            except Exception as error:
                self._forget(self.modules.unload(str(module.path)))
                raise ModuleError(
                    f"{module.path}: its init function failed: {type(error).__name__}: {error}"
                ) from error
            finally:
                self._loading = None
        self.log.logger.info("module %s loaded", module.path)
        self.listeners.tell(ManagerEvent.MODULE_LOADED, module)
        return module

    def unload_module(self, name: str) -> None:
        """Forget a module and its kinds of components; instances stay. ModuleError if it is not loaded."""
        module = self.modules.unload(name)
        self._forget(module)
        self.listeners.tell(ManagerEvent.MODULE_UNLOADED, module)

    def _forget(self, module: LoadedModule) -> None:
        for factory in self._modules_of.pop(module.path, ()):
            self.factories.remove(factory)

    def factories_of(self, module: LoadedModule) -> tuple[Factory, ...]:
        """The kinds of components that a module has registered."""
        return tuple(self._modules_of.get(module.path, ()))

    # Components

    @property
    def components(self) -> tuple[Component, ...]:
        """Those that live, in the order of creation."""
        return self._components.all

    def component(self, name: str) -> Component | None:
        """The component of an instance name."""
        return self._components.get(name)

    def components_by_name(self, name: str) -> tuple[Component, ...]:
        """Those of `NAME`, `CATEGORY/NAME` or `*/NAME`."""
        category, _, instance = name.rpartition("/")
        return tuple(
            component
            for component in self.components
            if component.instance_name == instance
            and category in ("", "*", component.properties.get("category", ""))
        )

    def reference_of(self, component: Component) -> Reference:
        """How others call a component. KeyError for one that they do not know yet, or no longer."""
        return self._components.reference_of(component)

    def names_of(self, component: Component) -> tuple[str, ...]:
        """A component's names in the naming service."""
        return self._components.names_of(component)

    def create(self, request: str) -> Component | Reference:
        """A component after a request such as `Foo?instance_name=Left`: of this process, or of another manager's.

        A master lets a slave make it; `manager_name` and `manager_address` in the request say which manager is to:
        a slave asks its master for another one.
        CreateError where it cannot be made.
        """
        parsed = parse_create_untrusted(request)
        name = parsed.properties.get("manager_name", "")
        address = parsed.properties.get("manager_address", "")
        if address:
            made = self.world.manager_at(address).create_component(_without(parsed))
            if made is None:
                raise CreateError(f"{request}: the manager at {address} could not make it; see its log")
            return made
        if self.is_master:
            asked = parsed.properties.get("instance_name", "")
            standing = self.colleagues.components_by_name(f"*/{asked}") if asked else ()
            if standing:
                return standing[0]
            language = parsed.id.language or self.settings["manager.language"]
            return self.colleagues.create(_without(parsed), name=name, language=language)
        if name not in ("", self.name, self.settings["manager.name"]):
            return self.colleagues.ask_master(request)
        return self.create_component(parsed)

    def create_component(self, request: str | CreateRequest) -> Component:
        """A component of this process. CreateError where it cannot be made; an existing instance name is that one."""
        if isinstance(request, str):
            request = parse_create_untrusted(request)
        if self.is_ending:
            raise CreateError(f"{request.id}: the manager is ending")
        return self._components.create(request)

    def delete_component(self, name: str) -> ReturnCode:
        """End a component, one's own or a slave's. BAD_PARAMETER where there is none."""
        component = self.component(name)
        if component is not None:
            return component.exit()
        return self.colleagues.delete(name)

    def activate(self, name: str) -> None:
        """Activate a component: one of this process by its name, others by `rtcname://` or `rtcloc://`. RtcError."""
        component = self.component(name)
        if component is None:
            if "://" not in name:
                raise self._no_component(name)
            self.world.activate_at(name)
            return
        for context in component.owned_contexts:
            code = context.activate_component(component.participation)
            if code is not ReturnCode.RTC_OK:
                raise RtcError(f"{name} cannot be activated: {code.name}")

    def connect(self, request: str) -> None:
        """Connect ports as `Comp0.out?port=Comp1.in&subscription_type=new` says. RtcError where it cannot be."""
        parsed = parse_connect_untrusted(request)
        ports: list[Port] = []
        references: dict[str, Reference] = {}
        for address in parsed.ports:
            name, _, port = address.rpartition(".")
            component = self.component(name)
            if component is not None:
                ports.append(component.port(port))
                references[name] = self.reference_of(component)
            elif "://" not in address:
                raise self._no_component(name)
        connection = request.partition("&")[0]
        if len(ports) < len(parsed.ports):
            self.world.connect(parsed.ports, references, connection, parsed.properties)
            return
        profile = ConnectorProfile(connection, "", tuple(ports), parsed.properties)
        code, _ = ports[0].connect(profile)
        if code is not ReturnCode.RTC_OK:
            raise RtcError(f"{connection} cannot be connected: {code.name}")

    def _no_component(self, name: str) -> RtcError:
        known = ", ".join(component.instance_name for component in self.components) or "none"
        return RtcError(f"there is no component {name}; there are {known}")

    # Its end

    def _component_ended(self) -> None:
        """The last one may be the end of the manager, too."""
        if self.components or self.is_ending:
            return
        if self.settings.flag("manager.shutdown_on_nortcs") and not self.is_master:
            self.shutdown()
        else:
            self._shut_down_when_empty()

    def _end_components(self) -> None:
        """End all, the youngest first. One whose actions do not come to an end is left behind, and says so."""
        waittime = max(LEAST_WAIT, self.settings.number("manager.termination_waittime", 1.0))
        for component in reversed(self.components):
            name = component.instance_name
            ending = threading.Thread(
                target=self._try, args=("exit", name, component.exit), name=f"rtc-end-{name}", daemon=True
            )
            ending.start()
            ending.join(waittime)
            if ending.is_alive():
                self.reporter.report(
                    "component-hangs",
                    who=name,
                    what=f"{name} does not end",
                    why=f"one of its actions has not returned for {waittime:g} s; it is left behind",
                    remedy="Let actions return soon: what takes long belongs into a thread of the component's own",
                    severity=Severity.ERROR,
                )
                self._components.forget(component)

    # Small things

    def _expand(self, form: str) -> str:
        return expand(form, fields_of(self.settings), os.environ)

    def _names_of_manager(self) -> tuple[str, ...]:
        return tuple(map(self._expand, self.settings.words("manager.naming_formats")))

    def _bind_to_processors(self) -> None:
        words = self.settings.words("manager.cpu_affinity")
        if words:
            try:
                os.sched_setaffinity(0, [int(word) for word in words])
            except (ValueError, OSError) as error:
                raise ConfError(
                    f"manager.cpu_affinity: {', '.join(words)}: {error}; write numbers of processors, such as 0,1"
                ) from error

    def _every(self, key: str, task: Callable[[], object]) -> None:
        period = self.settings.number(key, float(DEFAULTS[key]))
        if period <= 0:
            raise ConfError(f"{key}: {period:g} is no interval; write seconds, more than 0")
        if self.settings.flag("timer.enable"):
            self.timer.every(period, task)

    def _shut_down_when_empty(self) -> None:
        """End if nothing has been made when the time is over."""
        duration = self.settings.number("manager.auto_shutdown_duration", 20.0)
        made = self._components.made

        def look() -> None:
            if not self.components and self._components.made == made:
                self.log.logger.info("no component for %g s: the manager ends", duration)
                self.shutdown()

        if self.settings.flag("manager.shutdown_auto") and not self.is_master:
            self.timer.after(max(0.0, duration), look)

    def _preconnect(self, request: str) -> None:
        try:
            self.connect(request)
        except RtcError as error:
            self.reporter.report(
                "preconnect-waits",
                who=self.name,
                what=f"{request} is not connected",
                why=str(error),
                remedy="It is tried again every second; mend manager.components.preconnect if it is wrong",
                subject=request,
            )
            if not self.is_ending:
                self.timer.after(CONNECT_AGAIN, lambda: self._preconnect(request))

    def _try(self, kind: str, what: str, action: Callable[[], object]) -> None:
        """Do what the settings list; what goes wrong is a finding."""
        try:
            action()
        except RtcError as error:
            self.reporter.report(
                f"{kind}-failed",
                who=self.name,
                what=f"{kind} of {what} failed",
                why=str(error),
                subject=what,
            )


def _without(request: CreateRequest) -> str:
    """The request, without what says which manager is to do it."""
    rest = Properties(
        {k: v for k, v in request.properties.items() if k not in ("manager_name", "manager_address")}
    )
    return str(CreateRequest(request.id, rest))


def _not_started() -> RtcError:
    return RtcError("the manager has not been started: call start first")


def _corba_world(manager: Manager) -> World:
    from muros.rtc.corba._world import CorbaWorld

    return CorbaWorld(manager.settings, manager.reporter)
