"""Component: what users derive theirs from. RTC 1.1, 5.2; compatible with OpenRTM-aist's DataFlowComponentBase.

    class Controller(Component):
        position = InPort(TimedDouble)
        torque = OutPort(TimedDouble)
        gain = Parameter(1.5)

        def on_execute(self, context):
            if self.position.is_new():
                self.torque.write(-self.gain * self.position.read().data)

A component is made in three steps, which the manager takes: it is constructed, `configure`d with its name and the
properties that rtc.conf has for it, and `initialize`d: its ports and parameters are made, `on_initialize` runs, its
execution contexts start. `exit` takes it back.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Final, Protocol, cast, runtime_checkable

from muros.rtc.actions import ActionPoint, ComponentEvent, join_names
from muros.rtc.codes import LifeCycleState, PortType, ReturnCode, RtcError
from muros.rtc.configuration import Configuration
from muros.rtc.contexts import inside_callback, make_contexts
from muros.rtc.listeners import Listeners
from muros.rtc.participation import Participation
from muros.rtc.ports import Port
from muros.rtc.profiles import ComponentProfile
from muros.rtc.reports import Reporter

if TYPE_CHECKING:
    from muros.rtc.configuration import Parameter as BoundParameter
    from muros.rtc.contexts import ExecutionContext

__all__ = ["PARTICIPATING", "Component", "Declaration"]

PARTICIPATING: Final = 1000
"""Handles of contexts that a component takes part in without owning them begin here."""

PARTICIPATING_LIMIT: Final = 100
"""Such contexts of one component at most."""

OK: Final = ReturnCode.RTC_OK
LOGGER_NAME: Final = "muros.rtc"
"""The logger above those of managers and components."""
LANGUAGE: Final = {"language": "Python", "lang_type": "script"}


class Declaration(Protocol):
    """A port or a parameter written into a component's class."""

    name: str

    def properties(self) -> Mapping[str, str]:
        """What it adds to the component's specification."""

    def make(self, component: Component) -> object:
        """Make the real one for `component`."""


@runtime_checkable
class ReadBefore(Protocol):
    """A port that can be read before every `on_execute` (`Component.reads_all`)."""

    def read_before(self) -> bool:
        """Read it; whether there was something."""
        ...


@runtime_checkable
class WrittenAfter(Protocol):
    """A port that can be written after every `on_execute` (`Component.writes_all`)."""

    def write_after(self) -> bool:
        """Write its value; whether it went."""
        ...


class Component:
    """Base of all RT components. Override the actions you need; all others answer RTC_OK.

    An action returns nothing or a `ReturnCode`. What is not RTC_OK, and what it raises, takes an active component
    into the error state. `context` is the handle of the execution context that calls (`context_of`).

    The class attributes are its profile: what tools show and where the manager takes limits from. `type_name` is the
    class's name and `description` the first line of its docstring, if not said otherwise. `specification` may hold
    further properties, by their names in rtc.conf.
    """

    type_name: ClassVar[str] = ""
    description: ClassVar[str] = ""
    version: ClassVar[str] = "1.0.0"
    vendor: ClassVar[str] = ""
    category: ClassVar[str] = "Generic"
    activity_type: ClassVar[str] = "DataFlowComponent"
    max_instance: ClassVar[int] = 0
    """Instances that a manager makes at most; 0: any number."""
    rate: ClassVar[float] = 0.0
    """Cycles a second of the context it gets, where rtc.conf does not say otherwise; 0: that of all, 1000."""
    specification: ClassVar[Mapping[str, str]] = {}

    # The user's actions

    def on_initialize(self) -> ReturnCode | None:
        """Once, before anything else runs: ports and parameters that are not declared are added here."""
        return OK

    def on_finalize(self) -> ReturnCode | None:
        """Once, at the end."""
        return OK

    def on_startup(self, context: int) -> ReturnCode | None:
        """An execution context starts."""
        return OK

    def on_shutdown(self, context: int) -> ReturnCode | None:
        """An execution context stops."""
        return OK

    def on_activated(self, context: int) -> ReturnCode | None:
        """The component becomes active."""
        return OK

    def on_deactivated(self, context: int) -> ReturnCode | None:
        """The component becomes inactive, or is on its way to the error state."""
        return OK

    def on_aborting(self, context: int) -> ReturnCode | None:
        """The component goes to the error state."""
        return OK

    def on_error(self, context: int) -> ReturnCode | None:
        """Every cycle in the error state."""
        return OK

    def on_reset(self, context: int) -> ReturnCode | None:
        """The component is to leave the error state; anything but RTC_OK keeps it there."""
        return OK

    def on_execute(self, context: int) -> ReturnCode | None:
        """Every cycle in the active state."""
        return OK

    def on_state_update(self, context: int) -> ReturnCode | None:
        """Every cycle in the active state, after `on_execute` of all components of the context."""
        return OK

    def on_rate_changed(self, context: int) -> ReturnCode | None:
        """The rate of an execution context has changed."""
        return OK

    def __init_subclass__(cls, **arguments: Any) -> None:
        super().__init_subclass__(**arguments)
        join_names(cls)
        for name, value in vars(cls).items():
            if _is_declaration(value) and hasattr(Component, name):
                raise RtcError(
                    f"{cls.__name__}.{name}: components have {name!r} themselves; call the attribute otherwise, and "
                    f"give name={name!r}"
                )

    def __init__(self) -> None:
        self.instance_name = ""
        self.properties: dict[str, str] = {}
        self.reporter = Reporter()
        self.configuration = Configuration()
        self.participation: Final = Participation(self)
        self.listeners: Final = Listeners[ActionPoint | ComponentEvent](self._listener_failed)
        self.reads_all = self.writes_all = False
        self.read_all_completion = self.write_all_completion = False
        self._ports: dict[str, Port] = {}
        self._owned: list[ExecutionContext] = []
        self._participating: dict[int, ExecutionContext] = {}
        self._lock = threading.RLock()
        self._alive = False
        self.configure("", {})

    # What it is made of

    @classmethod
    def spec(cls) -> dict[str, str]:
        """The properties that every instance begins with, `conf.default.*` of its declared parameters among them."""
        document = (cls.__doc__ or "").strip().partition("\n")[0] if cls is not Component else ""
        name = cls.type_name or cls.__name__
        spec = {
            "implementation_id": name,
            "type_name": name,
            "description": cls.description or document,
            "version": cls.version,
            "vendor": cls.vendor,
            "category": cls.category,
            "activity_type": cls.activity_type,
            "max_instance": str(cls.max_instance),
            **LANGUAGE,
        }
        if cls.rate:
            spec["exec_cxt.periodic.rate"] = f"{cls.rate:g}"
        for declaration in cls.declarations():
            spec.update(declaration.properties())
        return {**spec, **cls.specification}

    @classmethod
    def declarations(cls) -> tuple[Declaration, ...]:
        """What is declared in the class and its bases, bases first, each in the order of writing."""
        found: dict[str, Declaration] = {}
        for base in reversed(cls.__mro__):
            for name, value in vars(base).items():
                if _is_declaration(value):
                    found[name] = cast(Declaration, value)
                else:
                    found.pop(name, None)
        return tuple(found.values())

    def configure(
        self, instance_name: str, properties: Mapping[str, str], reporter: Reporter | None = None
    ) -> None:
        """Give it its name and properties (over those of its class); once, before `initialize`."""
        if self._alive:
            raise RtcError(f"{self.instance_name} runs already: configure it before initialize")
        self.properties = {**self.spec(), **properties}
        self.instance_name = instance_name or f"{self.properties['type_name']}0"
        self.properties["instance_name"] = self.instance_name
        self.reporter = reporter or self.reporter
        self.configuration = Configuration(
            _sets(self.properties),
            active=self.properties.get("configuration.active_config", ""),
            on_bad_text=self._bad_text,
            on_error=lambda event, error: self.tell_failure(f"a listener of {event.value} raised", error),
        )

    def profile(self) -> ComponentProfile:
        """The component as tools see it."""
        values = self.properties
        return ComponentProfile(
            self.instance_name,
            values["type_name"],
            values["description"],
            values["version"],
            values["vendor"],
            values["category"],
            tuple(port.profile() for port in self.ports),
            dict(values),
        )

    @property
    def log(self) -> logging.Logger:
        """Its logger, whose lines go where rtc.conf says (`logger.*`)."""
        return logging.getLogger(LOGGER_NAME).getChild(self.instance_name.replace(".", "_"))

    # Ports

    @property
    def ports(self) -> tuple[Port, ...]:
        """Its ports, in the order of adding."""
        return tuple(self._ports.values())

    def port(self, name: str) -> Port:
        """The port of that name, with or without `<instance>.` before it. RtcError where there is none."""
        short = name.removeprefix(f"{self.instance_name}.")
        if short not in self._ports:
            raise RtcError(
                f"{self.instance_name} has no port {short!r}; it has {', '.join(self._ports) or 'none'}"
            )
        return self._ports[short]

    def add_port(self, port: Port) -> Port:
        """Add a port, with the configuration that rtc.conf has for it. RtcError where the name is taken."""
        with self._lock:
            if port.name in self._ports:
                raise RtcError(
                    f"{self.instance_name} has a port {port.name!r} already: names of ports are unique"
                )
            port.owner = self
            port.report = self.reporter.take
            port.configuration = port_configuration(self.properties, port)
            self._ports[port.name] = port
        self.listeners.tell(ComponentEvent.ADD_PORT, port)
        return port

    def remove_port(self, port: Port) -> None:
        """End its connections and take it away. Nothing happens where it is not there."""
        with self._lock:
            if self._ports.get(port.name) is not port:
                return
            del self._ports[port.name]
        port.disconnect_all()
        port.deactivate()
        self.listeners.tell(ComponentEvent.REMOVE_PORT, port)

    def read_all(self) -> bool:
        """Read every InPort; whether all had something."""
        had = [port.read_before() for port in self.ports if isinstance(port, ReadBefore)]
        return all(had)

    def write_all(self) -> bool:
        """Write every OutPort; whether all went."""
        went = [port.write_after() for port in self.ports if isinstance(port, WrittenAfter)]
        return all(went)

    # Its life

    @property
    def is_initialized(self) -> bool:
        """Between a successful `initialize` and `exit`."""
        return self._alive

    def initialize(self, contexts: Sequence[ExecutionContext] | None = None) -> ReturnCode:
        """Make what is declared, run `on_initialize`, start the contexts it owns.

        `contexts`: those it is to own; None makes those that its properties ask for. What `on_initialize` answers
        is returned; if it is not RTC_OK, `on_finalize` has run and nothing is left. RtcError where what is declared
        or asked for cannot be; nothing is left then, either.
        """
        if contexts is None:
            contexts = make_contexts(self.properties, reporter=self.reporter)
        with self._lock:
            self._owned = list(contexts)
            self._alive = True
        try:
            for declaration in self.declarations():
                declaration.make(self)
        except BaseException:
            self._alive = False
            self._take_apart()
            raise
        code = self.participation.on_initialize()
        if code is not OK:
            self.participation.on_finalize()
            self._alive = False
            self._take_apart()
            return code
        self.configuration.update()
        for handle, context in enumerate(self._owned):
            context.bind_owner(self.participation, handle)
        for context in self._owned:
            context.start()
        return OK

    def exit(self) -> ReturnCode:
        """End it: out of the active or error state, `on_finalize`, contexts and ports taken apart.

        Returns RTC_ERROR where `on_finalize` failed, PRECONDITION_NOT_MET where it is not running. From inside an
        action of any component, RTC_OK: it ends in a thread of its own, as the action has to return first.
        """
        with self._lock:
            if not self._alive:
                return ReturnCode.PRECONDITION_NOT_MET
            self._alive = False
        if inside_callback():
            threading.Thread(target=self._end, name=f"end of {self.instance_name}").start()
            return OK
        return self._end()

    def _end(self) -> ReturnCode:
        for context in (*self._owned, *self._participating.values()):
            state = context.get_component_state(self.participation)
            if state is LifeCycleState.ACTIVE_STATE:
                context.deactivate_component(self.participation)
            elif state is LifeCycleState.ERROR_STATE:
                context.reset_component(self.participation)
        code = self.participation.on_finalize()
        self._take_apart()
        self.listeners.tell(ComponentEvent.FINALIZED)
        return code if code is OK else ReturnCode.RTC_ERROR

    def _take_apart(self) -> None:
        for context in tuple(self._participating.values()):
            context.remove_component(self.participation)
        for context in self._owned:
            context.unbind_owner(self.participation)
        for port in reversed(self.ports):
            self.remove_port(port)

    # Contexts

    @property
    def owned_contexts(self) -> tuple[ExecutionContext, ...]:
        """The contexts made for it: handles 0, 1, ..."""
        return tuple(self._owned)

    @property
    def participating_contexts(self) -> tuple[ExecutionContext, ...]:
        """Contexts of others that call it: handles from 1000."""
        return tuple(self._participating.values())

    def context_of(self, handle: int) -> ExecutionContext:
        """The context of a handle. RtcError where there is none."""
        if 0 <= handle < len(self._owned):
            return self._owned[handle]
        if handle in self._participating:
            return self._participating[handle]
        raise RtcError(f"{self.instance_name} has no execution context of handle {handle}")

    def handle_of(self, context: object) -> int:
        """The handle of a context; -1 where the component has no part in it."""
        for handle, owned in enumerate(self._owned):
            if owned == context:
                return handle
        return next((handle for handle, other in self._participating.items() if other == context), -1)

    def state(self, context: int = 0) -> LifeCycleState:
        """Where it stands in a context; CREATED_STATE before `initialize` and after `exit`."""
        if not self._alive:
            return LifeCycleState.CREATED_STATE
        return self.context_of(context).get_component_state(self.participation)

    def attach_context(self, context: ExecutionContext) -> int:
        """Take part in `context`, which calls from now on; the handle it is to call with.

        RtcError for one context more than PARTICIPATING_LIMIT: each that is forgotten stays until it is detached.
        """
        with self._lock:
            if len(self._participating) >= PARTICIPATING_LIMIT:
                raise RtcError(
                    f"{self.instance_name} takes part in {PARTICIPATING_LIMIT} execution contexts already"
                )
            handle = next(
                h
                for h in range(PARTICIPATING, PARTICIPATING + len(self._participating) + 1)
                if h not in self._participating
            )
            self._participating[handle] = context
        self.listeners.tell(ComponentEvent.EC_ATTACHED, handle)
        return handle

    def detach_context(self, handle: int) -> ReturnCode:
        """Take part no longer. BAD_PARAMETER for a handle that was not given."""
        with self._lock:
            if self._participating.pop(handle, None) is None:
                return ReturnCode.BAD_PARAMETER
        self.listeners.tell(ComponentEvent.EC_DETACHED, handle)
        return OK

    # What went wrong

    def tell_failure(self, what: str, error: Exception) -> None:
        """A finding: somebody's code in this component failed."""
        self.reporter.failed("component-code-failed", self.instance_name, what, error)

    def _listener_failed(self, point: object, error: Exception) -> None:
        name = " of ".join(
            str(getattr(part, "value", part)) for part in (point if isinstance(point, tuple) else (point,))
        )
        self.tell_failure(f"a listener ({name}) raised", error)

    def _bad_text(self, parameter: BoundParameter[Any], error: Exception) -> None:
        self.reporter.report(
            "bad-parameter-text",
            who=self.instance_name,
            what=f"parameter {parameter.name} was set to {parameter.text!r}",
            why=f"it cannot be converted ({error}); its default {parameter.default!r} counts",
            remedy=f"Set {parameter.name} to a text like {parameter.default!r}.",
            subject=parameter.name,
        )


def _is_declaration(value: object) -> bool:
    return callable(getattr(type(value), "make", None)) and hasattr(type(value), "properties")


def _sets(properties: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """The configuration sets that `conf.<set>.<parameter>` describe."""
    sets: dict[str, dict[str, str]] = {}
    for key, text in properties.items():
        if key.startswith("conf."):
            id_, dot, name = key[len("conf.") :].partition(".")
            values = sets.setdefault(id_, {})
            if dot:
                values[name] = text
    return sets


def port_configuration(properties: Mapping[str, str], port: Port) -> dict[str, str]:
    """The keys of rtc.conf that are meant for a port: those for all of its kind, then those for its name."""
    places: tuple[str, ...]
    if port.port_type is PortType.SERVICE:
        places = ("port.corba.", f"port.corbaport.{port.name}.", f"port.corba.{port.name}.")
    else:
        kind = "inport" if port.port_type is PortType.DATA_IN else "outport"
        places = (f"port.{kind}.dataport.", f"port.{kind}.{port.name}.")
    found: dict[str, str] = {}
    for place in places:
        found.update({key[len(place) :]: text for key, text in properties.items() if key.startswith(place)})
    return found
