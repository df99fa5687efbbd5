"""The pass over components, without threads or time: orders, states, what errors lead to."""

import json
from pathlib import Path
from typing import Any

import pytest

from muros.findings import Finding
from muros.rtc.codes import LifeCycleState, ReturnCode
from muros.rtc.contexts import ContextEvent, ContextEventKind
from muros.rtc.contexts._cycle import Cycle, Member
from muros.rtc.contexts._states import DO, POST_DO, TRANSITIONS, Ask
from tests.rtc.contexts.actors import NO, OK, Actor

TRACES: dict[str, Any] = json.loads(
    (Path(__file__).parents[2] / "vectors/rtc/lifecycle_traces.json").read_text()
)


class Stage:
    """A cycle with its events and findings."""

    def __init__(self, *actors: Actor) -> None:
        self.events: list[ContextEvent] = []
        self.findings: list[Finding] = []
        self.cycle = Cycle(self.events.append, self.findings.append, name=lambda: "stage")
        for actor in actors:
            self.cycle.admit(Member(actor, 0))

    def member(self, actor: Actor) -> Member:
        member = self.cycle.find(actor)
        assert member is not None
        return member

    def ask(self, actor: Actor, ask: Ask) -> ReturnCode:
        return self.cycle.ask(self.member(actor), ask)

    def state(self, actor: Actor) -> str:
        return self.member(actor).state.name


@pytest.mark.parametrize("name", [name for name in TRACES if name != "init_error"])
def test_the_traces_of_openrtm_are_reproduced(name: str) -> None:
    """Callback orders, return codes and states, as captured; `init_error` has no context (see test_component)."""
    told = TRACES[name]
    actor = Actor(returns=told["returns"], raises_in=told["raises_in"])
    stage = Stage(actor)
    cycle = stage.cycle

    def settled() -> str:
        cycle.execute()
        cycle.execute()
        return stage.state(actor)

    actor.on_initialize()
    cycle.startup()
    got: dict[str, Any] = {"after_create": [stage.state(actor), True]}
    got["activate"] = stage.ask(actor, Ask.ACTIVATE).name
    between = stage.state(actor)
    got["state_0.3s_later"] = settled()
    got["state_after_activate"] = told["state_after_activate"]
    assert told["state_after_activate"] in (between, got["state_0.3s_later"])
    got["activate_again"] = stage.ask(actor, Ask.ACTIVATE).name
    got["set_rate_50"] = cycle.rate_changed().name
    got["state_after_set_rate"] = stage.state(actor)
    settled()
    for key, ask in (("deactivate", Ask.DEACTIVATE), ("reset", Ask.RESET)):
        got[key] = stage.ask(actor, ask).name
        got[f"state_after_{key}"] = stage.state(actor)
        settled()
    cycle.shutdown()
    cycle.startup()
    got |= {"stop": "RTC_OK", "start": "RTC_OK"}
    if stage.state(actor) == "ERROR_STATE":
        stage.ask(actor, Ask.RESET)
        cycle.execute()
    got["exit"] = actor.on_finalize().name
    cycle.shutdown()
    assert {**got, "trace": actor.trace} == {
        k: v for k, v in told.items() if k not in ("returns", "raises_in")
    }


def test_every_state_and_ask_is_in_the_table_or_refused() -> None:
    ways = {(state, ask): transition.to for (state, ask), transition in TRANSITIONS.items()}
    inactive, active, error = (LifeCycleState[f"{s}_STATE"] for s in ("INACTIVE", "ACTIVE", "ERROR"))
    assert ways == {
        (inactive, Ask.ACTIVATE): active,
        (active, Ask.DEACTIVATE): inactive,
        (active, Ask.FAIL): error,
        (error, Ask.RESET): inactive,
    }
    for state in (inactive, active, error):
        for ask in Ask:
            actor = Actor()
            stage = Stage(actor)
            stage.member(actor).state = state
            code = stage.ask(actor, ask)
            if (state, ask) in ways:
                assert code is OK
                assert stage.member(actor).state is ways[state, ask]
            else:
                assert code is NO
                assert not actor.calls
                assert stage.member(actor).state is state
    assert set(POST_DO) <= set(DO)


def test_all_execute_before_any_updates_its_state() -> None:
    trace: list[str] = []
    actors = [Actor(name, trace=trace) for name in "abc"]
    for actor in actors:
        for name in ("onExecute", "onStateUpdate"):
            actor.during[name] = lambda actor=actor: trace.append(actor.instance_name)  # type: ignore[misc]
    stage = Stage(*actors)
    for actor in actors:
        stage.ask(actor, Ask.ACTIVATE)
    del trace[:]
    stage.cycle.execute()
    assert [name for name in trace if len(name) == 1] == ["a", "b", "c", "a", "b", "c"]
    assert trace[::2] == ["onExecute"] * 3 + ["onStateUpdate"] * 3


def test_one_that_fails_is_in_error_when_the_pass_ends_and_harms_no_other() -> None:
    trace: list[str] = []
    bad = Actor("bad", returns={"onExecute": "RTC_ERROR"}, trace=trace)
    good = Actor("good", trace=trace)
    stage = Stage(bad, good)
    for actor in (bad, good):
        stage.ask(actor, Ask.ACTIVATE)
    del trace[:]
    stage.cycle.execute()
    assert trace == ["onExecute", "onExecute", "onStateUpdate", "onDeactivated", "onAborting"]
    assert [stage.state(actor) for actor in (bad, good)] == ["ERROR_STATE", "ACTIVE_STATE"]
    stage.cycle.execute()
    assert trace[5:] == ["onError", "onExecute", "onStateUpdate"]


def test_what_a_callback_raises_is_an_error_of_that_component_and_told() -> None:
    actor = Actor("motor", raises_in=["onExecute"])
    stage = Stage(actor)
    stage.ask(actor, Ask.ACTIVATE)
    stage.cycle.execute()
    assert stage.state(actor) == "ERROR_STATE"
    (finding,) = stage.findings
    assert (finding.code, finding.who, finding.subject) == ("rtc-callback-raised", "stage", "motor")
    assert "on_execute of motor failed" in finding.what
    assert finding.why == "RuntimeError: as told"


def test_a_callback_that_wants_to_end_the_program_only_fails() -> None:
    actor = Actor()

    def leave() -> None:
        raise SystemExit(3)

    actor.during["onExecute"] = leave
    stage = Stage(actor)
    stage.ask(actor, Ask.ACTIVATE)
    stage.cycle.execute()
    assert stage.state(actor) == "ERROR_STATE"
    assert stage.findings[0].why == "SystemExit: 3"


def test_an_inactive_component_that_dislikes_the_rate_stays_inactive() -> None:
    """RTC 1.1 has no way from Inactive to Error."""
    actor = Actor(returns={"onRateChanged": "RTC_ERROR"})
    stage = Stage(actor)
    assert stage.cycle.rate_changed() is ReturnCode.RTC_ERROR
    assert stage.state(actor) == "INACTIVE_STATE"
    assert actor.trace == ["onRateChanged"]


def test_one_whose_process_is_gone_is_not_called_again() -> None:
    actor, other = Actor("gone"), Actor("here")
    stage = Stage(actor, other)
    for one in (actor, other):
        stage.ask(one, Ask.ACTIVATE)
    actor.lost = True
    stage.cycle.execute()
    assert stage.cycle.has_lost
    before = len(actor.calls)
    actor.lost = False
    stage.cycle.execute()
    stage.cycle.dismiss(stage.member(actor), running=True)
    assert len(actor.calls) == before
    assert other.count("onExecute") == 2
    assert [finding.code for finding in stage.findings] == ["rtc-member-lost"]


def test_who_goes_is_deactivated_and_shut_down() -> None:
    actor = Actor()
    stage = Stage(actor)
    stage.ask(actor, Ask.ACTIVATE)
    member = stage.member(actor)
    stage.cycle.dismiss(member, running=True)
    assert actor.trace == ["onActivated", "onDeactivated", "onShutdown"]
    assert stage.cycle.members == ()
    stage.cycle.dismiss(member, running=True)
    assert stage.cycle.ask(member, Ask.ACTIVATE) is ReturnCode.BAD_PARAMETER
    assert actor.trace == ["onActivated", "onDeactivated", "onShutdown"]


def test_who_is_here_is_not_admitted_again() -> None:
    actor = Actor()
    stage = Stage(actor)
    handle = actor.attach_context(None)  # type: ignore[arg-type]
    assert not stage.cycle.admit(Member(actor, handle))
    assert actor.attached == {}
    assert len(stage.cycle.members) == 1


def test_observers_are_told_of_changes_once_each() -> None:
    actor = Actor(returns={"onActivated": "RTC_ERROR"})
    stage = Stage(actor)
    stage.cycle.startup()
    stage.ask(actor, Ask.ACTIVATE)
    stage.ask(actor, Ask.RESET)
    stage.cycle.rate_changed()
    stage.cycle.shutdown()
    stage.cycle.dismiss(stage.member(actor), running=False)
    assert [event.kind for event in stage.events] == [
        ContextEventKind.ADMITTED,
        ContextEventKind.STARTUP,
        ContextEventKind.STATE_CHANGED,
        ContextEventKind.STATE_CHANGED,
        ContextEventKind.RATE_CHANGED,
        ContextEventKind.SHUTDOWN,
        ContextEventKind.DISMISSED,
    ]
    failed, reset = stage.events[2:4]
    assert (failed.component, failed.old, failed.new) == (
        actor, LifeCycleState.INACTIVE_STATE, LifeCycleState.ERROR_STATE,
    )  # fmt: skip
    assert reset.new is LifeCycleState.INACTIVE_STATE


def test_a_reset_that_is_refused_changes_nothing() -> None:
    actor = Actor(returns={"onExecute": "RTC_ERROR", "onReset": "BAD_PARAMETER"})
    stage = Stage(actor)
    stage.ask(actor, Ask.ACTIVATE)
    stage.cycle.execute()
    told = len(stage.events)
    assert stage.ask(actor, Ask.RESET) is ReturnCode.RTC_ERROR
    assert stage.state(actor) == "ERROR_STATE"
    assert len(stage.events) == told
