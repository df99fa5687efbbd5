"""Contexts with their threads: who is called when, what callers are answered, what does not hang.

No test depends on how fast the machine is: they wait for what must happen, up to `SOON`.
"""

import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from muros.findings import Finding
from muros.rtc.codes import LifeCycleState, ReturnCode, RtcError
from muros.rtc.contexts import (
    CONTEXT_TYPES,
    ContextEventKind,
    ContextOptions,
    EventDrivenExecutionContext,
    ExecutionContext,
    ExtTrigExecutionContext,
    MultilayerCompositeEC,
    PeriodicExecutionContext,
    SynchronousExecutionContext,
    inside_callback,
)
from tests.rtc.contexts.actors import NO, OK, Actor

ACTIVE, INACTIVE, ERROR, CREATED = (
    LifeCycleState[f"{s}_STATE"] for s in ("ACTIVE", "INACTIVE", "ERROR", "CREATED")
)
SOON = 10.0
"""Seconds: what has not happened by then is a failure."""
SLOW = 0.02
"""Passes per second, of contexts that nobody can wait for."""


class Stage:
    """Makes contexts, and ends them with the test."""

    def __init__(self) -> None:
        self.contexts: list[ExecutionContext] = []
        self.findings: list[Finding] = []
        self.events: list[Any] = []

    def make(self, kind: type[ExecutionContext], *actors: Actor, rate: float = 1000.0, **options: Any) -> Any:
        context = kind(rate=rate, options=ContextOptions(**options), report=self.findings.append)
        self.contexts.append(context)
        context.on_event(self.events.append)
        for handle, actor in enumerate(actors[:1]):
            context.bind_owner(actor, handle)
        for actor in actors[1:]:
            assert context.add_component(actor) is OK
        assert context.start() is OK
        return context


@pytest.fixture
def stage() -> Iterator[Stage]:
    stage = Stage()
    yield stage
    for context in stage.contexts:
        context.close()


def gate() -> tuple[threading.Event, threading.Event, Callable[[], None]]:
    """A callback that says it has come and waits to be let through."""
    came, go = threading.Event(), threading.Event()

    def callback() -> None:
        came.set()
        assert go.wait(SOON)

    return came, go, callback


def after(count: int, event: threading.Event) -> Callable[[], None]:
    """A callback that sets the event when it has been called so often."""
    left = [count]

    def callback() -> None:
        left[0] -= 1
        if left[0] == 0:
            event.set()

    return callback


@pytest.mark.parametrize("name", list(CONTEXT_TYPES))
def test_a_whole_life_in_every_kind(stage: Stage, name: str) -> None:
    actor = Actor()
    context = stage.make(CONTEXT_TYPES[name], actor)
    executed = threading.Event()
    actor.during["onExecute"] = executed.set
    assert context.is_running()
    assert context.start() is NO
    assert context.get_component_state(actor) is INACTIVE
    assert context.activate_component(actor) is OK
    assert context.get_component_state(actor) is ACTIVE
    assert context.activate_component(actor) is NO
    assert context.reset_component(actor) is NO
    ticks = context.tick()
    assert ticks is (ReturnCode.UNSUPPORTED if isinstance(context, PeriodicExecutionContext) else OK)
    assert executed.wait(SOON)
    assert context.set_rate(50.0) is OK
    assert context.rate == 50.0
    assert context.deactivate_component(actor) is OK
    assert context.get_component_state(actor) is INACTIVE
    assert context.deactivate_component(actor) is NO
    assert context.stop() is OK
    assert context.stop() is NO
    assert context.activate_component(actor) is NO
    context.close()
    assert context.get_component_state(actor) is CREATED
    assert context.start() is NO
    trace = [name for name in actor.trace if name not in ("onExecute", "onStateUpdate")]
    assert trace == ["onStartup", "onActivated", "onRateChanged", "onDeactivated", "onShutdown"]
    assert {handle for _, handle in actor.calls} == {0}
    assert not stage.findings


@pytest.mark.parametrize("kind", [PeriodicExecutionContext, SynchronousExecutionContext])
def test_strangers(stage: Stage, kind: type[ExecutionContext]) -> None:
    context = stage.make(kind, Actor())
    stranger = Actor()
    for operation in (
        context.activate_component,
        context.deactivate_component,
        context.reset_component,
        context.remove_component,
    ):
        assert operation(stranger) is ReturnCode.BAD_PARAMETER
    assert context.get_component_state(stranger) is CREATED
    assert context.set_rate(-1.0) is ReturnCode.BAD_PARAMETER
    assert not stranger.calls
    with pytest.raises(RtcError, match="rate"):
        kind(rate=0)


@pytest.mark.parametrize(
    "kind", [PeriodicExecutionContext, ExtTrigExecutionContext, SynchronousExecutionContext]
)
def test_activation_that_fails_says_so(stage: Stage, kind: type[ExecutionContext]) -> None:
    actor = Actor(returns={"onActivated": "RTC_ERROR", "onReset": "RTC_ERROR"})
    context = stage.make(kind, actor)
    assert context.activate_component(actor) is NO
    assert context.get_component_state(actor) is ERROR
    assert context.reset_component(actor) is ReturnCode.RTC_ERROR
    del actor.returns["onReset"]
    assert context.reset_component(actor) is OK
    assert context.get_component_state(actor) is INACTIVE


def test_a_rate_that_is_disliked(stage: Stage) -> None:
    actor = Actor(returns={"onRateChanged": "RTC_ERROR"})
    context = stage.make(PeriodicExecutionContext, actor)
    context.activate_component(actor)
    assert context.set_rate(50.0) is ReturnCode.RTC_ERROR
    assert context.get_component_state(actor) is ERROR


def test_activation_at_a_low_rate_is_at_once_and_no_error(stage: Stage) -> None:
    """OpenRTM-aist polls once a period, and below 2 Hz always answers RTC_ERROR."""
    first, second = Actor("first"), Actor("second")
    context = stage.make(PeriodicExecutionContext, first, second, rate=SLOW)
    assert context.activate_component(first) is OK
    # The context now sleeps for 50 s until its second pass.
    assert context.activate_component(second) is OK
    assert context.get_component_state(second) is ACTIVE
    assert context.deactivate_component(first) is OK
    assert context.set_rate(SLOW * 2) is OK
    assert first.count("onExecute") == 1
    assert not stage.findings


def test_activation_with_a_slow_callback_is_no_error(stage: Stage) -> None:
    """OpenRTM-aist answers RTC_ERROR after transition_timeout, although the component becomes active."""
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor, activation_timeout=0.0)
    came, go, actor.during["onActivated"] = gate()
    answers: list[ReturnCode] = []
    thread = threading.Thread(target=lambda: answers.append(context.activate_component(actor)))
    thread.start()
    assert came.wait(SOON)
    assert not answers
    go.set()
    thread.join(SOON)
    assert answers == [OK]
    assert not stage.findings


def test_a_callback_that_hangs_is_an_error_and_a_finding(stage: Stage) -> None:
    actor = Actor("motor")
    context = stage.make(PeriodicExecutionContext, actor, patience=0.05, activation_timeout=0.05)
    came, go, actor.during["onActivated"] = gate()
    assert context.activate_component(actor) is ReturnCode.RTC_ERROR
    assert came.is_set()
    (finding,) = stage.findings
    assert finding.code == "rtc-transition-slow"
    assert finding.what == "activate of motor has not ended within 0.05 s"
    assert finding.why == "a callback still runs"
    go.set()


def test_an_activation_that_never_began_is_called_off(stage: Stage) -> None:
    """Its error is true: the component is not activated behind the back of who was told so."""
    busy, actor = Actor("busy"), Actor("motor")
    context = stage.make(PeriodicExecutionContext, busy, actor, patience=0.05, activation_timeout=0.05)
    came, go, busy.during["onExecute"] = gate()
    context.activate_component(busy)
    assert came.wait(SOON)
    assert context.activate_component(actor) is ReturnCode.RTC_ERROR
    assert stage.findings[0].why == "it was called off, as another callback of the context still runs"
    busy.during.clear()
    go.set()
    assert context.deactivate_component(busy) is OK
    assert context.get_component_state(actor) is INACTIVE
    assert "onActivated" not in actor.trace


def test_a_deactivation_that_is_not_waited_for_any_longer_stands(stage: Stage) -> None:
    busy, motor = Actor("busy"), Actor("motor")
    context = stage.make(PeriodicExecutionContext, motor, busy, patience=0.05, deactivation_timeout=0.05)
    assert context.activate_component(motor) is OK
    came, go, busy.during["onExecute"] = gate()
    stopped = threading.Event()
    motor.during["onDeactivated"] = stopped.set
    context.activate_component(busy)
    assert came.wait(SOON)
    assert context.deactivate_component(motor) is ReturnCode.RTC_ERROR
    busy.during.clear()
    go.set()
    assert stopped.wait(SOON)


@pytest.mark.parametrize("kind", [PeriodicExecutionContext, SynchronousExecutionContext])
def test_operations_from_inside_a_callback_do_not_wait_for_it(
    stage: Stage, kind: type[ExecutionContext]
) -> None:
    owner, other = Actor("owner"), Actor("other")
    context = stage.make(kind, owner, other)
    answers: list[ReturnCode] = []
    activated = threading.Event()
    other.during["onActivated"] = activated.set

    def inside() -> None:
        answers.append(context.activate_component(other))
        answers.append(context.activate_component(other))
        answers.append(context.set_rate(99.0))
        assert context.get_component_state(other) is INACTIVE

    owner.during["onActivated"] = inside
    assert context.activate_component(owner) is OK
    assert activated.wait(SOON)
    assert context.deactivate_component(owner) is OK
    assert answers == [OK, NO, OK]
    assert context.rate == 99.0


def test_two_contexts_that_wait_for_each_other_go_on(stage: Stage) -> None:
    """Each deactivates a component of the other from inside a callback, both at the same time."""
    actors = [Actor("a"), Actor("b")]
    contexts = [stage.make(PeriodicExecutionContext, actor) for actor in actors]
    meet = threading.Barrier(2)
    answers: list[ReturnCode] = []

    def cross(mine: Actor, other: int) -> Callable[[], None]:
        def callback() -> None:
            mine.during.clear()
            meet.wait(SOON)
            answers.append(contexts[other].deactivate_component(actors[other]))

        return callback

    actors[0].during["onExecute"] = cross(actors[0], 1)
    actors[1].during["onExecute"] = cross(actors[1], 0)
    ended = [threading.Event(), threading.Event()]
    for index, actor in enumerate(actors):
        actor.during["onDeactivated"] = ended[index].set
        actor.during["onAborting"] = ended[index].set
    # `during` is cleared by the callback, so what it waits for is told by the events of the contexts.
    done = threading.Event()
    states: list[object] = []

    def heard(event: Any) -> None:
        if event.new is INACTIVE:
            states.append(event.component)
            if len(states) == 2:
                done.set()

    for context in contexts:
        context.on_event(heard)
    for context, actor in zip(contexts, actors, strict=True):
        assert context.activate_component(actor) is OK
    assert done.wait(SOON)
    assert answers == [OK, OK]
    assert not stage.findings


def test_asynchronous_transitions_answer_at_once(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor, sync_activation=False, sync_deactivation=False)
    came, go, actor.during["onActivated"] = gate()
    assert context.activate_component(actor) is OK
    assert came.wait(SOON)
    assert context.get_component_state(actor) is INACTIVE
    ended = threading.Event()
    actor.during["onDeactivated"] = ended.set
    go.set()
    while context.get_component_state(actor) is not ACTIVE:
        assert not ended.is_set()
    assert context.deactivate_component(actor) is OK
    assert ended.wait(SOON)


def test_what_is_asked_in_order_is_done_in_order(stage: Stage) -> None:
    """Also where nobody waits: deactivate, then activate, is refused neither time."""
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor)
    done = threading.Event()

    def inside() -> None:
        actor.during.clear()
        actor.during["onActivated"] = done.set
        assert context.deactivate_component(actor) is OK
        assert context.deactivate_component(actor) is NO
        assert context.activate_component(actor) is OK

    actor.during["onExecute"] = inside
    assert context.activate_component(actor) is OK
    assert done.wait(SOON)


def test_an_idle_context_sleeps(stage: Stage) -> None:
    """The thread waits on a condition, and makes no passes."""
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor)
    context.activate_component(actor)
    context.deactivate_component(actor)
    passes = context.statistics.passes
    threading.Event().wait(0.05)
    assert context.statistics.passes == passes


def test_components_in_error_go_on_being_called(stage: Stage) -> None:
    actor = Actor(returns={"onExecute": "RTC_ERROR"})
    context = stage.make(PeriodicExecutionContext, actor)
    often = threading.Event()
    actor.during["onError"] = after(5, often)
    assert context.activate_component(actor) is OK
    assert often.wait(SOON)
    assert context.statistics.passes >= 5


def test_components_come_and_go(stage: Stage) -> None:
    owner, guest = Actor("owner"), Actor("guest")
    context = stage.make(PeriodicExecutionContext, owner)
    assert context.add_component(guest) is OK
    assert context.add_component(guest) is NO
    assert guest.attached == {1000: context}
    assert context.participants == (guest,)
    assert context.owner is owner
    assert context.activate_component(guest) is OK
    assert context.remove_component(owner) is ReturnCode.BAD_PARAMETER
    assert context.remove_component(guest) is OK
    assert context.participants == ()
    assert guest.attached == {}
    trace = [name for name in guest.trace if name not in ("onExecute", "onStateUpdate")]
    assert trace == ["onStartup", "onActivated", "onDeactivated", "onShutdown"]
    assert {handle for _, handle in guest.calls} == {1000}


def test_a_component_that_is_added_twice_from_inside_joins_once(stage: Stage) -> None:
    owner, guest = Actor("owner"), Actor("guest")
    context = stage.make(PeriodicExecutionContext, owner)
    answers: list[ReturnCode] = []
    owner.during["onActivated"] = lambda: answers.extend(context.add_component(guest) for _ in range(2))
    assert context.activate_component(owner) is OK
    assert context.deactivate_component(owner) is OK
    assert answers == [OK, OK]  # neither has been done when it answers
    assert context.participants == (guest,)
    assert guest.attached == {1000: context}


def test_starting_and_stopping_from_many_threads_is_told_in_turn(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor)

    def switch() -> None:
        for _ in range(100):
            context.stop()
            context.start()

    threads = [threading.Thread(target=switch) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(SOON)
    context.stop()
    calls = [name for name, _ in actor.calls]
    assert calls == ["onStartup", "onShutdown"] * (len(calls) // 2)
    assert len(calls) >= 4


def test_a_guest_lets_go_when_the_context_ends(stage: Stage) -> None:
    owner, guest = Actor("owner"), Actor("guest")
    context = stage.make(PeriodicExecutionContext, owner, guest)
    context.activate_component(guest)
    context.close()
    context.close()
    assert guest.attached == {}
    assert guest.calls[-2:] == [("onDeactivated", 1000), ("onShutdown", 1000)]
    assert context.activate_component(guest) is ReturnCode.BAD_PARAMETER
    assert context.add_component(Actor()) is NO
    assert context.set_rate(1.0) is NO


def test_a_component_whose_process_is_gone(stage: Stage) -> None:
    owner, guest = Actor("owner"), Actor("guest")
    context = stage.make(PeriodicExecutionContext, owner, guest)
    again = threading.Event()
    assert context.activate_component(owner) is OK
    assert context.activate_component(guest) is OK
    guest.lost = True
    owner.during["onExecute"] = after(5, again)
    assert again.wait(SOON)
    assert context.participants == ()
    assert [finding.code for finding in stage.findings] == ["rtc-member-lost"]
    assert context.add_component(guest) is ReturnCode.RTC_ERROR
    assert context.get_component_state(owner) is ACTIVE


def test_several_owners_share_a_context_until_the_last_leaves(stage: Stage) -> None:
    first, second = Actor("first"), Actor("second")
    context = stage.make(PeriodicExecutionContext, first)
    context.bind_owner(second, 1)
    assert (context.owner, context.participants) == (first, (second,))
    assert context.activate_component(second) is OK
    context.unbind_owner(first)
    assert not context.is_closed
    assert context.owner is second
    assert first.calls[-1] == ("onShutdown", 0)
    assert context.get_component_state(second) is ACTIVE
    context.unbind_owner(second)
    assert context.is_closed
    assert second.calls[-1] == ("onShutdown", 1)


def test_a_context_may_be_closed_from_inside(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor)
    ended = threading.Event()
    actor.during["onExecute"] = context.close
    actor.during["onShutdown"] = ended.set
    context.activate_component(actor)
    assert ended.wait(SOON)
    assert actor.trace == [
        "onStartup",
        "onActivated",
        "onExecute",
        "onStateUpdate",
        "onDeactivated",
        "onShutdown",
    ]


def test_stopping_keeps_states_and_passes_go_on_after_it(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor)
    assert context.activate_component(actor) is OK
    assert context.stop() is OK
    assert context.get_component_state(actor) is ACTIVE
    passes = len(actor.calls)
    again = threading.Event()
    actor.during["onExecute"] = again.set
    assert len(actor.calls) == passes
    assert context.start() is OK
    assert again.wait(SOON)
    assert context.stop() is OK
    assert context.deactivate_component(actor) is OK  # motors can be stopped in a context that stands still


@pytest.mark.parametrize("kind", [ExtTrigExecutionContext, EventDrivenExecutionContext])
def test_a_tick_is_a_pass_and_those_that_come_too_soon_are_counted(
    stage: Stage, kind: type[ExecutionContext]
) -> None:
    actor = Actor()
    context = stage.make(kind, actor)
    assert context.activate_component(actor) is OK
    came, go, actor.during["onExecute"] = gate()
    assert context.tick() is OK
    assert came.wait(SOON)
    for _ in range(3):
        assert context.tick() is OK
    assert context.statistics.collapsed == 2
    actor.during.clear()
    again = threading.Event()
    actor.during["onStateUpdate"] = after(2, again)
    go.set()
    assert again.wait(SOON)
    assert context.deactivate_component(actor) is OK
    assert (actor.count("onExecute"), context.statistics.passes) == (2, 2)
    context.stop()
    assert context.tick() is NO


def test_a_synchronous_tick_runs_in_the_callers_thread(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(SynchronousExecutionContext, actor)
    threads: list[int] = []
    for name in ("onActivated", "onExecute"):
        actor.during[name] = lambda: threads.append(threading.get_ident())
    assert context.activate_component(actor) is OK
    for _ in range(3):
        assert context.tick() is OK
    assert threads == [threading.get_ident()] * 4
    assert actor.count("onStateUpdate") == 3
    inner: list[ReturnCode] = []
    actor.during["onExecute"] = lambda: inner.append(context.tick())
    assert context.tick() is OK
    assert inner == [NO]
    context.stop()
    assert context.tick() is NO


def test_a_thread_that_meets_another_inside_waits_for_its_request(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(SynchronousExecutionContext, actor)
    context.activate_component(actor)
    came, go, actor.during["onExecute"] = gate()
    ticking = threading.Thread(target=context.tick)
    ticking.start()
    assert came.wait(SOON)
    answers: list[ReturnCode] = []
    asking = threading.Thread(target=lambda: answers.append(context.deactivate_component(actor)))
    asking.start()
    go.set()
    for thread in (ticking, asking):
        thread.join(SOON)
    assert answers == [OK]
    assert actor.trace[-1] == "onDeactivated"


def test_groups_run_side_by_side(stage: Stage) -> None:
    """Each group has its own thread: components of different groups meet within one pass."""
    actors = {name: Actor(name) for name in "abcdo"}
    context = stage.make(MultilayerCompositeEC, *(actors[name] for name in "oabcd"))
    context.set_groups("a,b|c,d")
    meet = threading.Barrier(2)
    threads: dict[str, set[int]] = {name: set() for name in actors}
    often = threading.Event()

    def met(name: str) -> Callable[[], None]:
        def callback() -> None:
            threads[name].add(threading.get_ident())
            if name in "ac" and not often.is_set():
                meet.wait(SOON)

        return callback

    for name, actor in actors.items():
        actor.during["onExecute"] = met(name)
    for name in "abcd":
        actors[name].during["onActivated"] = lambda: None
    actors["o"].during["onActivated"] = lambda: [context.activate_component(actors[name]) for name in "abcd"]
    actors["b"].during["onStateUpdate"] = after(5, often)
    assert context.activate_component(actors["o"]) is OK
    assert often.wait(SOON)
    meet.abort()
    context.stop()
    assert all(len(found) == 1 for found in threads.values())
    assert threads["a"] == threads["b"] != threads["c"] == threads["d"]
    assert threads["o"].isdisjoint(threads["a"] | threads["c"])


def test_a_component_of_a_group_that_fails_is_in_error_alone(stage: Stage) -> None:
    good, bad = Actor("good"), Actor("bad", raises_in=["onExecute"])
    context = stage.make(MultilayerCompositeEC, Actor("owner"), good, bad)
    context.set_groups("good|bad")
    often = threading.Event()
    bad.during["onError"] = after(3, often)
    for actor in (good, bad):
        assert context.activate_component(actor) is OK
    assert often.wait(SOON)
    assert context.get_component_state(bad) is ERROR
    assert context.get_component_state(good) is ACTIVE


def test_observers_hear_of_all_and_one_that_fails_harms_nobody(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor)

    def broken(event: object) -> None:
        raise ValueError("no")

    cancel = context.on_event(broken)
    assert context.activate_component(actor) is OK
    assert [finding.code for finding in stage.findings] == ["rtc-observer-raised"]
    cancel()
    assert context.set_rate(10.0) is OK
    assert context.stop() is OK
    assert [event.kind for event in stage.events] == [
        ContextEventKind.ADMITTED,
        ContextEventKind.STARTUP,
        ContextEventKind.STATE_CHANGED,
        ContextEventKind.RATE_CHANGED,
        ContextEventKind.SHUTDOWN,
    ]
    assert len(stage.findings) == 1


def test_what_the_system_does_not_permit_is_a_finding(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor, cpus=(9999,))
    assert context.activate_component(actor) is OK
    (finding,) = stage.findings
    assert finding.code == "rtc-context-not-scheduled"
    assert "9999" in finding.why


@pytest.mark.parametrize(
    ("rate", "asked", "expected"),
    [(1000.0, None, 1e-4), (100.0, None, 1e-3), (1e6, None, 1e-4), (10.0, None, 0.005), (1000.0, 0.0, 0.005)],
)
def test_threads_that_compute_let_a_context_on_in_time(
    stage: Stage, rate: float, asked: float | None, expected: float
) -> None:
    before = sys.getswitchinterval()
    try:
        sys.setswitchinterval(0.005)
        actor = Actor()
        context = stage.make(PeriodicExecutionContext, actor, rate=rate, switch_interval=asked)
        assert sys.getswitchinterval() == pytest.approx(0.005)
        ran = threading.Event()
        actor.during["onExecute"] = ran.set
        context.activate_component(actor)
        assert ran.wait(SOON)
        assert sys.getswitchinterval() == pytest.approx(expected)
        assert context.set_rate(500.0) is OK
        expected = 0.005 if asked == 0.0 else min(expected, 2e-4)
        assert sys.getswitchinterval() == pytest.approx(expected)
    finally:
        sys.setswitchinterval(before)


def test_who_is_inside_a_callback_knows(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor)
    inside: list[bool] = []
    actor.during["onActivated"] = lambda: inside.append(inside_callback())
    context.activate_component(actor)
    assert inside == [True]
    assert not inside_callback()
    assert context.is_here
    assert not ExecutionContext().is_here


def test_passes_that_take_too_long_are_counted_as_missed(stage: Stage) -> None:
    actor = Actor()
    context = stage.make(PeriodicExecutionContext, actor, rate=1000.0)
    often = threading.Event()
    third = after(3, often)

    def slow() -> None:
        threading.Event().wait(0.01)
        third()

    actor.during["onExecute"] = slow
    context.activate_component(actor)
    assert often.wait(SOON)
    context.stop()
    assert context.statistics.missed >= 9
    assert context.statistics.duration.max >= 0.01
