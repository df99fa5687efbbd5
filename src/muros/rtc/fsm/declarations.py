"""State machines written into a component's class.

class Microwave(Component):
    oven = StateMachine(Oven, minute=TimedLong)      # port "event"; all events of Oven, `minute` with a value

    def on_execute(self, context):
        self.oven.run_events()
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self, overload

from muros.rtc.codes import RtcError
from muros.rtc.fsm._machine import Machine, State
from muros.rtc.fsm._service import ExtendedFsmService, register_fsm_service
from muros.rtc.fsm._structure import events_of
from muros.rtc.fsm.event_port import EventInPort

if TYPE_CHECKING:
    from muros.rtc.component import Component

__all__ = ["StateMachine"]


class StateMachine:
    """A machine in the states inside `top`, and a port that its events come in by.

    `data_types`: what comes with events that have a value, by their names; all others come without. On an instance
    this is the `Machine`; tools can ask for its structure (ExtendedFsmService).
    """

    def __init__(self, top: type[State], *, port: str = "event", **data_types: object) -> None:
        self.top = top
        self.name = port
        self.attribute = ""
        unknown = set(data_types) - set(events_of(top))
        if unknown:
            raise RtcError(f"{top.__name__} has no event {', '.join(sorted(unknown))}")
        self._data_types = data_types

    def __set_name__(self, owner: type, name: str) -> None:
        self.attribute = name

    @overload
    def __get__(self, component: None, owner: type) -> Self: ...
    @overload
    def __get__(self, component: Component, owner: type) -> Machine: ...
    def __get__(self, component: Component | None, owner: type) -> Self | Machine:
        if component is None:
            return self
        raise RtcError(f"{self.attribute} is there once the component runs: use it from on_initialize on")

    def properties(self) -> Mapping[str, str]:
        """Nothing."""
        return {}

    def make(self, component: Any) -> Machine:
        """Make the machine, and its port with all events bound."""
        machine = Machine(self.top, component, report=component.reporter.take)
        port = EventInPort(self.name, machine)
        for event in events_of(self.top):
            port.bind(event, data_type=self._data_types.get(event))
        component.add_port(port)
        register_fsm_service(component, ExtendedFsmService(machine, lambda: port.data_types))
        component.__dict__[self.attribute] = machine
        return machine
