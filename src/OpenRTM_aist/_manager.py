"""The manager under its old names."""
# ruff: noqa: N802, N815 (the names are those that components know)

from __future__ import annotations

import atexit
import os
import sys
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from inspect import isfunction
from typing import Any, ClassVar

from muros.rtc.codes import RtcError
from muros.rtc.component import Component
from muros.rtc.manager import Manager as Core
from muros.rtc.manager import ended_by_signals, parse_options, read_settings
from muros.rtc.manager._serve import FAILED, WRONG_USE, fail, show
from muros.rtc.properties import ConfError
from OpenRTM_aist._adapter import Adapter
from OpenRTM_aist._components import Logger, RTObject_impl, _Behind
from OpenRTM_aist._naming_manager import NamingManager
from OpenRTM_aist._properties import Properties

__all__ = ["Manager"]


class Manager:
    """A face of a muros manager. `Manager.init(sys.argv)` makes the one of the process."""

    _one: ClassVar[Manager | None] = None

    def __init__(self, core: Core) -> None:
        self.core = core
        self._init: Callable[[Manager], Any] | None = None
        self._started = False
        self._closed = threading.Event()
        self._closing = threading.Lock()

    # Its life

    @staticmethod
    def init(*args: Any) -> Manager:
        """Make the manager after the command line: `init(argv)`, or `init(argc, argv)`.

        What is wrong with the settings ends the program, with one line that says so.
        """
        if Manager._one is None:
            argv = list(args[-1]) if args else []
            try:
                settings = read_settings(parse_options(argv[1:]), environment=os.environ)
                Manager._one = Manager(Core(settings))
            except ConfError as error:
                sys.exit(fail(error, WRONG_USE))
            Manager._one.core.reporter.on_finding(show)
        return Manager._one

    @staticmethod
    def instance() -> Manager:
        """The manager of the process; made without a command line if there is none yet."""
        return Manager.init([])

    @staticmethod
    def of(core: Core) -> Manager:
        """The face of a manager that muros itself has made."""
        face = Manager._one
        if face is None or face.core is not core:
            face = Manager._one = Manager(core)
            face._started = True
        return face

    def setModuleInitProc(self, proc: Callable[[Manager], Any]) -> None:
        """What registers and makes components, called when the manager is activated."""
        self._init = proc

    def activateManager(self) -> bool:
        """Bring it up. False where the ORB does not start or the settings cannot be; one line says why."""
        if self._started:
            return True
        self._started = True
        try:
            with self._ended_by_signals():
                self.core.start(lambda core: self._init(self) if self._init is not None else None)
        except RtcError as error:
            fail(error, FAILED)
            self._close()
            return False
        return True

    def runManager(self, no_block: bool | None = None) -> None:
        """Serve until the end; with `no_block` in a thread, and the process takes leave of others when it ends."""
        if no_block:
            threading.Thread(target=self.join, name="OpenRTM_aist.Manager", daemon=True).start()
            atexit.register(self._close)
            return
        with self._ended_by_signals():
            self.join()

    def shutdown(self) -> None:
        """Say that the end has come."""
        self.core.shutdown()

    def terminate(self) -> None:
        self.core.shutdown()

    def join(self) -> None:
        """Wait for the end."""
        self.core.wait()
        self._close()

    def _ended_by_signals(self) -> AbstractContextManager[None]:
        in_main_thread = threading.current_thread() is threading.main_thread()
        return ended_by_signals(self.core.shutdown) if in_main_thread else nullcontext()

    def _close(self) -> None:
        with self._closing:
            if not self._closed.is_set():
                self.core.close()
                self._closed.set()
                Manager._one = None

    # Components

    def registerFactory(
        self,
        profile: Properties,
        new_func: Callable[[Manager], Any],
        delete_func: Callable[[Any], Any] | None = None,
    ) -> bool:
        """Make a kind of component known."""

        def create(core: Core) -> Component:
            made = new_func(self)
            if isinstance(made, RTObject_impl):
                made._manager = self
                return made._behind
            if isinstance(made, Component):
                return made
            raise RtcError(f"{new_func!r} made {type(made).__name__}, which is no component")

        def delete(component: Component) -> None:
            if delete_func is not None:
                delete_func(_outer(component))

        return self.core.register(profile.as_dict(), create, delete)

    def createComponent(self, comp_args: str) -> Any:
        """A component after `Type?key=value&...`; None where it cannot be made, a finding says why."""
        try:
            return _outer(self.core.create_component(comp_args))
        except RtcError as error:
            self._failed("create-failed", f"{comp_args} is not made", error)
            return None

    def deleteComponent(self, instance_name: str | None = None, comp: Any = None) -> None:
        """End a component, given by its name or itself."""
        if comp is not None:
            comp.exit()
        elif instance_name:
            self.core.delete_component(instance_name)

    def getComponent(self, instance_name: str) -> Any:
        """The component of that name; None where there is none."""
        component = self.core.component(instance_name)
        return None if component is None else _outer(component)

    def getComponents(self) -> list[Any]:
        return [_outer(component) for component in self.core.components]

    def cleanupComponent(self, comp: Any) -> None:
        """Nothing: components that have ended are forgotten."""

    def reference_of(self, component: RTObject_impl) -> Any:
        """The reference by which others call it; None before they know it."""
        try:
            return self.core.reference_of(component._behind)
        except KeyError:
            return None

    # Modules

    def load(self, fname: str, initfunc: str = "") -> Any:
        """Load a module; its return code."""
        import RTC

        try:
            self.core.load_module(fname, initfunc)
        except RtcError as error:
            self._failed("preload-failed", f"{fname} is not loaded", error)
            return RTC.RTC_ERROR
        return RTC.RTC_OK

    def unload(self, fname: str) -> None:
        self.core.unload_module(fname)

    def unloadAll(self) -> None:
        """Forget all modules."""
        for module in self.core.modules.loaded:
            self.core.unload_module(str(module.path))

    def getLoadedModules(self) -> list[Properties]:
        return [Properties.of(module.properties()) for module in self.core.modules.loaded]

    def getLoadableModules(self) -> list[Properties]:
        return [Properties.of(found) for found in self.core.modules.loadable()]

    def getFactoryProfiles(self) -> list[Properties]:
        return [Properties.of(factory.properties) for factory in self.core.factories.all]

    # The rest

    def getConfig(self) -> Properties:
        return Properties.of(self.core.configuration())

    def getLogbuf(self, name: str = "manager") -> Logger:
        return Logger(name)

    def getNaming(self) -> NamingManager:
        """What finds components by their addresses."""
        return NamingManager(self.core)

    def getORB(self) -> Any:
        """The ORB, as omniORB has it."""
        from omniORB import CORBA

        return CORBA.ORB_init([], CORBA.ORB_ID)

    theORB = getORB

    def getPOA(self) -> Any:
        """The ORB's root adapter, which knows components, too."""
        return Adapter(self.getORB().resolve_initial_references("RootPOA"))

    thePOA = getPOA

    def getPOAManager(self) -> Any:
        return self.getPOA()._get_the_POAManager()

    def _failed(self, code: str, what: str, error: RtcError) -> None:
        self.core.reporter.report(code, who=self.core.name, what=what, why=str(error), subject=what)


def _lent(name: str) -> Callable[..., Any]:
    def call(core: Core, *arguments: Any, **more: Any) -> Any:
        return getattr(Manager.of(core), name)(*arguments, **more)

    return call


# A manager that muros has made (`muros rtc run`, `muros rtcd`) calls the init functions of old modules with itself:
# they find the names they know on it.
for _name, _value in vars(Manager).items():
    if isfunction(_value) and not _name.startswith("_") and not hasattr(Core, _name):
        setattr(Core, _name, _lent(_name))


def _outer(component: Component) -> Any:
    return component.outer if isinstance(component, _Behind) else component
