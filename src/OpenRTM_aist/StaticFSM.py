"""State machines under their old names: `import OpenRTM_aist.StaticFSM as StaticFSM`."""
# ruff: noqa: N802, N999 (the names are those that components know)

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from muros.rtc.data_types import data_type_of
from muros.rtc.fsm import EventInPort as _EventInPort
from muros.rtc.fsm import ExtendedFsmService, register_fsm_service
from muros.rtc.fsm import Machine as _Machine
from muros.rtc.fsm import State as _State
from OpenRTM_aist._data_ports import InPort

__all__ = [
    "DATA_TYPE",
    "DEEPHISTORY",
    "FSM_SUBSTATE",
    "FSM_TOPSTATE",
    "Event",
    "EventInPort",
    "Link",
    "Machine",
    "State",
    "deephistory",
    "fsm_substate",
    "fsm_topstate",
]

L = TypeVar("L", bound="type[Link]")


class Link(_State):
    """Base of states."""

    is_base = True

    def set_state(self, state: State) -> None:
        """Go there when this method has returned."""
        self.go(state.link, *state.arguments)

    setState = setStateHistory = set_state  # noqa: N815

    def dispatch(self, event: Event) -> None:
        """Have the machine handle an event after this one."""
        self.send(event.name, *event.arguments)

    def rtComponent(self) -> Any:
        return self.machine.component


class State:
    """A state to go to, with what its data is made with."""

    def __init__(self, link: type[Link], *arguments: Any) -> None:
        self.link = link
        self.arguments = arguments


class Event:
    """An event, named by a state's method, with what comes with it."""

    def __init__(self, handler: Callable[..., Any] | str, *arguments: Any) -> None:
        self.name = handler if isinstance(handler, str) else handler.__name__
        self.arguments = arguments


def FSM_TOPSTATE(link: L) -> L:
    """The outermost state."""
    link.within = None
    return link


def FSM_SUBSTATE(superstate: type[Link]) -> Callable[[L], L]:
    """A state inside `superstate`."""

    def place(link: L) -> L:
        link.within = superstate
        return link

    return place


def deephistory(link: L) -> L:
    """A state that goes back to where it was when it was left."""
    link.deep_history = True
    return link


def DATA_TYPE(data: type) -> Callable[[L], L]:
    """What the state keeps."""

    def keep(link: L) -> L:
        link.Data = data
        return link

    return keep


DEEPHISTORY = deephistory
fsm_topstate = FSM_TOPSTATE
fsm_substate = FSM_SUBSTATE


class Machine(_Machine):
    """The machine of a component; it begins at once."""

    def __init__(self, top: type[Link], component: Any = None) -> None:
        super().__init__(top, component)
        behind = getattr(component, "_behind", None)
        if behind is not None:
            self.report = behind.reporter.take
        self.start()

    def run_event(self) -> int:
        """Handle all events that wait."""
        return self.run_events()

    def dispatch(self, event: Any, *arguments: Any) -> bool:
        """Handle an event now."""
        if isinstance(event, Event):
            return super().dispatch(event.name, *event.arguments)
        return super().dispatch(event, *arguments)

    def shutdown(self) -> None:
        """End: the states are left."""
        self.stop()

    def getComp(self) -> Any:
        return self.component


class EventInPort(InPort):
    """The port that a machine's events come in by."""

    def __init__(self, name: str, fsm: Machine, bufsize: int = 64, *more: Any) -> None:
        self._event_port = _EventInPort(name, fsm)
        super(InPort, self).__init__(self._event_port)
        self._value = None
        behind = getattr(fsm.component, "_behind", None)
        if behind is not None:
            register_fsm_service(behind, ExtendedFsmService(fsm, lambda: self._event_port.data_types))

    def bindEvent0(self, name: str, handler: Callable[..., Any]) -> None:
        """Let connections be for the event `name`, which comes without a value."""
        self._event_port.bind(name, handler)

    def bindEvent1(self, name: str, handler: Callable[..., Any], data_type: Any) -> None:
        """Let connections be for the event `name`, which comes with a value like `data_type` (a value or a class)."""
        kind = data_type if isinstance(data_type, (type, str)) else type(data_type)
        self._event_port.bind(name, handler, data_type_of(kind))

    def bindEvent(self, name: str, handler: Callable[..., Any], data_type: Any = None) -> None:
        if data_type is None:
            self.bindEvent0(name, handler)
        else:
            self.bindEvent1(name, handler, data_type)
