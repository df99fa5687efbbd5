"""Event ports: which event a connection is for, and what becomes of values."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from muros.findings import Finding
from muros.rtc.codes import DataPortStatus, ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.data import TRANSPORTS, DataOutPort
from muros.rtc.fsm import (
    EventInPort,
    ExtendedFsmService,
    FsmError,
    FsmEvent,
    Machine,
    StateMachine,
    fsm_service_of,
)
from muros.rtc.profiles import ConnectorProfile
from tests.rtc.data.kit import MemoryTransport, TimedLongType, long
from tests.rtc.fsm.oven import Idle, Operational, Oven, Programmed

OK, BAD = ReturnCode.RTC_OK, ReturnCode.BAD_PARAMETER


@pytest.fixture(autouse=True)
def memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TRANSPORTS.push, "corba_cdr", MemoryTransport())
    monkeypatch.setitem(TRANSPORTS.pull, "corba_cdr", MemoryTransport())


class World:
    def __init__(self) -> None:
        self.findings: list[Finding] = []
        self.machine = Machine(Oven, event_limit=3, report=self.findings.append)
        self.port = EventInPort("event", self.machine, report=self.findings.append)
        self.port.bind("open")
        self.port.bind("minute", Oven.minute, TimedLongType())
        self.port.bind("go", "start")
        self.out = DataOutPort("button", TimedLongType())

    def connect(self, name: str = "wanted", **properties: str) -> ReturnCode:
        asked = {
            "dataport.interface_type": "corba_cdr",
            "dataport.dataflow_type": "push",
            "dataport.subscription_type": "flush",
            **{f"dataport.{key}": value for key, value in properties.items()},
        }
        return self.out.connect(ConnectorProfile(name, "", (self.out, self.port), asked))[0]


@pytest.fixture
def world() -> Iterator[World]:
    world = World()
    yield world
    world.out.disconnect_all()


@pytest.mark.parametrize("interface", ["corba_cdr", "direct"])
def test_values_become_events(world: World, interface: str) -> None:
    assert world.connect(fsm_event_name="minute", interface_type=interface) is OK
    assert world.out.write(long(3))
    assert world.machine.current is None, "nothing happens before the component runs the machine"
    world.machine.run_events()
    assert world.machine.current is Programmed
    assert world.machine.data(Oven).minutes == 3


def test_a_connection_of_an_events_name_is_for_it(world: World) -> None:
    assert world.connect("open") is OK
    assert world.out.write(long(3)), "what comes with an event that has no value is not looked at"
    world.machine.run_events()
    assert [state.__name__ for state in world.machine.path] == ["Oven", "Disabled"]


def test_names_of_connections_and_of_methods_may_differ(world: World) -> None:
    world.machine.dispatch("minute", long(1))
    assert world.connect(fsm_event_name="go") is OK
    world.out.write(long(0))
    world.machine.run_events()
    assert world.machine.path[-1].__name__ == "Cooking"


@pytest.mark.parametrize(
    ("properties", "reason"),
    [
        ({}, "no event 'wanted' is bound here; say fsm_event_name = one of open, minute, go"),
        ({"fsm_event_name": "run_events"}, "no event 'run_events'"),
        ({"fsm_event_name": "minute", "dataflow_type": "pull"}, "not pulled"),
    ],
)
def test_what_is_no_event_is_refused(world: World, properties: dict[str, str], reason: str) -> None:
    assert world.connect(**properties) is BAD
    assert any(reason in finding.why for finding in world.findings)
    assert not world.port.connectors


def test_data_types_must_agree(world: World) -> None:
    class TimedShortType(TimedLongType):
        repository_id = "IDL:RTC/TimedShort:1.0"

    world.out = DataOutPort("button", TimedShortType())
    assert world.connect(fsm_event_name="minute") is BAD
    assert "TimedShort:1.0 would be sent" in world.findings[0].why
    assert world.connect(fsm_event_name="open") is OK


def test_one_event_alone_needs_no_name() -> None:
    world = World()
    for event in ("open", "go"):
        assert world.port.unbind(event)
    assert not world.port.unbind("go")
    assert world.connect() is OK


def test_a_sender_is_told_when_too_much_waits(world: World) -> None:
    world.connect("open")
    assert [world.out.write(long(n)) for n in range(4)] == [True, True, True, False]
    assert world.out.status == [DataPortStatus.SEND_FULL]
    world.machine.run_events()
    assert world.out.write(long(1))


def test_malformed_octets_are_no_event(world: World) -> None:
    world.connect("minute")
    link = world.port.link(world.port.connectors[0].connector_id)
    assert link is not None
    for octets in (b"", b"123", b"x" * 13):
        assert link.put(octets).name == "PORT_ERROR"  # type: ignore[attr-defined]
    assert link.malformed == 3
    assert world.machine.run_events() == 0


def test_its_profile_says_any() -> None:
    properties = World().port.profile().properties
    assert properties["port.port_type"] == "DataInPort"
    assert properties["dataport.data_type"] == properties["data_type"] == "any"
    assert properties["dataport.dataflow_type"] == "push"


def test_what_cannot_be_bound(world: World) -> None:
    heard: list[str] = []
    world.machine.listeners.add(FsmEvent.BIND_FSM_EVENT, heard.append)
    with pytest.raises(FsmError, match="no state of Oven has a method explode"):
        world.port.bind("explode")
    with pytest.raises(FsmError):
        world.port.bind("open", "go")
    world.port.bind("tick")
    assert heard == ["tick"]


class Microwave(Component):
    oven = StateMachine(Oven, minute=TimedLongType())

    def on_execute(self, context: int) -> None:
        self.oven.run_events()


def test_on_a_component() -> None:
    microwave = Microwave()
    with pytest.raises(RtcError, match="on_initialize"):
        microwave.oven.start()
    assert fsm_service_of(microwave) is None
    assert microwave.initialize([]) is OK
    port = microwave.port("event")
    out = DataOutPort("button", TimedLongType())
    asked = {
        "dataport.interface_type": "direct",
        "dataport.dataflow_type": "push",
        "fsm_event_name": "minute",
    }
    assert out.connect(ConnectorProfile("x", "", (port, out), asked))[0] is OK
    assert out.write(long(2))
    assert microwave.participation.on_execute(0) is OK
    assert microwave.oven.path == (Oven, Operational, Programmed)
    service = fsm_service_of(microwave)
    assert isinstance(service, ExtendedFsmService)
    assert service.get_current_state() == "Programmed"
    profiles = {e.name: e.data_type for e in service.get_fsm_structure().event_profiles}
    assert profiles["minute"] == "IDL:RTC/TimedLong:1.0"
    microwave.oven.dispatch("stop")
    assert microwave.oven.current is Idle
    microwave.exit()


def test_a_declared_machine_needs_events_that_there_are() -> None:
    with pytest.raises(RtcError, match="Oven has no event explode"):
        StateMachine(Oven, explode=TimedLongType())
