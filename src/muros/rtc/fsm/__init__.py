"""State machines for components, as OMG's FSM4RTC describes them."""

from muros.rtc.fsm._machine import FsmAction, FsmError, FsmEvent, FsmPoint, Machine, State
from muros.rtc.fsm._service import FSM_SERVICE, ExtendedFsmService, fsm_service_of, register_fsm_service
from muros.rtc.fsm._structure import FsmEventProfile, FsmStructure, scxml
from muros.rtc.fsm.declarations import StateMachine
from muros.rtc.fsm.event_port import EventInPort

__all__ = [
    "FSM_SERVICE",
    "EventInPort",
    "ExtendedFsmService",
    "FsmAction",
    "FsmError",
    "FsmEvent",
    "FsmEventProfile",
    "FsmPoint",
    "FsmStructure",
    "Machine",
    "State",
    "StateMachine",
    "fsm_service_of",
    "register_fsm_service",
    "scxml",
]
