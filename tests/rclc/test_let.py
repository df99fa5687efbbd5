"""Logical execution time: inputs at the start of a period, outputs at its end, and what follows when one is late."""

import gc
import os
import random
import sys
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any

import pytest

import muros.rclc
from muros.interfaces import message as message_class
from muros.rclc import (
    ALWAYS,
    CANCEL_CURRENT,
    CANCEL_NEXT,
    CANCEL_WITHOUT_OUTPUT,
    GO_ON,
    LET,
    LOW_PRIORITY,
    RCLCPP,
    CapacityError,
    Executor,
    GuardCondition,
    Qos,
    RclError,
    always,
    one,
)
from muros.rclc.let import OVERRUN, Task
from muros.space import Topic
from tests.client.world import World
from tests.rclc.test_rclc import Board
from tests.rclc.virtual import Bench, InSpace

from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32

PERIOD = 10
"""Milliseconds."""


class Heard:
    """What leaves on topics of a space, and when: (ms since the start, topic, bytes)."""

    def __init__(self, bench: InSpace, *topics: str) -> None:
        self.bench = bench
        self.start = bench.now
        self.all: list[tuple[int, str, bytes]] = []
        self._participant = bench._space.participant("observer")
        for topic in topics:
            self._participant.reader(
                Topic(f"rt/{topic}", "std_msgs::msg::dds_::Int32_"), on_data=self._taker(topic)
            )

    def values(self) -> list[tuple[int, str, int]]:
        """The same with numbers."""
        return [(at, topic, int.from_bytes(data, "little", signed=True)) for at, topic, data in self.all]

    def _taker(self, topic: str) -> Callable[[Any], None]:
        def take(reader: Any) -> None:
            while (sample := reader.take()) is not None:
                self.all.append((self.bench.now - self.start, topic, bytes(sample.data)))

        return take


class Plan:
    """An executor with LET whose timers, in the order given, each take so many ms and publish the time."""

    def __init__(self, local: InSpace, *durations: int, lets: tuple[float, ...] = (), **options: Any) -> None:
        self.local = local
        self.durations = list(durations)
        self.heard = Heard(local, *[f"out_{i}" for i in range(len(durations))])
        self.calls: list[tuple[int, int]] = []
        node = local.context.node("node")
        self.executor = local.executor(semantics=LET, period=PERIOD / 1000, **options)
        self.publishers = [node.publisher(Int32, f"out_{i}") for i in range(len(durations))]
        for i in range(len(durations)):
            self.executor.add(node.timer(0, self._caller(i)), let=lets[i] if lets else 0)

    def run(self, periods: int) -> None:
        """So many periods."""
        for _ in range(periods):
            self.executor.spin_one_period()

    def _caller(self, i: int) -> Callable[[], None]:
        def call() -> None:
            at = self.local.now - self.heard.start
            self.calls.append((at, i))
            self.publishers[i].publish(Int32(data=at))
            self.local.take(self.durations[i])

        return call


def test_outputs_leave_at_the_end_of_the_period_in_the_order_of_adding(local: InSpace) -> None:
    plan = Plan(local, 2, 3, 1)
    plan.run(2)
    assert plan.calls == [(0, 0), (2, 1), (5, 2), (10, 0), (12, 1), (15, 2)]
    assert plan.heard.values() == [
        (10, "out_0", 0), (10, "out_1", 2), (10, "out_2", 5),
        (20, "out_0", 10), (20, "out_1", 12), (20, "out_2", 15),
    ]  # fmt: skip
    assert plan.executor.overruns == 0
    assert [task.state for task in plan.executor.tasks] == ["INACTIVE"] * 3


def test_inputs_are_those_of_the_start(local: InSpace) -> None:
    """What comes while callbacks run, or between two periods, waits for the next start."""
    publisher = local.talker.node("talker").publisher(Int32, "in")
    node = local.context.node("node")
    got: list[tuple[int, int]] = []
    executor = local.executor(semantics=LET, period=0.01)
    executor.add(
        node.timer(0, lambda: publisher.publish(Int32(data=7)) and local.context.middleware.spin_once())
    )
    executor.add(node.subscription(Int32, "in", lambda message: got.append((local.now, message.data))))
    start = local.now
    publisher.publish(Int32(data=1))
    local.on_wait = lambda: publisher.publish(Int32(data=100 + local.now - start))
    executor.spin_one_period()
    assert got == [(start, 1)]
    local.on_wait = None
    executor.spin_one_period()
    executor.spin_one_period()
    assert got == [(start, 1), (start + 10, 110), (start + 20, 7)]


def test_each_message_published_is_as_it_was(local: InSpace) -> None:
    heard = Heard(local, "out")
    node = local.context.node("node")
    publisher = node.publisher(Int32, "out")
    message = Int32()

    def call() -> None:
        for i in range(3):
            message.data = i
            assert publisher.publish(message)
        message.data = 99
        publisher.write_bytes(b"\x2a\0\0\0")

    executor = local.executor(semantics=LET, period=0.01)
    executor.add(node.timer(0, call))
    executor.spin_one_period()
    assert heard.values() == [(10, "out", 0), (10, "out", 1), (10, "out", 2), (10, "out", 42)]


def test_answers_and_requests_leave_at_the_end_too(bench: Bench) -> None:
    node, other = bench.context.node("node"), bench.talker.node("other")
    asked: list[int] = []
    answered: list[Any] = []
    node.service(AddTwoInts, "add", lambda request: AddTwoInts.Response(sum=request.a + request.b))
    inner = node.client(AddTwoInts, "times")
    seen: list[int] = []

    def times(request: Any) -> Any:
        asked.append(bench.now)
        return AddTwoInts.Response(sum=request.a * request.b)

    other.service(AddTwoInts, "times", times)
    client = other.client(AddTwoInts, "add")
    bench.settle()
    request = AddTwoInts.Request(a=3, b=4)

    def ask() -> None:
        assert inner.send(request, lambda reply: seen.append(reply.sum))
        request.a = 1000
        timer.cancel()

    timer = node.timer(0, ask)
    others = Executor(bench.talker)
    client.send(AddTwoInts.Request(a=1, b=2), lambda reply: answered.append((bench.now, reply.sum)))
    bench.settle()
    executor = bench.executor(semantics=LET, period=0.05)
    start = bench.now
    for _ in range(4):
        executor.spin_one_period()
        bench.settle()
        others.spin_some(0.0)
        others.spin_some(0.0)
        bench.settle()
    assert seen == [12]
    assert [total for _, total in answered] == [3]
    assert answered[0][0] >= start + 50
    assert asked[0] >= start + 50


def test_a_request_that_nobody_takes_has_no_answer(local: InSpace) -> None:
    node = local.context.node("node")
    client = node.client(AddTwoInts, "add")
    got: list[Any] = []
    executor = local.executor(semantics=LET, period=0.01)

    def ask() -> None:
        assert client.send(AddTwoInts.Request(), got.append)
        timer.cancel()
        client.entity.send = lambda request: 0

    timer = node.timer(0, ask)
    executor.add(timer)
    executor.add(client)
    executor.spin_one_period()
    assert got == []
    executor.spin_one_period()
    assert got == [None]
    assert executor.tasks[0].lost == 1


def test_what_is_logged_is_no_output(local: InSpace) -> None:
    """However much a callback says, it is said at once."""
    seen: list[tuple[int, str]] = []
    log = message_class("rcl_interfaces/msg/Log")
    local.talker.node("console").subscription(
        log, "/rosout", lambda m: seen.append((local.now - start, m.msg)), "rosout"
    )
    node = local.context.node("node")
    logger = node.logger(show=None)
    listening = Executor(local.talker)

    def call() -> None:
        for i in range(30):
            assert logger.info(f"line {i}")
            listening.spin_some()

    executor = local.executor(semantics=LET, period=0.01)
    executor.add(node.timer(0, call))
    start = local.now
    executor.spin_one_period()
    assert seen == [(0, f"line {i}") for i in range(30)]


def test_a_let_of_several_periods(local: InSpace) -> None:
    plan = Plan(local, 1, 1, lets=(0.025, 0.004))
    plan.run(6)
    assert [call for call in plan.calls if call[1] == 0] == [(0, 0), (30, 0)]
    assert [heard for heard in plan.heard.values() if heard[1] == "out_0"] == [
        (30, "out_0", 0),
        (60, "out_0", 30),
    ]
    assert [at for at, topic, _ in plan.heard.values() if topic == "out_1"] == [10, 20, 30, 40, 50, 60]
    order = [topic for at, topic, _ in plan.heard.values() if at == 30]
    assert order == ["out_0", "out_1"], "in the order of adding, whenever they were called"


@pytest.mark.parametrize(("let", "periods"), [(0.0101, 2), (0.0105, 2), (0.07, 7), (0.0701, 8), (0.003, 1)])
def test_a_let_is_rounded_up_to_whole_periods(local: InSpace, let: float, periods: int) -> None:
    plan = Plan(local, 1, lets=(let,))
    plan.run(periods)
    assert plan.heard.values() == [(10 * periods, "out_0", 0)]


def test_what_does_not_fit_the_depth_is_not_run_early(local: InSpace) -> None:
    """Between two periods no callback runs: the oldest is dropped and counted."""
    publisher = local.talker.node("talker").publisher(Int32, "in")
    got: list[tuple[int, int]] = []
    executor = local.executor(semantics=LET, period=0.01)
    subscription = local.context.node("node").subscription(Int32, "in", None, Qos(depth=2))
    executor.add(subscription, lambda message: got.append((local.now - start, message.data)))
    start = local.now
    executor.spin_one_period()
    for i in range(5):
        publisher.publish(Int32(data=i))
        local.context.middleware.spin_once()
    assert got == []
    executor.spin_one_period()
    assert got == [(10, 3)]
    assert subscription.lost == 3


def test_a_let_of_exactly_two_periods_ends_with_the_second(local: InSpace) -> None:
    plan = Plan(local, 1, lets=(0.02,))
    plan.run(3)
    assert plan.heard.values() == [(20, "out_0", 0)]


def test_without_a_period_a_pass_is_one(local: InSpace) -> None:
    heard = Heard(local, "out")
    node = local.context.node("node")
    publisher = node.publisher(Int32, "out")

    def call() -> None:
        publisher.publish(Int32(data=1))
        local.take(3)

    guard = GuardCondition(local.context, call)
    late = GuardCondition(local.context, lambda: publisher.publish(Int32(data=2)))
    executor = local.executor(semantics=LET)
    guard.trigger()
    late.trigger()
    assert executor.spin_some()
    assert heard.values() == [(3, "out", 1), (3, "out", 2)]
    assert executor.overruns == 0
    assert not executor.spin_some()


def test_a_deterministic_executor_as_the_guide_has_it(local: InSpace) -> None:
    """With a trigger: the laser is taken in the periods in which the timer is due."""
    node = local.context.node("node")
    laser = local.talker.node("talker").publisher(Int32, "laser")
    ticks: list[int] = []
    got: list[tuple[int, int]] = []
    timer = node.timer(0.02, lambda: ticks.append(local.now - start))
    subscription = node.subscription(Int32, "laser", None)
    control = Executor(local.context, semantics=LET, period=0.010, trigger=one(timer))
    control.add(timer)
    control.add(subscription, lambda message: got.append((local.now - start, message.data)))
    start = local.now
    for i in range(7):
        laser.publish(Int32(data=i))
        control.spin_one_period()
    assert ticks == [20, 40, 60]
    assert got == [(20, 0), (40, 1), (60, 2)]


AS_WRITTEN = """
sense = Executor(context, trigger=all_of(laser, imu))
sense.add(laser, on_laser)              # order of adding = order of processing
sense.add(imu, on_imu, when=ALWAYS)     # called with None when there is no new data
sense.spin_some()

control = Executor(context, semantics=LET, period=0.010, trigger=one(timer))
control.add(timer)
control.add(laser, avoid)
control.spin_period()                   # inputs at the start of each period, outputs at its end
"""


def test_a_deterministic_executor_runs_as_it_was_planned(local: InSpace) -> None:
    """The plan that was written before the code. A handle that is added to a second executor moves there."""
    node, talker = local.context.node("node"), local.talker.node("talker")
    said: list[tuple[str, int | None]] = []
    names: dict[str, Any] = {
        "context": local.context,
        "laser": node.subscription(Int32, "laser", None),
        "imu": node.subscription(Int32, "imu", None),
        "timer": node.timer(0.01, lambda: said.append(("timer", None))),
        "on_laser": lambda message: said.append(("laser", message.data)),
        "on_imu": lambda message: said.append(("imu", message and message.data)),
        **{name: getattr(muros.rclc, name) for name in ("ALWAYS", "LET", "Executor", "all_of", "one")},
    }

    def avoid(message: Any) -> None:
        said.append(("avoid", message.data))
        names["control"].stop()

    names["avoid"] = avoid
    publishers = {name: talker.publisher(Int32, name) for name in ("laser", "imu")}
    for value, name in ((1, "laser"), (2, "imu"), (3, "laser")):
        publishers[name].publish(Int32(data=value))
    exec(AS_WRITTEN, names)
    assert said == [("laser", 1), ("imu", 2), ("timer", None), ("avoid", 3)]


def test_always_with_let(local: InSpace) -> None:
    node = local.context.node("node")
    say = local.talker.node("talker").publisher(Int32, "in")
    got: list[int | None] = []
    executor = local.executor(semantics=LET, period=0.01, trigger=always)
    executor.add(
        node.subscription(Int32, "in", None), lambda m: got.append(None if m is None else m.data), when=ALWAYS
    )
    for i in range(4):
        if i == 2:
            say.publish(Int32(data=5))
        executor.spin_one_period()
    assert got == [None, None, 5, None]


def test_always_with_let_waits_for_news_when_it_has_no_period(local: InSpace) -> None:
    got: list[int | None] = []
    executor = local.executor(semantics=LET, trigger=always)
    subscription = local.context.node("node").subscription(Int32, "in", None)
    executor.add(subscription, lambda m: got.append(None if m is None else m.data), when=ALWAYS)
    start = local.now
    assert executor.spin_some(0.5)
    assert (got, local.now - start) == ([None], 500)


# Overruns


def overrun(local: InSpace, policy: int) -> Plan:
    """Three callbacks of 2 ms; the second takes 15 ms in the second of five periods."""
    plan = Plan(local, 2, 2, 2, overrun=policy)
    plan.run(1)
    plan.durations[1] = 15
    plan.run(1)
    plan.durations[1] = 2
    plan.run(3)
    return plan


CALLS = {
    GO_ON: [0, 2, 4, 10, 12, 27, 29, 31, 33, 35, 37, 39, 41, 43, 45],
    CANCEL_CURRENT: [0, 2, 4, 10, 12, 27, 29, 31, 33, 35, 40, 42, 44],
    CANCEL_WITHOUT_OUTPUT: [0, 2, 4, 10, 12, 27, 29, 31, 33, 35, 40, 42, 44],
    CANCEL_NEXT: [0, 2, 4, 10, 12, 27, 30, 32, 34, 40, 42, 44],
}
"""When callbacks begin, by what follows an overrun."""

COUNTS = {GO_ON: (6, 0), CANCEL_CURRENT: (2, 2), CANCEL_WITHOUT_OUTPUT: (2, 2), CANCEL_NEXT: (2, 0)}
"""How many overruns that makes, the first one of which makes others late, and how many calls are cancelled."""


@pytest.mark.parametrize("policy", CALLS)
def test_what_follows_an_overrun(local: InSpace, policy: int) -> None:
    told: list[tuple[int, str]] = []
    local.context.on_problem(lambda code, text: told.append((code, text)))
    plan = overrun(local, policy)
    assert [at for at, _ in plan.calls] == CALLS[policy]
    outputs = [(topic, value) for _, topic, value in plan.heard.values()]
    expected = [(f"out_{i}", at) for at, i in plan.calls]
    if policy == CANCEL_WITHOUT_OUTPUT:
        expected = [(topic, at) for topic, at in expected if not 10 <= at < 31]
    assert outputs == expected
    assert all(at >= value for at, _, value in plan.heard.values())
    assert (plan.executor.overruns, sum(task.skipped for task in plan.executor.tasks)) == COUNTS[policy]
    assert [task.result for task in plan.executor.tasks] == ["NO_ERROR"] * 3, "the last run was in time"
    assert told[0] == (
        OVERRUN,
        "call, the callback of the timer of 0 ms, took 15 ms and ended 7 ms behind its let of 10 ms; 1 so far. "
        "Give it less to do, or more time: add(..., let=), Executor(..., period=).",
    )
    if policy == GO_ON:
        assert told[1] == (
            OVERRUN,
            "call, the callback of the timer of 0 ms, took 2 ms and ended 9 ms behind its let of 10 ms; 1 so far. "
            "Those before it left it too little: give them less to do, or it more time: "
            "add(..., let=), Executor(..., period=).",
        )


def test_every_overrun_is_told_to_who_asks(local: InSpace) -> None:
    seen: list[tuple[Task, float]] = []
    plan = Plan(local, 12, on_overrun=lambda task, seconds: seen.append((task, seconds)), lets=(0.005,))
    told: list[int] = []
    local.context.on_problem(lambda code, text: told.append(code))
    plan.run(6)
    assert [round(seconds, 3) for _, seconds in seen] == [0.007, 0.009, 0.011, 0.013, 0.015, 0.017]
    assert {task for task, _ in seen} == set(plan.executor.tasks)
    assert (plan.executor.overruns, plan.executor.tasks[0].overruns) == (6, 6)
    assert plan.executor.tasks[0].result == "OVERRUN"
    assert told == [OVERRUN] * 3, "the 1st, 2nd and 4th"


# Limits and errors


def test_a_publisher_that_publishes_too_much(bench: Bench) -> None:
    node = bench.context.node("node")
    many, few = node.publisher(Int32, "many"), node.publisher(Int32, "few")
    got: list[int] = []
    bench.talker.node("talker").subscription(Int32, "many", lambda message: got.append(message.data))
    bench.settle()
    caught: list[CapacityError] = []

    def call() -> None:
        few.publish(Int32(data=1))
        try:
            for i in range(10):
                assert many.publish(Int32(data=i))
        except CapacityError as error:
            caught.append(error)

    executor = bench.executor(semantics=LET, period=0.05, messages=7)
    timer = node.timer(0, call)
    executor.add(timer, messages=3)
    executor.spin_one_period()
    timer.cancel()
    bench.settle()
    listening = Executor(bench.talker)
    for _ in range(5):
        listening.spin_some(0.0)
    assert str(caught[0]) == (
        "3 messages of 3 of rt/many wait for the end of the period. Give add() or the executor messages=4."
    )
    assert caught[0].code == 1
    assert got == [0, 1, 2]


@pytest.mark.parametrize("goes_on", [True, False])
def test_a_callback_that_raises_publishes_nothing(local: InSpace, goes_on: bool) -> None:
    plan = Plan(local, 1, 1, 1, on_error=GO_ON if goes_on else None)
    local.context.on_problem(lambda code, text: None)
    working = plan.executor.handles[1].callback

    def fail() -> None:
        working()
        raise ZeroDivisionError

    plan.executor.handles[1].callback = fail
    if not goes_on:
        with pytest.raises(ZeroDivisionError) as caught:
            plan.run(1)
        assert caught.value.__notes__[0].endswith("fail, the callback of the timer of 0 ms")
        assert [task.state for task in plan.executor.tasks] == ["RUNNING", "RUNNING", "INACTIVE"]
        plan.executor.handles[1].callback = working
        plan.run(1)
        assert [task.state for task in plan.executor.tasks] == ["INACTIVE"] * 3
        return
    plan.run(2)
    assert [topic for _, topic, _ in plan.heard.values()] == ["out_0", "out_2"] * 2
    assert [task.result for task in plan.executor.tasks] == ["NO_ERROR", "HANDLING_ERROR", "NO_ERROR"]
    assert plan.executor.errors == 2


def test_what_is_removed_or_destroyed_publishes_nothing_more(local: InSpace) -> None:
    plan = Plan(local, 1, 1, lets=(0.03, 0.03))
    plan.run(1)
    first, second = plan.executor.handles
    plan.executor.remove(first)
    second.destroy()
    plan.run(4)
    assert plan.heard.values() == []
    assert plan.executor.tasks == []


def test_let_without_adding_runs_everything(local: InSpace) -> None:
    heard = Heard(local, "out")
    node = local.context.node("node")
    publisher = node.publisher(Int32, "out")
    node.timer(0.01, lambda: publisher.publish(Int32(data=local.now - heard.start)))
    executor = local.executor(semantics=LET, period=0.01)
    for _ in range(3):
        executor.spin_one_period()
    assert heard.values() == [(20, "out", 10), (30, "out", 20)]


def test_spin_keeps_the_periods_and_stop_ends_behind_one(local: InSpace) -> None:
    plan = Plan(local, 1)
    local.on_wait = lambda: plan.executor.stop() if local.now - plan.heard.start >= 25 else None
    plan.executor.spin()
    assert plan.heard.values() == [(10, "out_0", 0), (20, "out_0", 10), (30, "out_0", 20)]


def test_spin_until_keeps_the_periods_too(local: InSpace) -> None:
    plan = Plan(local, 1)
    assert plan.executor.spin_until(lambda: len(plan.calls) == 2, 1.0)
    assert plan.heard.values() == [(10, "out_0", 0), (20, "out_0", 10)]
    assert not plan.executor.spin_until(lambda: False, 0.015)
    assert local.now - plan.heard.start == 40


def test_what_another_thread_publishes_leaves_at_once(local: InSpace) -> None:
    heard = Heard(local, "out")
    node = local.context.node("node")
    publisher = node.publisher(Int32, "out")

    def call() -> None:
        publisher.publish(Int32(data=1))
        other = threading.Thread(target=lambda: publisher.publish(Int32(data=2)))
        other.start()
        other.join()

    executor = local.executor(semantics=LET, period=0.01)
    executor.add(node.timer(0, call))
    executor.spin_one_period()
    assert heard.values() == [(0, "out", 2), (10, "out", 1)]


def test_a_callback_cannot_spin_its_own_executor(local: InSpace) -> None:
    """Nor does spinning another one let out what the outer callback publishes later."""
    heard = Heard(local, "out")
    node = local.context.node("node")
    publisher = node.publisher(Int32, "out")
    inner = local.executor(semantics=LET)
    inner.add(node.timer(0, lambda: publisher.publish(Int32(data=1))))
    errors: list[str] = []

    def call() -> None:
        try:
            executor.spin_some()
        except RclError as error:
            errors.append(str(error))
        inner.spin_some()
        publisher.publish(Int32(data=2))

    executor = local.executor(semantics=LET, period=0.01)
    executor.add(node.timer(0, call))
    executor.spin_one_period()
    assert errors == ["an executor with LET cannot be spun by one of its callbacks"]
    assert heard.values() == [(0, "out", 1), (10, "out", 2)]


def test_what_is_gone_is_forgotten(local: InSpace) -> None:
    node = local.context.node("node")
    executor = local.executor(semantics=LET)
    let: Any = executor.let
    for _ in range(10):
        timer = node.timer(0, lambda: None)
        executor.add(timer)
        assert executor.spin_some()
        timer.destroy()
    assert len(let._tasks) <= 2


# A callback that goes on beside the others


def until(condition: Callable[[], bool]) -> None:
    """Waits for another thread."""
    for _ in range(20_000):
        if condition():
            return
        time.sleep(0.001)
    raise AssertionError("it did not come about within 20 s")


class Crew:
    """A plan with LOW_PRIORITY, whose callbacks run in threads: periods that end when those that can have ended."""

    def __init__(self, local: InSpace, *callbacks: Callable[[Any], object] | None, **options: Any) -> None:
        self.plan = Plan(local, *[0] * len(callbacks), overrun=LOW_PRIORITY, **options)
        self.local = local
        self.let: Any = self.plan.executor.let
        self.tasks = self.plan.executor.tasks
        for handle, publisher, callback in zip(
            self.plan.executor.handles, self.plan.publishers, callbacks, strict=True
        ):
            if callback is not None:
                handle.callback = lambda publisher=publisher, callback=callback: callback(publisher)

    def period(self, *ended: int) -> list[str]:
        """One period, over when those tasks have ended; the topics of what leaves."""
        count = len(self.plan.heard.all)
        self.let.begin(self.local.now, PERIOD)
        until(lambda: all(self.tasks[i].done for i in ended))
        self.local.now += PERIOD
        self.let.finish()
        return [topic for _, topic, _ in self.plan.heard.values()[count:]]


class Gate:
    """A callback that publishes and then waits until it may go on."""

    def __init__(self) -> None:
        self.open = threading.Event()
        self.began = threading.Event()
        self.before = self.niceness = os.getpriority(os.PRIO_PROCESS, 0)

    def __call__(self, publisher: Any) -> None:
        publisher.publish(Int32(data=77))
        self.began.set()
        assert self.open.wait(20)
        if hasattr(os, "PRIO_PROCESS"):
            self.niceness = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())


def test_low_priority(local: InSpace) -> None:
    """A callback that blocks holds up nobody: others are called in the next period, its output comes when it ends."""
    gate = Gate()
    crew = Crew(local, None, gate, None)
    told: list[tuple[int, str]] = []
    local.context.on_problem(lambda code, text: told.append((code, text)))
    assert crew.period(0) == ["out_0"]
    assert gate.began.wait(20)
    assert [task.state for task in crew.tasks] == ["INACTIVE", "RUNNING", "RUNNING"], (
        "the third came behind it"
    )
    assert [code for code, _ in told] == [OVERRUN, OVERRUN]
    assert told[0][1].startswith(
        "<lambda>, the callback of the timer of 0 ms, has not ended 0 ms behind its let of 10 ms and goes on with low "
    )
    assert crew.period(0, 2) == ["out_0", "out_2"]
    assert crew.tasks[1].state == "RUNNING"
    gate.open.set()
    assert crew.period(0, 1, 2) == ["out_0", "out_1", "out_2"]
    assert crew.plan.heard.values()[-2][2] == 77
    assert (crew.tasks[1].state, crew.tasks[1].result, crew.tasks[1].overruns) == ("INACTIVE", "OVERRUN", 1)
    if sys.platform == "linux":
        assert gate.niceness == min(19, gate.before + 10)
    assert crew.period(0, 1, 2) == ["out_0", "out_1", "out_2"]
    crew.let.close()


def test_low_priority_and_a_let_of_several_periods(local: InSpace) -> None:
    """A callback that has time left is not late; the others are called in the next period by another thread."""
    gate = Gate()
    crew = Crew(local, None, gate, lets=(0, 0.03))
    assert crew.period(0) == ["out_0"]
    assert gate.began.wait(20)
    assert crew.period(0) == ["out_0"]
    gate.open.set()
    assert crew.period(0, 1) == ["out_0", "out_1"]
    assert (crew.plan.executor.overruns, gate.niceness) == (0, gate.before)
    crew.let.close()


def test_low_priority_of_who_is_late_and_has_ended(local: InSpace) -> None:
    told: list[str] = []
    local.context.on_problem(lambda code, text: told.append(text))

    def late(publisher: Any) -> None:
        publisher.publish(Int32(data=1))
        local.now += 15

    crew = Crew(local, late)
    assert crew.period(0) == ["out_0"]
    assert (crew.tasks[0].result, crew.tasks[0].overruns, crew.tasks[0].took) == ("OVERRUN", 1, 15)
    assert "took 15 ms and ended 5 ms behind its let of 10 ms" in told[0]
    crew.let.close()


@pytest.mark.parametrize("goes_on", [True, False])
def test_low_priority_and_errors(local: InSpace, goes_on: bool) -> None:
    local.context.on_problem(lambda code, text: None)

    def fails(publisher: Any) -> None:
        publisher.publish(Int32(data=1))
        raise ValueError("no")

    crew = Crew(local, fails, None, on_error=GO_ON if goes_on else None)
    if goes_on:
        assert crew.period(0, 1) == ["out_1"]
        assert crew.tasks[0].result == "HANDLING_ERROR"
    else:
        with pytest.raises(ValueError, match="no"):
            crew.period(0, 1)
    assert crew.plan.executor.errors == 1
    crew.let.close()


def test_a_worker_ends_with_its_executor(local: InSpace) -> None:
    def workers() -> int:
        return sum(thread.name == "muros LET" for thread in threading.enumerate())

    until(lambda: workers() == 0)
    crew = Crew(local, None)
    assert crew.period(0) == ["out_0"]
    assert workers() == 1
    for handle in crew.plan.executor.handles:
        handle.destroy()
    gone = weakref.ref(crew.let)
    del crew, handle
    until(lambda: gc.collect() >= 0 and gone() is None and workers() == 0)


def test_low_priority_as_it_is_spun(local: InSpace) -> None:
    """With the executor's own periods, which virtual time ends whether a thread is ready or not: all of it comes."""
    crew = Crew(local, None)
    executor = crew.plan.executor
    local.on_wait = lambda: executor.stop() if len(crew.plan.heard.all) >= 5 else time.sleep(0.001)
    executor.spin_period()
    assert len(crew.plan.heard.all) >= 5
    assert {at % PERIOD for at, _, _ in crew.plan.heard.all} == {0}


# Determinism


class Graph:
    """A program made from a seed: subscriptions, timers and guard conditions that publish on each other's topics.

    `trace` has every call of a callback, `heard` everything that leaves.
    """

    TOPICS = 4

    def __init__(self, seed: int, semantics: int, quick: bool = False) -> None:
        self.local = InSpace()
        self.random = random.Random(seed)
        self.work = random.Random(seed + (7919 if quick else 0))
        self.quick = quick
        self.semantics = semantics
        names = [f"t{i}" for i in range(self.TOPICS)]
        self.heard = Heard(self.local, *names)
        self.trace: list[tuple[int, str, int]] = []
        self.node = self.local.context.node("node")
        self.publishers = [self.node.publisher(Int32, name) for name in names]
        outside = self.local.talker.node("outside")
        self.inputs = [outside.publisher(Int32, name) for name in names]
        options: dict[str, Any] = {"semantics": LET, "period": 0.01} if semantics == LET else {}
        self.executor = self.local.executor(**options)
        for i in range(self.random.randint(2, 7)):
            self._add(i)

    def run(self) -> "Graph":
        """Twenty periods with inputs at random moments."""
        moments = sorted(self.random.randint(0, 190) for _ in range(30))
        plan = [(at, self.random.randrange(self.TOPICS), self.random.randint(-1000, 1000)) for at in moments]
        start = self.heard.start

        def feed() -> None:
            while plan and plan[0][0] <= self.local.now - start:
                _, topic, value = plan.pop(0)
                self.inputs[topic].publish(Int32(data=value))

        for _ in range(20):
            if self.semantics == LET:
                feed()
                self._wait_with(feed)
                self.executor.spin_one_period()
            else:
                feed()
                self.executor.spin_some(0.0)
                self.local.now += 10
        self.local.close()
        return self

    def _wait_with(self, feed: Callable[[], None]) -> None:
        """Inputs come at the end of a period, however long the callbacks took."""
        end = (self.local.now - self.heard.start) // 10 * 10 + 10
        self.local.on_wait = lambda: feed() if self.local.now - self.heard.start >= end else None

    def _add(self, i: int) -> None:
        kind = self.random.choice(("subscription", "subscription", "timer", "guard"))
        target = self.random.randrange(self.TOPICS)
        factor = self.random.randint(2, 9)
        chance = self.random.random()
        state = {"calls": 0, "dice": random.Random(self.random.random())}

        def call(value: int) -> None:
            dice: Any = state["dice"]
            state["calls"] = calls = state["calls"] + 1  # type: ignore[operator]
            self.trace.append((self.local.now - self.heard.start, f"{kind} {i}", value))
            if dice.random() < chance / 2:
                self.publishers[target].publish(Int32(data=(value * factor + calls) % 10007))
            for guard in guards:
                if dice.random() < 0.2:
                    guard.trigger()
            if self.semantics == LET:
                self.local.take(0 if self.quick else self.work.choice((0, 0, 1)))

        guards = [handle for handle in self.executor.handles if isinstance(handle, GuardCondition)]
        if kind == "subscription":
            topic = self.random.randrange(self.TOPICS)
            handle: Any = self.node.subscription(Int32, f"t{topic}", lambda message: call(message.data))
        elif kind == "timer":
            handle = self.node.timer(self.random.choice((0.01, 0.02, 0.03)), lambda: call(0))
        else:
            handle = GuardCondition(self.local.context, lambda: call(1))
        lets = (0, 0, 0, 0.01, 0.02, 0.03)
        self.executor.add(handle, let=self.random.choice(lets) if self.semantics == LET else 0)


SEEDS = range(120)


@pytest.mark.parametrize("semantics", [RCLCPP, LET], ids=["rclcpp", "let"])
def test_the_same_inputs_give_the_same_callbacks_and_outputs(semantics: int) -> None:
    calls = outputs = 0
    for seed in SEEDS:
        first, again = (Graph(seed, semantics).run() for _ in range(2))
        assert first.trace == again.trace, f"seed {seed}"
        assert first.heard.all == again.heard.all, f"seed {seed}"
        calls, outputs = calls + len(first.trace), outputs + len(first.heard.all)
    assert calls > 3000
    assert outputs > 3000


def test_outputs_never_leave_before_the_end_and_depend_on_no_speed() -> None:
    """The same program on a computer that takes no time: the same outputs at the same instants, all at an end."""
    computed = 0
    for seed in SEEDS:
        slow, quick = Graph(seed, LET).run(), Graph(seed, LET, quick=True).run()
        assert slow.executor.overruns == 0, f"seed {seed}: nothing that was to be compared"
        assert slow.heard.all == quick.heard.all, f"seed {seed}"
        assert [call[1:] for call in slow.trace] == [call[1:] for call in quick.trace], f"seed {seed}"
        computed += slow.trace != quick.trace
        inputs = {at for at, _, _ in slow.heard.all if at % PERIOD}
        assert not inputs, f"seed {seed}: something left at {inputs}"
    assert computed > 50, "most of them did take time"


def through_a_bad_network(seed: int) -> tuple[list[tuple[int, int, int]], list[tuple[int, int]]]:
    """Two boards and an agent on a network that loses a tenth: the calls at one, with LET, and what the other hears."""
    world = World(seed, loss=0.1, duplicate=0.05, reorder=0.05)
    talker, board = Board(world, "talker", queue=32), Board(world, "board", queue=32)
    calls: list[tuple[int, int, int]] = []
    heard: list[tuple[int, int]] = []
    outputs = [board.node.publisher(Int32, f"out_{i}") for i in range(2)]
    executor = board.executor(semantics=LET, period=0.02)

    def caller(i: int) -> Callable[[Any], None]:
        def call(message: Any) -> None:
            calls.append((world.now, i, message.data))
            outputs[i].publish(Int32(data=10 * message.data + i))

        return call

    for i in range(2):
        executor.add(board.node.subscription(Int32, f"in_{i}", None), caller(i))
        talker.node.subscription(Int32, f"out_{i}", lambda message: heard.append((world.now, message.data)))
    inputs = [talker.node.publisher(Int32, f"in_{i}") for i in range(2)]
    hearing = talker.executor()
    world.sessions.append(talker.session)  # served while the board waits
    for period in range(150):
        if period >= 50:  # they are connected
            inputs[period % 2].publish(Int32(data=period))
        executor.spin_one_period()
        hearing.work(world.now)
    return calls, heard


def test_the_same_network_gives_the_same_callbacks() -> None:
    calls = 0
    for seed in range(12):
        first, again = through_a_bad_network(seed), through_a_bad_network(seed)
        assert first == again, f"seed {seed}"
        calls += len(first[0])
    assert calls > 300


def test_actions_run_with_let(local: InSpace) -> None:
    """Goals, feedback and results cross at the ends of periods, as everything does."""
    node, other = local.context.node("node"), local.talker.node("other")

    def run(goal: Any) -> Any:
        sequence = [0, 1]
        for _ in range(goal.request.order - 1):
            sequence.append(sequence[-1] + sequence[-2])
            goal.feedback(Fibonacci.Feedback(sequence=sequence))
            yield
        return Fibonacci.Result(sequence=sequence)

    server = node.action_server(Fibonacci, "fibonacci", on_execute=run)
    client = other.action_client(Fibonacci, "fibonacci")
    executor = local.executor(semantics=LET, period=0.01)
    executor.add(server)
    others = Executor(local.talker)
    told: list[tuple[int, str, int]] = []
    start = local.now
    client.send_goal(
        Fibonacci.Goal(order=4),
        on_response=lambda goal, accepted: told.append((local.now - start, "accepted", 0)),
        on_feedback=lambda goal, feedback: told.append(
            (local.now - start, "feedback", len(feedback.sequence))
        ),
        on_result=lambda goal, result: told.append((local.now - start, "result", result.sequence[-1])),
    )
    for _ in range(12):
        executor.spin_one_period()
        for _ in range(5):
            others.spin_some(0.0)
    assert [what[1:] for what in told] == [
        ("accepted", 0), ("feedback", 3), ("feedback", 4), ("feedback", 5), ("result", 3),
    ]  # fmt: skip
    assert {at % PERIOD for at, _, _ in told} == {0}
