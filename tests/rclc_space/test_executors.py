"""Executors in real time, on every way: LET, a stop from another thread, errors."""

import threading
import time
from typing import Any

import pytest

from muros.rclc import GO_ON, LET, Executor, GuardCondition, one
from tests.rclc_space.ways import PATIENCE, Stage

from std_msgs.msg import Int32

PERIOD = 0.01
LONG = 100.0
"""Seconds that nobody waits: a stop ends it."""


def test_let_as_the_guide_has_it(stage: Stage) -> None:
    """Inputs at the start of a period; nothing leaves before its end."""
    robot, world = stage.node("robot"), stage.node("world")
    motor = robot.publisher(Int32, "motor")
    scans = world.publisher(Int32, "laser")
    laser = robot.subscription(Int32, "laser", None)
    timer = robot.timer(0.001, lambda: None)
    moved: list[int] = []
    world.subscription(Int32, "motor", lambda message: moved.append(message.data))
    left: list[float] = []
    writer: Any = motor._writer
    publish = writer.publish

    def leaves(message: Any) -> bool:
        left.append(control.context.clock())
        return bool(publish(message))

    writer.publish = leaves

    def avoid(scan: Any) -> None:
        assert motor.publish(Int32(data=-scan.data))

    control = Executor(stage.contexts[0], semantics=LET, period=PERIOD, trigger=one(timer))
    control.add(timer)
    control.add(laser, avoid)
    stage.executors[0] = control
    stage.meet(motor, scans)
    for i in range(1, 4):
        stage.publish(scans, Int32(data=i))
        end = time.monotonic() + PATIENCE
        while len(left) < i:
            assert time.monotonic() < end
            control.spin_one_period()
            stage.executors[1].spin_some()
        assert control.period_end is not None
        assert left[i - 1] >= control.period_end, "it left when the period had ended"
        stage.until(lambda: len(moved) == i)  # noqa: B023
    assert moved == [-1, -2, -3]


def test_stop_from_another_thread_ends_a_spin_that_waits(stage: Stage) -> None:
    stage.node("node")
    stage.meet()
    context = stage.contexts[0]
    executor = Executor(context, timeout=LONG)
    executor.add(GuardCondition(context, print))
    for _ in range(5):
        waiting = threading.Event()
        middleware: Any = context.middleware
        wait = type(middleware).wait

        def waits(ms: float, waiting: Any = waiting, middleware: Any = middleware, wait: Any = wait) -> None:
            waiting.set()
            wait(middleware, ms)

        middleware.wait = waits

        def stop(waiting: Any = waiting) -> None:
            waiting.wait(PATIENCE)
            executor.stop()

        other = threading.Thread(target=stop)
        other.start()
        executor.spin()
        other.join(PATIENCE)
        del middleware.wait
    assert context.running


@pytest.mark.parametrize("on_error", [None, GO_ON])
def test_errors_of_callbacks(stage: Stage, on_error: int | None) -> None:
    talker, listener = stage.node("talker"), stage.node("listener")
    publisher = talker.publisher(Int32, "value")
    told: list[str] = []
    stage.contexts[1].on_problem(lambda code, text: told.append(text))
    seen: list[int] = []

    def broken(message: Any) -> None:
        seen.append(message.data)
        raise ValueError("no such place")

    listener.subscription(Int32, "value", broken)
    executor = stage.executors[1] = Executor(stage.contexts[1], on_error=on_error)
    stage.meet(publisher)
    if on_error is None:
        with pytest.raises(ValueError, match="no such place") as caught:
            stage.until(lambda: publisher.publish(Int32(data=1)) and seen)
        assert caught.value.__notes__[0].endswith("broken, the callback of subscription 'value'")
        return
    stage.publish(publisher, Int32(data=1))
    stage.until(lambda: executor.errors)
    assert seen == [1]
    assert told[-1].startswith(
        "broken, the callback of subscription 'value', raised ValueError: no such place (test_"
    )
