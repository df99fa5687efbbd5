"""State machines over CORBA: what rtfsm and editors ask of a component that is one."""

from collections.abc import Iterator
from typing import Any

import pytest

from muros.rtc import Component
from muros.rtc.corba import Orb, set_up
from muros.rtc.corba._conversion import texts_of
from muros.rtc.corba._stubs import RTC
from muros.rtc.fsm import FSM_SERVICE, State, StateMachine


class Top(State):
    """The whole."""

    def on_init(self) -> None:
        self.go(Closed)

    def turn(self) -> None:
        """An event."""


class Closed(Top):
    """Its part."""


class Door(Component):
    """Opens and closes."""

    machine = StateMachine(Top)


@pytest.fixture
def service(orb: Orb) -> Iterator[Any]:
    objects = set_up(orb)
    component = Door()
    component.configure("Door0", {})
    assert component.initialize() == 0
    reference = objects.offer(component)
    before = orb.servants
    yield reference.get_sdo_service(FSM_SERVICE)._narrow(RTC.ExtendedFsmService)
    component.exit()
    objects.withdraw(component)
    assert not set(orb.servants) & set(before)


def test_the_structure_is_told(service: Any) -> None:
    code, structure = service.get_fsm_structure()
    assert code == RTC.RTC_OK
    assert structure.name == "Top"
    assert "<scxml" in structure.structure
    assert "turn" in [event.name for event in structure.event_profiles]
    assert texts_of(structure.properties) == {"fsm_structure.format": "scxml"}
    assert isinstance(service.get_current_state(), str)


def test_the_structure_cannot_be_changed(service: Any) -> None:
    _, structure = service.get_fsm_structure()
    assert service.set_fsm_structure(structure) == RTC.RTC_OK
    structure.structure = "<scxml/>"
    assert service.set_fsm_structure(structure) == RTC.UNSUPPORTED


def test_the_service_is_among_the_profiles(orb: Orb, service: Any) -> None:
    objects = set_up(orb)
    component = Door()
    component.configure("Door1", {})
    assert component.initialize() == 0
    reference = objects.offer(component)
    (profile,) = reference.get_service_profiles()
    assert (profile.id, profile.interface_type) == (FSM_SERVICE, FSM_SERVICE)
    assert reference.get_service_profile(FSM_SERVICE).service._is_equivalent(profile.service)
    component.exit()
    objects.withdraw(component)
