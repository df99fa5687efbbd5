"""State machines: where events go, what is left and entered, what happens to what cannot be."""

from __future__ import annotations

import threading
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from muros.findings import Finding
from muros.rtc.codes import ReturnCode
from muros.rtc.fsm import (
    ExtendedFsmService,
    FsmAction,
    FsmError,
    FsmEvent,
    FsmEventProfile,
    FsmStructure,
    Machine,
    State,
    scxml,
)
from tests.rtc.data.kit import long
from tests.rtc.fsm.oven import Cooking, Disabled, Idle, Operational, Oven, Programmed, log


@pytest.fixture
def findings() -> list[Finding]:
    return []


@pytest.fixture
def oven(findings: list[Finding]) -> Machine:
    log.clear()
    return Machine(Oven, "the component", report=findings.append)


def test_a_meal_is_cooked(oven: Machine, findings: list[Finding]) -> None:
    assert oven.current is None
    oven.post("minute", long(1))
    assert oven.run_events() == 1
    assert list(oven.path) == [Oven, Operational, Programmed], (
        "the state that Idle went to had the event, too"
    )
    assert oven.data(Oven).minutes == 1
    oven.dispatch(Oven.minute, long(1))
    for event in ("start", "tick", "open"):
        assert oven.dispatch(event)
    assert oven.current is Disabled
    oven.dispatch("minute", long(5))
    assert oven.dispatch("close")
    assert list(oven.path[1:]) == [Operational, Programmed, Cooking], (
        "where it was before the door was opened"
    )
    assert oven.run_events() == 0
    oven.dispatch("tick")
    assert oven.current is Idle
    assert log == [
        "ready", "heat on", "heat off", "opened", "closed", "heat on", "hum", "heat off", "ready",
    ]  # fmt: skip
    assert findings == []


def test_an_event_goes_to_the_nearest_state_that_knows_it(oven: Machine) -> None:
    for event, arguments in (("minute", (long(3),)), ("start", ()), ("stop", ())):
        oven.dispatch(event, *arguments)
    assert oven.current is Idle
    assert oven.data(Oven).minutes == 0
    oven.dispatch("stop")
    assert log[-2:] == ["ready", "ready"], "a state that is gone to again is left and entered"


def test_an_event_that_nobody_knows_is_told(oven: Machine, findings: list[Finding]) -> None:
    assert not oven.dispatch("defrost")
    assert findings[0].code == "fsm-event-unknown"
    assert "Idle" in findings[0].what
    for name in ("go", "on_exit", "_path", "machine", "data"):
        assert not oven.dispatch(name), "what all states have is no event"
        assert not oven.knows(name)
    assert oven.knows("tick")


def test_events_wait_up_to_a_limit(findings: list[Finding]) -> None:
    machine = Machine(Oven, event_limit=2, report=findings.append)
    assert [machine.post("open"), machine.post("close"), machine.post("open")] == [True, True, False]
    assert findings[0].code == "fsm-events-dropped"
    assert machine.run_events() == 2
    assert machine.current is Idle


def test_events_posted_meanwhile_come_the_next_time() -> None:
    class Top(State):
        def again(self) -> None:
            self.machine.post("again")

    machine = Machine(Top)
    machine.post("again")
    assert [machine.run_events(), machine.run_events()] == [1, 1]


def test_threads_may_post(oven: Machine) -> None:
    threads = [threading.Thread(target=lambda: [oven.post("tick") for _ in range(20)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10)
    assert oven.run_events() == 80


def test_stopping_leaves_all_states(oven: Machine) -> None:
    oven.dispatch("open")
    oven.post("close")
    oven.stop()
    assert oven.current is None
    assert log[-1] == "closed"
    with pytest.raises(FsmError, match="no state, not in Oven"):
        oven.data(Oven)
    assert oven.run_events() == 0
    assert oven.current is Idle, "it remembers what Operational was in"


def test_what_a_state_raises_reaches_the_component() -> None:
    class Top(State):
        def fail(self) -> None:
            raise ValueError("broken")

        def fine(self) -> None: ...

    machine = Machine(Top)
    for event in ("fail", "fine"):
        machine.post(event)
    with pytest.raises(ValueError, match="broken"):
        machine.run_events()
    assert machine.current is Top
    assert machine.run_events() == 1, "the events behind it stay"


def test_what_cannot_be_is_refused(oven: Machine) -> None:
    class Lost(State, within=None):
        def on_init(self) -> None:
            self.go(Oven)

    class Endless(State):
        def turn(self) -> None:
            self.send("turn")

    with pytest.raises(FsmError, match="needs the outermost state"):
        Machine(Idle)
    with pytest.raises(FsmError, match="on_init of Lost goes to Oven"):
        Machine(Lost).start()
    with pytest.raises(FsmError, match="without end"):
        Machine(Endless).dispatch("turn")
    oven.start()
    oven._pending = (Endless, ())
    with pytest.raises(FsmError, match="Endless is no state of the machine of Oven"):
        oven.dispatch("tick")


def test_data_is_made_with_what_go_was_given() -> None:
    class Top(State):
        def call(self, number: str) -> None:
            self.go(Calling, number)

    class Calling(State, within=Top):
        class Data:
            def __init__(self, number: str) -> None:
                self.number = number

        def hang_up(self) -> None:
            assert self.data().number == "12"
            assert self.component == "phone"
            self.go(Top)

    machine = Machine(Top, "phone")
    machine.dispatch("call", "12")
    machine.dispatch("hang_up")
    assert machine.path == (Top,)


def test_listeners_hear_what_happens(oven: Machine, findings: list[Finding]) -> None:
    heard: list[object] = []
    for action in FsmAction:
        oven.listeners.add(
            ("PRE", action), lambda *names, action=action: heard.append((action.rtc_name, *names))
        )
    oven.listeners.add(("POST", FsmAction.STATE_CHANGE), lambda *names: heard.append(("changed", *names)))
    oven.listeners.add(("POST", FsmAction.ENTRY), lambda name: 1 / 0)
    oven.start()
    heard.clear()
    oven.dispatch("open")
    assert heard == [
        ("onStateChange", "Idle"),
        ("onExit", "Idle"),
        ("onExit", "Operational"),
        ("onEntry", "Disabled"),
        ("onInit", "Disabled"),
        ("changed", "Idle", "Disabled"),
    ]
    assert {f.code for f in findings} == {"listener-failed"}


class TestStructure:
    def test_as_scxml(self) -> None:
        name = "{http://www.w3.org/2005/07/scxml}"
        root = ElementTree.fromstring(scxml(Oven))
        assert root.get("initial") == "Oven"
        states = {e.get("id"): e for e in root.iter(f"{name}state")}
        assert list(states) == ["Oven", "Disabled", "Operational", "Idle", "Programmed", "Cooking"]
        assert [e.get("id") for e in states["Operational"].findall(f"{name}state")] == ["Idle", "Programmed"]

        def transitions(state: str) -> dict[str | None, str | None]:
            return {t.get("event"): t.get("target") for t in states[state].findall(f"{name}transition")}

        assert transitions("Operational") == {"open": "Disabled", "stop": "Idle"}
        assert transitions("Disabled") == {"close": "Operational.history"}
        assert transitions("Programmed") == {"minute": None, "start": "Cooking"}
        initial = states["Operational"].find(f"{name}initial/{name}transition")
        assert initial is not None
        assert initial.get("target") == "Idle"

    def test_states_made_without_source_have_no_targets(self) -> None:
        namespace: dict[str, object] = {"State": State}
        exec("class Made(State):\n def turn(self): self.go(Made)\n", namespace)
        made = namespace["Made"]
        assert isinstance(made, type)
        assert '<transition event="turn" />' in scxml(made)

    def test_the_service_tells_and_refuses_to_change_it(self, oven: Machine) -> None:
        service = ExtendedFsmService(oven, lambda: {"minute": "IDL:RTC/TimedLong:1.0"})
        heard: list[object] = []
        for event in (FsmEvent.GET_FSM_STRUCTURE, FsmEvent.SET_FSM_STRUCTURE):
            oven.listeners.add(event, heard.append)
        assert service.get_current_state() == ""
        oven.start()
        assert service.get_current_state() == "Idle"
        structure = service.get_fsm_structure()
        assert structure.name == "Oven"
        assert structure.properties == {"fsm_structure.format": "scxml"}
        assert structure.event_profiles[:3] == (
            FsmEventProfile("open"),
            FsmEventProfile("close"),
            FsmEventProfile("minute", "IDL:RTC/TimedLong:1.0"),
        )
        assert service.set_fsm_structure(structure) is ReturnCode.RTC_OK
        assert service.set_fsm_structure(FsmStructure("Oven", "<scxml/>")) is ReturnCode.UNSUPPORTED
        other_events = replace(structure, event_profiles=structure.event_profiles[1:])
        assert service.set_fsm_structure(other_events) is ReturnCode.UNSUPPORTED
        assert heard == [structure, structure]
