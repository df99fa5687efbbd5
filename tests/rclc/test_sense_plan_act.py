"""The main loop with stages: who runs when, and what becomes of those who are late."""

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from muros.rclc import Context, Executor, all_of
from muros.rclc.host.sense_plan_act import FAWKES_STAGES, ComponentError, SensePlanAct, State

from std_msgs.msg import Int32, String

PATIENCE = 20.0
"""Seconds that nobody waits unless a waking was missed."""
SOON = 1.0
"""Seconds that a loop is patient with components that never finish."""


def until(condition: Callable[[], Any]) -> None:
    """Waits until a condition holds, which other threads bring about."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


def test_stages_run_in_order_and_components_of_one_at_the_same_time() -> None:
    """Both components of a stage are under way at once; the next stage sees what both have done."""
    together = threading.Barrier(2)
    ran: list[str] = []

    def part(name: str) -> Callable[[], None]:
        def run() -> None:
            together.wait(PATIENCE)
            ran.append(name)

        return run

    robot = SensePlanAct(patience=PATIENCE)
    for stage in reversed(robot.stages):
        robot.add(stage, part(f"{stage} 1"), f"{stage} 1")
        robot.add(stage, part(f"{stage} 2"), f"{stage} 2")
    robot.run(turns=3)
    assert len(ran) == 18
    for turn in range(3):
        for place, stage in enumerate(("sense", "plan", "act")):
            at = 6 * turn + 2 * place
            assert sorted(ran[at : at + 2]) == [f"{stage} 1", f"{stage} 2"]


def test_components_may_run_one_after_the_other_in_the_loops_thread() -> None:
    ran: list[tuple[str, str]] = []

    def note(name: str) -> Callable[[], None]:
        return lambda: ran.append((name, threading.current_thread().name))

    robot = SensePlanAct(FAWKES_STAGES, patience=PATIENCE)
    for stage in FAWKES_STAGES:
        for name in ("a", "b"):
            robot.add(stage, note(f"{stage} {name}"), f"{stage} {name}", parallel=False)
    robot.loop()
    assert ran == [(f"{stage} {name}", "MainThread") for stage in FAWKES_STAGES for name in ("a", "b")]


def test_a_barrier_is_passed_when_all_in_it_have_finished() -> None:
    ran: list[str] = []
    release = threading.Event()

    def localise() -> None:
        assert release.wait(PATIENCE)
        ran.append("localise")

    def find_path() -> None:
        ran.append("find_path")

    def look() -> None:
        ran.append("look")
        release.set()

    robot = SensePlanAct(["plan", "act"], patience=PATIENCE)
    robot.add("plan", localise)
    robot.add("plan", find_path, after=[localise])
    robot.add("plan", look)
    robot.add("act", lambda: ran.append("drive"), "drive", after=["find_path", localise])
    with robot:
        for _ in range(5):
            release.clear()
            robot.loop()
    assert ran == ["look", "localise", "find_path", "drive"] * 5


def test_who_is_late_is_told_left_alone_and_back_when_he_has_finished() -> None:
    problems: list[tuple[int, str]] = []
    release = threading.Event()
    drives: list[int] = []

    def camera() -> None:
        assert release.wait(PATIENCE)

    robot = SensePlanAct(patience=SOON, on_problem=lambda code, text: problems.append((code, text)))
    slow = robot.add("sense", camera)
    plan = robot.add("plan", lambda: None, "plan", after=[camera])
    robot.add("act", lambda: drives.append(1), "drive", parallel=False)
    for _ in range(3):
        robot.loop()
    assert slow.state is State.LATE
    assert (slow.turns, slow.missed) == (0, 3)
    assert (plan.turns, plan.missed) == (0, 3)
    assert len(drives) == 3
    said = [text for code, text in problems if code == 54]
    assert said[0] == (
        "component 'camera' of stage 'sense' has not finished within 1 s. The loop goes on without it until it has."
    )
    assert (
        said[1:]
        == ["component 'plan' of stage 'plan' was left out of this turn: at its barrier 'camera' is late."]
        * 3
    )
    release.set()
    until(lambda: slow.state is State.IDLE)
    robot.patience = PATIENCE
    robot.loop()
    assert (slow.turns, slow.missed, plan.turns) == (2, 3, 1)
    robot.close()


def test_who_waits_at_a_barrier_of_his_own_stage_when_patience_ends_is_left_out() -> None:
    problems: list[str] = []
    release = threading.Event()
    robot = SensePlanAct(["plan"], patience=SOON, on_problem=lambda code, text: problems.append(text))
    first = robot.add("plan", lambda: release.wait(PATIENCE), "first")
    second = robot.add("plan", lambda: None, "second", after=[first])
    third = robot.add("plan", lambda: None, "third", after=[second], parallel=False)
    robot.loop()
    assert [first.state, second.state, third.state] == [State.LATE, State.LEFT_OUT, State.LEFT_OUT]
    assert (second.turns, third.turns) == (0, 0)
    assert len(problems) == 3
    release.set()
    until(lambda: first.state is State.IDLE)
    robot.patience = PATIENCE
    robot.loop()
    assert [part.turns for part in (first, second, third)] == [2, 1, 1]
    robot.close()


@pytest.mark.parametrize("parallel", [True, False])
def test_what_a_component_raises_ends_the_loop(parallel: bool) -> None:
    robot = SensePlanAct(patience=PATIENCE)
    robot.add("plan", lambda: 1 // 0, "divide", parallel=parallel)
    acted = robot.add("act", lambda: None, "act")
    with pytest.raises(
        ComponentError, match="component 'divide' of stage 'plan': ZeroDivisionError"
    ) as caught:
        robot.run()
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    assert caught.value.component.turns == 1
    assert acted.turns == 0


def test_a_loop_that_keeps_going_tells_what_was_raised() -> None:
    problems: list[str] = []
    robot = SensePlanAct(
        patience=PATIENCE, keep_going=True, on_problem=lambda code, text: problems.append(text)
    )
    robot.add("plan", lambda: 1 // 0, "divide")
    acted = robot.add("act", lambda: None, "act")
    robot.run(0.001, turns=2)
    assert acted.turns == 2
    assert len(problems) == 2
    assert "component 'divide' of stage 'plan': ZeroDivisionError" in problems[0]


def test_stop_ends_the_loop_from_a_component_and_from_another_thread() -> None:
    robot = SensePlanAct(["act"], patience=PATIENCE)

    def count() -> None:
        if robot.turns == 4:
            robot.stop()

    robot.add("act", count)
    robot.run(0.001)
    assert robot.turns == 5
    idle = SensePlanAct(["act"], patience=PATIENCE)
    begun = threading.Event()
    idle.add("act", begun.set, "begin")

    def end() -> None:
        assert begun.wait(PATIENCE)
        idle.stop()

    thread = threading.Thread(target=end)
    thread.start()
    idle.run(3600.0)
    thread.join(PATIENCE)
    assert idle.turns == 1


def test_executors_are_components() -> None:
    """The pipeline of the documentation: three executors, the first of which waits for both sensors."""
    context = Context("local:")
    node = context.node("robot")
    laser, imu = node.publisher(Int32, "laser"), node.publisher(Int32, "imu")
    plan, act = node.publisher(String, "plan"), node.publisher(String, "act")
    ran: list[str] = []
    sensed: dict[str, int] = {}

    def keep(name: str) -> Callable[[Any], None]:
        return lambda msg: sensed.__setitem__(name, msg.data)

    on_laser = node.subscription(Int32, "laser", keep("laser"))

    def on_imu(msg: Any) -> None:
        sensed["imu"] = msg.data
        ran.append(f"sensed {sensed}")
        plan.publish(String(data="go"))

    sense = Executor(context, trigger=all_of())
    sense.add(on_laser)
    sense.add(node.subscription(Int32, "imu", on_imu))

    def on_plan(msg: Any) -> None:
        ran.append("planned")
        act.publish(msg)

    def on_act(msg: Any) -> None:
        ran.append("acted")
        context.close()

    planning = Executor(context)
    planning.add(node.subscription(String, "plan", on_plan))
    acting = Executor(context)
    acting.add(node.subscription(String, "act", on_act))
    robot = SensePlanAct(patience=PATIENCE)
    robot.add("sense", sense)
    robot.add("plan", planning)
    robot.add("act", acting)
    assert laser.publish(Int32(data=1))
    robot.loop()
    assert not ran  # nothing from the IMU
    assert imu.publish(Int32(data=2))
    robot.run()
    assert ran == ["sensed {'laser': 1, 'imu': 2}", "planned", "acted"]


def test_wrong_use_is_said() -> None:
    for stages in ("sense", [], ["act", "act"]):
        with pytest.raises(ValueError, match="stages are names"):
            SensePlanAct(stages)
    with pytest.raises(ValueError, match="patience is 0"):
        SensePlanAct(patience=0)
    robot = SensePlanAct()
    late = robot.add("act", lambda: None, "late")
    with pytest.raises(ValueError, match="there is no stage 'think', only sense, plan, act"):
        robot.add("think", lambda: None)
    with pytest.raises(ValueError, match="there is a component 'late' already"):
        robot.add("plan", lambda: None, "late")
    with pytest.raises(ValueError, match="'early' of stage 'sense' cannot wait for 'late', which runs later"):
        robot.add("sense", lambda: None, "early", after=[late])
    with pytest.raises(ValueError, match="names 'nobody', which was not added before"):
        robot.add("act", lambda: None, "x", after=["nobody"])
    with pytest.raises(TypeError, match="a component is a function or an executor"):
        robot.add("act", 5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="a policy is made by"):
        robot.add("act", lambda: None, "x", policy="fifo")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="period is 0"):
        robot.run(0)
