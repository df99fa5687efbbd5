"""State machines over CORBA: what tools ask of a component that is one. FSM4RTC 1.0, 7.2.4.2."""

from __future__ import annotations

from typing import Any, Final

from muros.rtc.corba._conversion import texts_of, to_nv_list, to_return_code
from muros.rtc.corba._stubs import RTC, RTC__POA
from muros.rtc.fsm import ExtendedFsmService, FsmEventProfile, FsmStructure

__all__ = ["FsmServant"]


class FsmServant(RTC__POA.ExtendedFsmService):  # type: ignore[misc]
    """RTC::ExtendedFsmService of a component's state machine."""

    def __init__(self, service: ExtendedFsmService) -> None:
        self.service: Final = service

    def get_current_state(self) -> str:
        return self.service.get_current_state()

    def get_fsm_structure(self) -> tuple[Any, Any]:
        found = self.service.get_fsm_structure()
        events = [RTC.FsmEventProfile(one.name, one.data_type) for one in found.event_profiles]
        return RTC.RTC_OK, RTC.FsmStructure(found.name, found.structure, events, to_nv_list(found.properties))

    def set_fsm_structure(self, fsm_structure: Any) -> Any:
        given = FsmStructure(
            fsm_structure.name,
            fsm_structure.structure,
            tuple(FsmEventProfile(one.name, one.data_type) for one in fsm_structure.event_profiles),
            texts_of(fsm_structure.properties),
        )
        return to_return_code(self.service.set_fsm_structure(given))
