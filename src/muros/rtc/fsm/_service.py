"""ExtendedFsmService: what tools ask of a component's state machine. FSM4RTC 1.0, 7.2.4.2.

The model of the SDO service; its servant is in `muros.rtc.corba`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final
from weakref import WeakKeyDictionary

from muros.rtc.codes import ReturnCode
from muros.rtc.fsm._machine import FsmEvent, Machine
from muros.rtc.fsm._structure import FsmEventProfile, FsmStructure, events_of, scxml

__all__ = ["FSM_SERVICE", "ExtendedFsmService", "fsm_service_of", "register_fsm_service"]

FSM_SERVICE: Final = "IDL:omg.org/RTC/ExtendedFsmService:1.0"
"""The interface that tools ask a component for (`get_sdo_service`)."""


class ExtendedFsmService:
    """Tells of one machine. `data_types()` gives the repository ids of what comes with events, by the events' names."""

    def __init__(self, machine: Machine, data_types: Callable[[], dict[str, str]] = dict) -> None:
        self.machine: Final = machine
        self._data_types = data_types

    def get_current_state(self) -> str:
        """The innermost state that the machine is in; "" before it has begun. Any thread."""
        current = self.machine.current
        return current.__name__ if current is not None else ""

    def get_fsm_structure(self) -> FsmStructure:
        """The machine's structure."""
        structure = self._structure()
        self.machine.listeners.tell(FsmEvent.GET_FSM_STRUCTURE, structure)
        return structure

    def set_fsm_structure(self, structure: FsmStructure) -> ReturnCode:
        """RTC_OK for the structure that it has; UNSUPPORTED for others: what states do is written in their classes."""
        own = self._structure()
        if structure.structure.split() != own.structure.split() or set(structure.event_profiles) != set(
            own.event_profiles
        ):
            return ReturnCode.UNSUPPORTED
        self.machine.listeners.tell(FsmEvent.SET_FSM_STRUCTURE, structure)
        return ReturnCode.RTC_OK

    def _structure(self) -> FsmStructure:
        types = self._data_types()
        top = self.machine.top
        events = dict.fromkeys([*events_of(top), *types])
        return FsmStructure(
            top.__name__, scxml(top), tuple(FsmEventProfile(name, types.get(name, "")) for name in events)
        )


_services: WeakKeyDictionary[object, ExtendedFsmService] = WeakKeyDictionary()


def register_fsm_service(component: object, service: ExtendedFsmService) -> None:
    """Let tools reach `service` through the component."""
    _services[component] = service


def fsm_service_of(component: object) -> ExtendedFsmService | None:
    """The component's, if it has a state machine."""
    return _services.get(component)
