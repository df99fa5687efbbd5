"""The components of a manager: made after requests, named, offered to others, forgotten when they have ended."""

from __future__ import annotations

import threading
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from muros.rtc.actions import ComponentEvent
from muros.rtc.codes import ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.manager._factories import Factory
from muros.rtc.manager._instances import binding_names, instance_properties, numbered_names
from muros.rtc.manager._requests import ComponentId, CreateRequest
from muros.rtc.profiles import Reference

if TYPE_CHECKING:
    from muros.rtc.manager._manager import Manager

__all__ = ["Components", "CreateError", "ManagerEvent"]


class CreateError(RtcError):
    """A component cannot be made; the text says why."""


class ManagerEvent(Enum):
    """What listeners of a manager hear of, with what they are called with."""

    MODULE_LOADED = "MODULE_LOADED"  # the LoadedModule
    MODULE_UNLOADED = "MODULE_UNLOADED"  # the LoadedModule
    COMPONENT_CREATED = "COMPONENT_CREATED"  # the component
    COMPONENT_ENDED = "COMPONENT_ENDED"  # the component
    NAMES_BOUND = "NAMES_BOUND"  # the component, its names
    NAMES_UNBOUND = "NAMES_UNBOUND"  # the component, its names
    SHUTDOWN = "SHUTDOWN"  # nothing


class Components:
    """Those of `manager`. `on_end` is called when one is there no more. Any thread may call."""

    def __init__(self, manager: Manager, on_end: Callable[[], object]) -> None:
        self._manager = manager
        self._on_end = on_end
        self._lock = threading.Lock()
        self._components: dict[str, Component] = {}
        self._names: dict[str, tuple[str, ...]] = {}
        self._references: dict[str, Reference] = {}
        self.made = 0
        """How many have been made so far."""

    @property
    def all(self) -> tuple[Component, ...]:
        """Those that live, in the order of creation."""
        with self._lock:
            return tuple(self._components.values())

    def get(self, name: str) -> Component | None:
        """The one of an instance name."""
        return self._components.get(name)

    def reference_of(self, component: Component) -> Reference:
        """How others call it. KeyError for one that they do not know yet, or no longer."""
        return self._references[component.instance_name]

    def names_of(self, component: Component) -> tuple[str, ...]:
        """Its names in the naming service."""
        return self._names.get(component.instance_name, ())

    def create(self, request: CreateRequest) -> Component:
        """Make one; an existing instance name is that one. CreateError where it cannot be made."""
        asked = request.properties.get("instance_name", "")
        standing = self.get(asked) if asked else None
        if standing is not None:
            return standing
        factory = self._factory(request.id)
        name = self._reserve(factory, request)
        component = None
        try:
            component = self._make(factory, name, request)
            self._welcome(component)
        except BaseException:
            if component is not None:
                component.exit()
            self._names.pop(name, None)
            self._manager.factories.release(name)
            raise
        return component

    def forget(self, component: Component) -> None:
        """It has ended: take its names and its references back. Twice is once."""
        manager, name = self._manager, component.instance_name
        with self._lock:
            if self._components.get(name) is not component:
                return
            del self._components[name]
            self._references.pop(name, None)
            names = self._names.pop(name, ())
        manager.world.unbind(names)
        manager.topics.leave(component)
        manager.listeners.tell(ManagerEvent.NAMES_UNBOUND, component, names)
        manager.world.withdraw_component(component)
        factory = manager.factories.release(name)
        if factory is not None and factory.delete is not None:
            try:
                factory.delete(component)
            except Exception as error:
                manager.reporter.failed("delete-failed", name, f"the delete function of {name} raised", error)
        manager.log.logger.info("component %s has ended", name)
        manager.listeners.tell(ManagerEvent.COMPONENT_ENDED, component)
        self._on_end()

    def _factory(self, wanted: ComponentId) -> Factory:
        manager = self._manager
        factory = manager.factories.find(wanted)
        if factory is None and manager.settings.flag("manager.modules.search_auto"):
            path = manager.modules.search(wanted.fits)
            if path is not None:
                manager.load_file(path)
                factory = manager.factories.find(wanted)
        if factory is None:
            known = ", ".join(factory.name for factory in manager.factories.all) or "none"
            raise CreateError(
                f"no component {wanted} is known; loaded: {known}. Load its module (manager.modules.preload), or put "
                "it where manager.modules.load_path leads"
            )
        return factory

    def _reserve(self, factory: Factory, request: CreateRequest) -> str:
        """An instance name that nobody has as far as the naming policy looks."""
        manager = self._manager
        asked = request.properties.get("instance_name", "")
        if asked:
            if not manager.factories.reserve(asked, factory):
                raise CreateError(f"{asked} is being made or ended at this moment; try again")
            return asked
        policy = manager.settings["manager.components.naming_policy"]
        taken = set[str]()
        if policy != "process_unique":
            taken |= manager.colleagues.instance_names()
        if policy == "ns_unique":
            taken |= manager.world.instance_names()
        for name in numbered_names(factory.properties.get("type_name") or factory.name):
            if name in taken or not manager.factories.reserve(name, factory):
                continue
            names = binding_names(name, {**factory.properties, **request.properties}, manager.settings)
            if all(map(manager.world.is_free, names)) or not any(name in bound for bound in names):
                return name  # free, or of a form in which no number makes a difference
            manager.factories.release(name)
        raise AssertionError("numbered_names never ends without an error")

    def _make(self, factory: Factory, name: str, request: CreateRequest) -> Component:
        manager = self._manager
        properties = instance_properties(
            factory.properties, name, manager.settings, request.properties, find_file=self._find_file
        )
        names = binding_names(name, properties, manager.settings)
        properties["naming.names"] = ",".join(names)
        try:
            component = factory.create(manager)
        except Exception as error:
            manager.reporter.failed("create-failed", name, f"{name} could not be constructed", error)
            raise CreateError(f"{name}: making it raised {type(error).__name__}: {error}") from error
        self._names[name] = names
        component.listeners.add(ComponentEvent.FINALIZED, lambda: self.forget(component))
        component.configure(name, properties, manager.reporter)
        try:
            code = component.initialize()
        except RtcError as error:
            component.exit()
            raise CreateError(f"{name} cannot be made: {error}") from error
        if code is not ReturnCode.RTC_OK:
            raise CreateError(f"{name}: on_initialize answered {code.name}; its log says why")
        return component

    def _welcome(self, component: Component) -> None:
        manager = self._manager
        name, names = component.instance_name, self._names[component.instance_name]
        key = f"{component.properties.get('category', '')}.{name}"
        reference = manager.world.offer_component(component, key)
        with self._lock:
            self._components[name] = component
            self._references[name] = reference
            self.made += 1
        if manager.settings.flag("naming.enable"):
            manager.world.bind(names, reference)
            manager.listeners.tell(ManagerEvent.NAMES_BOUND, component, names)
            manager.topics.join(component)
        manager.log.logger.info("component %s is there as %s", name, ", ".join(names))
        manager.listeners.tell(ManagerEvent.COMPONENT_CREATED, component)

    def _find_file(self, name: str) -> Path:
        """A component's file: as it is named, or beside the manager's."""
        path = self._manager.folder / name
        beside = Path(self._manager.settings.get("config_file", "")).parent / name
        return beside if not path.is_file() and beside.is_file() else path
