"""Event ports: InPorts whose values are events of a state machine."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from muros.rtc.codes import PortStatus, ReturnCode
from muros.rtc.data import ANY_TYPE, AnyDataType, Connection, DataError, DataEvent, DataInPort, same_type
from muros.rtc.data._links import Link, LinkSetup, PushReceiver
from muros.rtc.data._options import DataOptions, OptionError, Stamp
from muros.rtc.data._port import DIRECT
from muros.rtc.data._samples import Sample
from muros.rtc.data._transports import TRANSPORTS
from muros.rtc.data_types import data_type_of
from muros.rtc.fsm._machine import FsmError, FsmEvent, Machine, event_name
from muros.rtc.profiles import ConnectorProfile

__all__ = ["EventInPort"]

EVENT_KEYS: Final = ("fsm_event_name", "dataport.fsm_event_name", "dataport.inport.fsm_event_name")
"""Where a connection says which event its values are; else its name does."""


class EventInPort(DataInPort[Any]):
    """Posts what comes to a state machine, as the event that the connection is for.

    A connection names its event with the property `fsm_event_name`, or has the event's name itself; where only one
    event is bound it needs neither. It is refused where the event is not bound, or has another data type. A value is
    decoded as it comes; the sender is answered BUFFER_FULL while the machine has too many events waiting.
    """

    def __init__(self, name: str, machine: Machine, properties: Mapping[str, str] = {}, **more: Any) -> None:
        super().__init__(name, _ANY, properties, **more)
        self.machine: Final = machine
        self._bindings: dict[str, _Binding] = {}

    def bind(
        self, name: str, event: str | Callable[..., Any] | None = None, data_type: object | None = None
    ) -> None:
        """Let connections be for the event `name`; the machine gets it as `event`, the same name if not given.

        `data_type`: what comes with it (a class of the IDL's, its repository id, a data type) and is its argument;
        None: nothing comes with it, whatever is sent. FsmError: no state of the machine knows the event.
        """
        internal = event_name(event or name)
        if not self.machine.knows(internal):
            raise FsmError(
                f"port {self.full_name}: no state of {self.machine.top.__name__} has a method {internal}"
            )
        codec = None if data_type is None else data_type_of(data_type)
        self._bindings = {**self._bindings, name: _Binding(name, internal, codec)}
        self.machine.listeners.tell(FsmEvent.BIND_FSM_EVENT, name)

    def unbind(self, name: str) -> bool:
        """Refuse connections for that event from now on. False where it was not bound."""
        if name not in self._bindings:
            return False
        self._bindings = {key: value for key, value in self._bindings.items() if key != name}
        self.machine.listeners.tell(FsmEvent.UNBIND_FSM_EVENT, name)
        return True

    @property
    def data_types(self) -> dict[str, str]:
        """The repository ids of what comes with the events that are bound, "" where nothing does."""
        return {
            name: "" if binding.codec is None else binding.codec.repository_id
            for name, binding in self._bindings.items()
        }

    # ---- inside

    def _abilities(self) -> dict[str, str]:
        return {**super()._abilities(), "dataport.dataflow_type": "push"}

    def _receiving_link(self, connection: Connection, options: DataOptions) -> Link:
        binding = self._binding_for(connection.profile)
        if binding.codec is not None:
            connection = replace(connection, codec=binding.codec)
        link = _EventReceiver(
            self._setup(connection, options), self._condition, self._arrivals, self.machine, binding
        )
        if options.interface_type != DIRECT:
            link.offer = TRANSPORTS.push[options.interface_type].offer_inlet(connection, link.put)
        return link

    def _calling_link(self, connection: Connection, options: DataOptions) -> Link:
        raise OptionError(ReturnCode.BAD_PARAMETER, "an event port is not pulled: connect it with push")

    def _binding_for(self, profile: ConnectorProfile) -> _Binding:
        asked = next((text for key in EVENT_KEYS if (text := profile.text(key))), "")
        binding = self._bindings.get(asked or profile.name)
        if binding is None and not asked and len(self._bindings) == 1:
            (binding,) = self._bindings.values()
        if binding is None:
            raise OptionError(
                ReturnCode.BAD_PARAMETER,
                f"no event {asked or profile.name!r} is bound here; say fsm_event_name = one of "
                f"{', '.join(self._bindings) or 'none'}",
            )
        sent = profile.text("dataport.outport.data_type")
        if binding.codec is not None and not same_type(binding.codec.repository_id, sent):
            raise OptionError(
                ReturnCode.BAD_PARAMETER,
                f"event {binding.name} comes with {binding.codec.repository_id}, and {sent} would be sent",
            )
        return binding


@dataclass(frozen=True, slots=True)
class _Binding:
    name: str
    """What connections say."""
    event: str
    """What states have a method for."""
    codec: AnyDataType | None


class _EventReceiver(PushReceiver):
    """Posts what the OutPort brings, instead of storing it."""

    def __init__(
        self,
        setup: LinkSetup,
        condition: threading.Condition,
        arrivals: Iterator[int],
        machine: Machine,
        binding: _Binding,
    ) -> None:
        super().__init__(setup, condition, arrivals)
        self._machine = machine
        self._binding = binding

    def receive(self, sample: Sample) -> PortStatus:
        if self.closed:
            return PortStatus.PORT_ERROR
        arguments: tuple[Any, ...] = ()
        if self._binding.codec is not None:
            if Stamp.ON_RECEIVED in self.options.stamps:
                self._stamp(sample)
            self.tell(DataEvent.ON_RECEIVED, sample)
            try:
                arguments = (self.hand_out(sample),)
            except DataError:
                return PortStatus.PORT_ERROR
        if self._machine.post(self._binding.event, *arguments):
            self.tell(DataEvent.ON_BUFFER_WRITE, sample)
            return PortStatus.PORT_OK
        self.refused += 1
        self.tell(DataEvent.ON_BUFFER_FULL, sample)
        self.tell(DataEvent.ON_RECEIVER_FULL, sample)
        return PortStatus.BUFFER_FULL


class _AnyType:
    """The data type of ports that take every one: values stay what they are, octets stay octets."""

    repository_id = ANY_TYPE
    python_class = object

    def default(self) -> object:
        return None

    def encode(self, value: object, little: bool) -> bytes:
        if isinstance(value, (bytes, bytearray)):
            return bytes(value)
        raise DataError(f"{type(value).__name__} cannot be sent as 'any': the data type must be known")

    def decode(self, octets: bytes, little: bool) -> object:
        return bytes(octets)


_ANY: Final = _AnyType()
