"""Ports and parameters written into a component's class.

    class Controller(Component):
        position = InPort(TimedDouble)                # port "position"
        torque = OutPort(TimedDouble, name="out")     # port "out"
        gain = Parameter(1.5, constraint="0<=x<=10", widget="slider.0.1")

On an instance the names are the real thing: `self.position` is its `DataInPort`, `self.torque` its `DataOutPort`,
`self.gain` the number that the active configuration set gives it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar, overload

from muros.rtc.codes import RtcError
from muros.rtc.configuration import DEFAULT_SET, converter_of
from muros.rtc.data import DataError, DataInPort, DataOutPort, DataType, stamp
from muros.rtc.data_types import data_type_of

if TYPE_CHECKING:
    from muros.rtc.component import Component

__all__ = ["InPort", "OutPort", "Parameter", "PlainOutPort"]

T = TypeVar("T")


class _DataPortDeclaration(Generic[T]):
    """What both have in common.

    `data_type` is the class that stands for an IDL type, its repository id, or a data type. `name` is the attribute's
    if not given. `options` are what rtc.conf may say of the port, which wins: `{"buffer.length": 16}`.
    """

    kind: ClassVar[str]

    def __init__(
        self,
        data_type: type[T] | str | DataType[T],
        *,
        name: str = "",
        options: Mapping[str, object] | None = None,
    ) -> None:
        self.data_type = data_type
        self.name = name
        self.attribute = ""
        self._options = {key: str(value) for key, value in (options or {}).items()}

    def __set_name__(self, owner: type, name: str) -> None:
        self.attribute = name
        self.name = self.name or name

    def properties(self) -> Mapping[str, str]:
        """The port's options, as rtc.conf names them."""
        return {f"port.{self.kind}.{self.name}.{key}": text for key, text in self._options.items()}

    def _made(self, component: Component) -> Any:
        port = component.__dict__.get(self.attribute)
        if port is None:
            raise RtcError(f"{self.attribute} is there once the component runs: use it from on_initialize on")
        return port


class InPort(_DataPortDeclaration[T]):
    """A port that values come in by; on an instance, its `DataInPort`."""

    kind: ClassVar[str] = "inport"

    @overload
    def __get__(self, component: None, owner: type) -> Self: ...
    @overload
    def __get__(self, component: Component, owner: type) -> DataInPort[T]: ...
    def __get__(self, component: Component | None, owner: type) -> Self | DataInPort[T]:
        if component is None:
            return self
        port: DataInPort[T] = self._made(component)
        return port

    def make(self, component: Component) -> None:
        """Add the port."""
        component.__dict__[self.attribute] = component.add_port(
            DataInPort(self.name, data_type_of(self.data_type))
        )


class OutPort(_DataPortDeclaration[T]):
    """A port that values go out by; on an instance, its `PlainOutPort`."""

    kind: ClassVar[str] = "outport"

    @overload
    def __get__(self, component: None, owner: type) -> Self: ...
    @overload
    def __get__(self, component: Component, owner: type) -> PlainOutPort[T]: ...
    def __get__(self, component: Component | None, owner: type) -> Self | PlainOutPort[T]:
        if component is None:
            return self
        port: PlainOutPort[T] = self._made(component)
        return port

    def make(self, component: Component) -> None:
        """Add the port."""
        component.__dict__[self.attribute] = component.add_port(
            PlainOutPort(self.name, data_type_of(self.data_type))
        )


class PlainOutPort(DataOutPort[T]):
    """An OutPort that also takes what a timed type wraps: `write(1.5)` of a `TimedDouble` is stamped with the time."""

    def write(self, value: T | Any) -> bool:
        """As `DataOutPort.write`, of a value of the data type or of the one it has under `data`.

        DataError for others.
        """
        kind = self.data_type.python_class
        return super().write(value if isinstance(value, kind) else self._timed(value))

    def _timed(self, value: Any) -> T:
        timed: Any = self.data_type.default()
        if not hasattr(timed, "data") or not stamp(timed, time.time_ns):
            kind = self.data_type.python_class.__name__
            raise DataError(f"port {self.full_name} takes {kind}, not {type(value).__name__}: write a {kind}")
        timed.data = value
        whole: T = timed
        return whole


class Parameter(Generic[T]):
    """A configuration parameter of a component, with the value that counts while nobody configures another.

    `default` also gives the type: bool, int, float, str, or a list or tuple of these; for others give `convert`, which
    makes a value of a text, and, where `str` does not invert that, `text`, the default's text. `name` is the
    attribute's if not given. `widget`, `constraint` and `unit` are remarks for editors ("slider.0.1", "0<=x<=10",
    "(fast,slow)"): nothing is enforced.
    """

    def __init__(
        self,
        default: T,
        *,
        name: str = "",
        convert: Callable[[str], T] | None = None,
        text: str = "",
        widget: str = "",
        constraint: str = "",
        type_name: str = "",
    ) -> None:
        self.default = default
        self.name = name
        self.attribute = ""
        self._convert: Callable[[str], T] = convert or converter_of(default)
        self._text = text or _text_of(default)
        self._remarks = {
            "__widget__": widget,
            "__constraints__": constraint,
            "__type__": type_name or _type_of(default),
        }

    def __set_name__(self, owner: type, name: str) -> None:
        self.attribute = name
        self.name = self.name or name

    @overload
    def __get__(self, component: None, owner: type) -> Self: ...
    @overload
    def __get__(self, component: Component, owner: type) -> T: ...
    def __get__(self, component: Component | None, owner: type) -> Self | T:
        if component is None:
            return self
        value: T = component.__dict__.get(self.attribute, self.default)
        return value

    def __set__(self, component: Component, value: T) -> None:
        raise RtcError(
            f"{component.instance_name}: parameter {self.name} is set through its configuration set: "
            f"component.configuration.set_values(...), or rtconf"
        )

    def properties(self) -> Mapping[str, str]:
        """Its text in the default set, and the remarks for editors."""
        remarks = {f"conf.{set_}.{self.name}": text for set_, text in self._remarks.items() if text}
        return {f"conf.{DEFAULT_SET}.{self.name}": self._text, **remarks}

    def make(self, component: Component) -> None:
        """Bind it to the component's configuration."""

        def assign(value: T) -> None:
            component.__dict__[self.attribute] = value

        component.configuration.bind(self.name, self._text, self._convert, assign)


def _text_of(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return ",".join(map(_text_of, value))
    if isinstance(value, bool):
        return "1" if value else "0"
    return str(value)


def _type_of(value: Any) -> str:
    """The word for a value's type that editors know, "" where they have none."""
    kinds = {bool: "int", int: "int", float: "double", str: "string"}
    if isinstance(value, (list, tuple)):
        return f"vector<{kinds.get(type(value[0]), 'string')}>" if value else "vector<string>"
    return kinds.get(type(value), "")
