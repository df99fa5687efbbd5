"""Service ports written into a component's class.

    class Provider(Component):
        greeter = Provided("SimpleService::MyService", idl="MyService.idl")

        def echo(self, text): ...                  # the interface's operations

    class Consumer(Component):
        greeter = Required(SimpleService.MyService)

        def on_execute(self, context):
            if self.greeter.is_connected:
                print(self.greeter.echo("hello"))

An interface is the class that an IDL compiler made of it, or its name with the file that describes it. Port and
instance are named like the attribute if not said otherwise; interfaces of the same `port` share it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, overload

from muros.rtc.codes import RtcError
from muros.rtc.services._objects import service_objects
from muros.rtc.services.consumer import Consumer
from muros.rtc.services.port import ServicePort

if TYPE_CHECKING:
    from muros.rtc.component import Component

__all__ = ["Provided", "Required"]


class _Declared:
    """What both have in common."""

    def __init__(
        self,
        interface: Any,
        *,
        idl: str | Path = "",
        port: str = "",
        instance: str = "",
        type_name: str = "",
    ) -> None:
        if isinstance(interface, str) and not idl:
            raise RtcError(
                f"{interface} is a name only: say where it stands, idl='...idl', or give the class"
            )
        self._given = interface
        self._idl = Path(idl)
        self._type_name = type_name
        self._folder = Path()
        self.name = port
        self.instance = instance
        self.attribute = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.attribute = name
        self.name = self.name or name
        self.instance = self.instance or name
        file = getattr(sys.modules.get(owner.__module__), "__file__", None)
        self._folder = Path(file).parent if file else Path()

    def properties(self) -> Mapping[str, str]:
        """Nothing: interfaces stand in the profile of the port."""
        return {}

    def _interface(self) -> tuple[Any, str]:
        """The class, and the type name that both sides are to use."""
        given = self._given
        if isinstance(given, str):
            interface = service_objects().interface(given, self._folder / self._idl)
            return interface, self._type_name or given.rpartition("::")[2]
        return given, self._type_name or service_objects().type_name(given)

    def _port(self, component: Component) -> ServicePort:
        """The port of that name, made by the first interface that stands in it."""
        port = next((port for port in component.ports if port.name == self.name), None)
        if port is None:
            port = component.add_port(ServicePort(self.name))
        if not isinstance(port, ServicePort):
            raise RtcError(
                f"{component.instance_name}: {self.name} is a data port; name the service port otherwise"
            )
        return port


class Provided(_Declared):
    """An interface that the component provides.

    Its operations are methods of the component, or of what `by` makes: a class or function called with the component.
    """

    def __init__(
        self,
        interface: Any,
        *,
        idl: str | Path = "",
        by: Callable[[Any], object] | None = None,
        port: str = "",
        instance: str = "",
        type_name: str = "",
    ) -> None:
        super().__init__(interface, idl=idl, port=port, instance=instance, type_name=type_name)
        self._by = by

    @overload
    def __get__(self, component: None, owner: type) -> Self: ...
    @overload
    def __get__(self, component: Component, owner: type) -> Any: ...
    def __get__(self, component: Component | None, owner: type) -> Any:
        """What answers the calls."""
        return self if component is None else component.__dict__.get(self.attribute, component)

    def make(self, component: Component) -> object:
        """Make what answers, and register it at its port."""
        interface, type_name = self._interface()
        target = self._by(component) if self._by is not None else component
        self._port(component).register_provider(self.instance, type_name, target, interface)
        component.__dict__[self.attribute] = target
        return target


class Required(_Declared):
    """An interface that the component calls, through a `Consumer`."""

    @overload
    def __get__(self, component: None, owner: type) -> Self: ...
    @overload
    def __get__(self, component: Component, owner: type) -> Consumer: ...
    def __get__(self, component: Component | None, owner: type) -> Self | Consumer:
        if component is None:
            return self
        consumer = component.__dict__.get(self.attribute)
        if not isinstance(consumer, Consumer):
            raise RtcError(f"{self.attribute} is there once the component runs: use it from on_initialize on")
        return consumer

    def make(self, component: Component) -> Consumer:
        """Make the consumer, and register it at its port."""
        interface, type_name = self._interface()
        consumer = self._port(component).register_consumer(self.instance, type_name, Consumer(interface))
        component.__dict__[self.attribute] = consumer
        return consumer
