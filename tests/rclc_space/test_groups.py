"""Callback groups in threads of their own: who runs what, who waits for whom, and what becomes of errors.

A7 numbers the facts about the multi-threaded executors of rclc.
"""

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from muros.client import Qos
from muros.rclc import (
    ALWAYS,
    BEST_EFFORT,
    LET,
    REAL_TIME_CRITICAL,
    CallbackGroup,
    Executor,
    GuardCondition,
    RclError,
    ThreadError,
    Threads,
    always,
)
from tests.rclc_space.crew import Crew, here, until
from tests.rclc_space.ways import PATIENCE, Direct

from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32

LONG = 60.0
"""Seconds that nobody waits unless a waking was missed: the time limit of the test ends it first."""


@pytest.fixture
def alone() -> Iterator[Crew]:
    """A crew in a space of this process."""
    made = Crew(Direct("local:"))
    yield made
    made.close()


def appender(kept: list[int]) -> Callable[[Any], None]:
    """A callback that keeps numbers."""
    return lambda msg: kept.append(msg.data)


def test_each_group_is_run_by_a_thread_of_its_own(crew: Crew) -> None:
    far, node = crew.node("far"), crew.node()
    ran: dict[str, list[tuple[int, str]]] = {"high": [], "low": []}
    high = CallbackGroup("high", REAL_TIME_CRITICAL)
    low = CallbackGroup("low", BEST_EFFORT)
    qos = Qos(depth=20)
    high.add(node.subscription(Int32, "high", lambda msg: ran["high"].append((msg.data, here())), qos))
    low.add(node.subscription(Int32, "low", None, qos), lambda msg: ran["low"].append((msg.data, here())))
    publishers = [far.publisher(Int32, name, qos) for name in ran]
    threads = crew.threads(node.context)
    made = threads.assign(low, high)
    assert [thread.name for thread in made] == ["RealTimeCritical", "BestEffort"]
    other = crew.threads(far.context)
    other.executor("idle").add(far.timer(LONG, lambda: None))
    with threads, other:
        crew.meet(*publishers)
        for number in range(20):
            for publisher in publishers:
                crew.publish(publisher, Int32(data=number))
        until(lambda: len(ran["high"]) == len(ran["low"]) == 20)
    assert ran["high"] == [(number, "RealTimeCritical") for number in range(20)]
    assert ran["low"] == [(number, "BestEffort") for number in range(20)]


def test_a_callback_that_does_not_return_holds_up_nobody_else(crew: Crew) -> None:
    """What comes for it meanwhile waits, as much as its queue holds; the oldest is dropped."""
    far, node = crew.node("far"), crew.node()
    heard: list[int] = []
    slow: list[int] = []
    entered, release = threading.Event(), threading.Event()

    def dawdle(msg: Int32) -> None:
        slow.append(msg.data)
        entered.set()
        assert release.wait(PATIENCE)

    low = CallbackGroup("low")
    low.add(node.subscription(Int32, "number", dawdle, Qos(depth=5)))
    high = CallbackGroup("high")
    high.add(node.subscription(Int32, "number", lambda msg: heard.append(msg.data), Qos(depth=50)))
    publisher = far.publisher(Int32, "number")
    threads = crew.threads(node.context)
    threads.executor("low", None, low)
    threads.executor("high", None, high)
    other = crew.threads(far.context)
    other.executor("idle").add(far.timer(LONG, lambda: None))
    with threads, other:
        crew.meet(publisher)
        if crew.way.direct:
            until(lambda: publisher.matched == 2)
        crew.publish(publisher, Int32(data=0))
        assert entered.wait(PATIENCE)
        for number in range(1, 30):
            crew.publish(publisher, Int32(data=number))
        until(lambda: heard == list(range(30)))
        assert slow == [0]
        release.set()
        until(lambda: slow[-1] == 29)
    assert slow == [0, *range(25, 30)]


def test_publishing_from_all_threads_loses_and_mixes_nothing(crew: Crew) -> None:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        far, node = crew.node("far"), crew.node()
        count, sent = 4, 100
        got: dict[int, list[int]] = {index: [] for index in range(count)}
        qos = Qos(depth=sent)
        publishers = [node.publisher(Int32, f"topic{index}", qos) for index in range(count)]
        threads, other = crew.threads(node.context), crew.threads(far.context)
        go = threading.Event()

        def talk(index: int) -> None:
            assert go.wait(PATIENCE)
            for number in range(sent):
                crew.publish(publishers[index], Int32(data=number))

        for index in range(count):
            sink = far.subscription(Int32, f"topic{index}", appender(got[index]), qos)
            other.executor(f"listener {index}").add(sink)
            thread = threads.executor(f"talker {index}")
            thread.add(node.timer(LONG, lambda: None))
            thread.call(partial(talk, index))
        with threads, other:
            crew.meet(*publishers)
            go.set()
            until(lambda: sum(map(len, got.values())) == count * sent)
        assert got == {index: list(range(sent)) for index in range(count)}
    finally:
        sys.setswitchinterval(before)


def test_threads_of_one_context_ask_each_other(crew: Crew) -> None:
    """A callback may wait for a service of the same context that another thread serves; so may threads of no group."""
    node = crew.node()
    server, asker = CallbackGroup("server"), CallbackGroup("asker")
    server.add(
        node.service(AddTwoInts, "add", lambda request: AddTwoInts.Response(sum=request.a + request.b))
    )
    client = asker.add(node.client(AddTwoInts, "add"))
    sums: list[Any] = []
    where: list[str] = []
    threads = crew.threads(node.context)
    threads.executor("server", None, server)
    own = threads.executor("asker", None, asker)

    def ask(a: int) -> None:
        sums.append(client.call(AddTwoInts.Request(a=a, b=1), PATIENCE).sum)

    with threads:
        crew.meet()
        own.call(lambda: ask(1))  # in the client's thread
        until(lambda: sums == [2])
        ask(2)  # in the main thread

        def answer(reply: Any) -> None:
            sums.append(reply.sum)
            where.append(here())

        assert client.send(AddTwoInts.Request(a=3, b=1), answer, PATIENCE)
        until(lambda: len(sums) == 3)
        others = [threading.Thread(target=ask, args=(10 + number,)) for number in range(4)]
        for other in others:
            other.start()
        for other in others:
            other.join(PATIENCE)
    assert sums[:3] == [2, 3, 4]
    assert sorted(sums[3:]) == [11, 12, 13, 14]
    assert where == ["asker"]


def test_services_are_answered_later_from_another_thread(crew: Crew) -> None:
    node = crew.node()
    waiting: list[tuple[bytes, Any]] = []
    came = threading.Event()

    def ask(request: Any) -> None:
        waiting.append((service.identity, request))
        came.set()

    service = node.service(AddTwoInts, "add", ask)
    client = node.client(AddTwoInts, "add")
    threads = crew.threads(node.context)
    threads.executor("server").add(service)
    threads.executor("client").add(client)
    answers: list[Any] = []
    with threads:
        crew.meet()
        until(client.entity.room)
        client.send(AddTwoInts.Request(a=20, b=3), answers.append, PATIENCE)
        assert came.wait(PATIENCE)
        identity, request = waiting[0]
        service.reply(identity, AddTwoInts.Response(sum=request.a + request.b))
        until(lambda: answers)
    assert answers[0].sum == 23


def test_actions_have_threads_too(crew: Crew) -> None:
    node = crew.node()
    ran: list[str] = []

    def count(goal: Any) -> Iterator[float]:
        sequence = [0, 1]
        for _ in range(goal.request.order):
            ran.append(here())
            sequence.append(sequence[-1] + sequence[-2])
            yield 0.0
        goal.succeed(Fibonacci.Result(sequence=sequence))

    server = node.action_server(Fibonacci, "count", count)
    client = node.action_client(Fibonacci, "count")
    threads = crew.threads(node.context)
    threads.executor("server").add(server)
    threads.executor("client").add(client)
    with threads:
        crew.meet()
        goal = client.call(Fibonacci.Goal(order=5), PATIENCE)
    assert goal is not None
    assert list(goal.result.sequence) == [0, 1, 1, 2, 3, 5, 8]
    assert ran == ["server"] * 5


def test_guards_timers_and_calls_reach_the_thread_that_runs_them(crew: Crew) -> None:
    node = crew.node()
    ran: list[tuple[str, str]] = []
    guard = GuardCondition(node.context, lambda: ran.append(("guard", here())))
    threads = crew.threads(node.context)
    threads.executor("guard").add(guard)
    waker = threads.executor("timer")
    waker.add(node.timer(LONG, lambda: None))
    waker.add(node.timer(0.001, lambda: ran.append(("timer", here()))))
    with threads:
        until(lambda: ("timer", "timer") in ran)
        guard.trigger()
        until(lambda: ("guard", "guard") in ran)
        waker.call(lambda: ran.append(("call", here())))
        until(lambda: ("call", "timer") in ran)
    assert {thread for what, thread in ran if what == "timer"} == {"timer"}


def test_what_no_thread_claims_is_run_by_who_started_them(crew: Crew) -> None:
    far, node = crew.node("far"), crew.node()
    ran: list[tuple[str, str]] = []
    node.subscription(Int32, "main", lambda msg: ran.append(("main", here())))
    threads, other = crew.threads(node.context), crew.threads(far.context)
    threads.executor("own").add(node.subscription(Int32, "own", lambda msg: ran.append(("own", here()))))
    publishers = [far.publisher(Int32, name) for name in ("main", "own", "late")]
    other.executor("idle").add(far.timer(LONG, lambda: None))
    executor = Executor(node.context)
    with threads, other:
        node.subscription(Int32, "late", lambda msg: ran.append(("late", here())))
        crew.meet(*publishers)
        for publisher in publishers:
            crew.publish(publisher, Int32())
        until(lambda: ("own", "own") in ran)
        assert executor.spin_until(lambda: len(ran) == 3, PATIENCE)
    assert sorted(ran) == [("late", "MainThread"), ("main", "MainThread"), ("own", "own")]


def test_threads_stop_and_start_again(crew: Crew) -> None:
    """What has come in between is not lost, also where one thread alone runs the context for a while."""
    far, node = crew.node("far"), crew.node()
    heard: list[tuple[int, str]] = []
    publisher = far.publisher(Int32, "number")
    sink = node.subscription(Int32, "number", lambda msg: heard.append((msg.data, here())), Qos(depth=100))
    threads, other = crew.threads(node.context), crew.threads(far.context)
    threads.executor("sink").add(sink)
    other.executor("idle").add(far.timer(LONG, lambda: None))
    with other:
        with threads:
            crew.meet(publisher)
            crew.publish(publisher, Int32(data=1))
            until(lambda: heard)
        crew.publish(publisher, Int32(data=2))
        with threads:
            until(lambda: len(heard) == 2)
        crew.publish(publisher, Int32(data=3))
        alone = Executor(node.context)
        alone.handles = [sink]
        assert alone.spin_until(lambda: len(heard) == 3, PATIENCE)
    assert heard == [(1, "sink"), (2, "sink"), (3, "MainThread")]


def test_closing_the_context_ends_all_threads(crew: Crew) -> None:
    node = crew.node()
    threads = crew.threads(node.context)
    threads.executor("other").add(node.timer(LONG, lambda: None))
    threads.executor("closer").add(node.timer(0.001, node.context.close))
    threads.run()
    assert not node.context.running


def test_an_executor_with_let_and_a_period_has_a_thread(alone: Crew) -> None:
    node = alone.node()
    ran: list[str] = []
    threads = alone.threads(node.context)
    control = threads.executor("control", semantics=LET, period=0.002, trigger=always)
    control.add(node.subscription(Int32, "input", lambda msg: ran.append(here())), when=ALWAYS)
    with threads:
        until(lambda: len(ran) >= 3)
    assert set(ran) == {"control"}


def test_an_error_ends_all_threads_and_is_raised(alone: Crew) -> None:
    node = alone.node()
    threads = alone.threads(node.context)
    threads.executor("patient").add(node.timer(LONG, lambda: None))

    def on_tick() -> None:
        raise ZeroDivisionError("one over nothing")

    threads.executor("hasty").add(node.timer(0.001, on_tick))
    with pytest.raises(
        ThreadError, match="thread 'hasty' has ended: ZeroDivisionError: one over nothing"
    ) as caught:
        threads.run(LONG)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    assert "on_tick" in str(caught.value)
    assert [thread.alive for thread in threads.threads] == [False, False]
    assert [code for code, _ in alone.problems] == [53]
    assert node.context.running


def test_with_keep_going_only_the_thread_of_the_error_ends(alone: Crew) -> None:
    node = alone.node()
    threads = alone.threads(node.context, keep_going=True)
    ticks: list[int] = []
    threads.executor("sound").add(node.timer(0.001, lambda: ticks.append(1)))
    threads.executor("broken").add(node.timer(0.001, lambda: 1 // 0))
    threads.start()
    until(lambda: threads.errors)
    sound, broken = threads.threads
    until(lambda: not broken.alive)
    ticks.clear()
    until(lambda: len(ticks) > 3)
    assert sound.alive
    assert not threads.join(0.0)
    threads.stop()
    with pytest.raises(ThreadError, match="'broken' has ended: ZeroDivisionError"):
        threads.join()


def test_what_a_callback_of_states_raises_ends_all_threads(alone: Crew) -> None:
    node = alone.node()

    def on_state(state: str) -> None:
        if state == "CONNECTED":
            raise RuntimeError(state)

    node.context.on_state(on_state)
    threads = alone.threads(node.context)
    threads.executor("patient").add(node.timer(LONG, lambda: None))
    with pytest.raises(ThreadError, match="'carrier' has ended: RuntimeError: CONNECTED"):
        threads.run(LONG)


def test_a_group_takes_what_was_made_on_a_node(alone: Crew) -> None:
    """Each handle is in one group: services of parameters and an action too, but not what another group has."""
    node, other = alone.node(), alone.node("other")
    first, second = CallbackGroup("first"), CallbackGroup("second")
    timer = first.add(node.timer(LONG, lambda: None))
    with pytest.raises(RclError, match=r"the timer of 60000 ms, is in group 'first' already"):
        second.add(timer)
    other.timer(LONG, lambda: None)
    server = node.action_server(Fibonacci, "count", lambda goal: None)
    parameters = node.parameters()
    sink = node.subscription(Int32, "number", lambda msg: None)
    second.add_node(node)
    assert second.handles == [server, *parameters.handles, sink]
    threads = alone.threads(node.context)
    threads.executor("first", None, first)
    threads.executor("second", None, second)
    with threads:
        assert threads.threads[1].executor.handles == second.handles


def test_a_thread_may_have_all_end(alone: Crew) -> None:
    node = alone.node()
    threads = alone.threads(node.context)
    threads.executor("patient").add(node.timer(LONG, lambda: None))
    ended: list[bool] = []

    def end() -> None:
        ended.append(threads.stop())

    threads.executor("ender").add(node.timer(0.001, end))
    threads.run(PATIENCE)
    assert ended == [False], "it cannot wait for itself"
    assert not any(thread.alive for thread in threads.threads)
    assert node.context.running


def test_a_context_is_run_by_one_crew_at_a_time(alone: Crew) -> None:
    node = alone.node()
    ticks: list[int] = []
    first, second = alone.threads(node.context), alone.threads(node.context)
    first.executor("first").add(node.timer(0.001, lambda: ticks.append(1)))
    second.executor("second").add(node.timer(LONG, lambda: None))
    with first:
        with pytest.raises(RclError, match="the threads of this context run already"):
            second.start()
        assert second.stop()
        ticks.clear()
        until(lambda: ticks)
    with second:
        assert second.threads[0].alive
    with pytest.raises(TypeError, match="Threads needs a context, not 5"):
        Threads(5)  # type: ignore[arg-type]


def test_a_callback_of_problems_may_close_the_context(crew: Crew) -> None:
    """Also one that is called in the middle of publishing, while nobody else may use the session."""
    context = crew.context()
    node = context.node("node")
    publisher = node.publisher(Int32, "number")
    closed: list[str] = []

    def on_problem(code: int, text: str) -> None:
        if not closed:
            closed.append(text)
            context.close()

    context.on_problem(on_problem)
    threads = crew.threads(context)

    def flood() -> None:
        while publisher.publish(Int32()):
            pass  # a session has no room for many; a space has
        publisher.destroy()
        publisher.publish(Int32())

    own = threads.executor("own")
    own.add(node.timer(LONG, lambda: None))
    if crew.way.direct:
        publisher.destroy()
    with threads:
        crew.meet()
        own.call(flood)
        assert threads.join(PATIENCE)
    assert closed
    assert not context.running


PROGRAM = """
import threading
from muros.rclc import Context, REAL_TIME_CRITICAL, CallbackGroup, Threads
context = Context("local:")
group = CallbackGroup("control", REAL_TIME_CRITICAL)
ticked = threading.Event()
group.add(context.node("node").timer(0.001, ticked.set))
threads = Threads(context)
threads.assign(group)
threads.start()
assert ticked.wait(20)
print("done")
"""


def test_a_program_ends_although_its_threads_run() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=50, check=False
    )
    assert (done.returncode, done.stdout) == (0, "done\n"), done.stderr
    assert "Traceback" not in done.stderr


def test_the_time_that_threads_compute_is_known(alone: Crew) -> None:
    node = alone.node()
    threads = alone.threads(node.context)
    busy = threads.executor("busy")
    busy.add(node.timer(0.0, lambda: None))
    lazy = threads.executor("lazy")
    lazy.add(node.timer(LONG, lambda: None))
    with threads:
        until(lambda: busy.cpu_time > 0.02)
        assert lazy.cpu_time < busy.cpu_time
        assert busy.native_id is not None
    assert busy.cpu_time > 0.02
    assert busy.native_id is None


def test_wrong_use_is_said(alone: Crew) -> None:
    node = alone.node()
    threads = Threads(node.context)
    group = CallbackGroup("group")
    group.add(node.timer(LONG, lambda: None))
    first = threads.executor("first", None, group)
    with pytest.raises(RclError, match="group 'group' is run by thread 'first' already"):
        threads.executor("second", None, group)
    with pytest.raises(RclError, match="there is a thread 'first' already"):
        threads.executor("first")
    threads.executor("empty")
    with pytest.raises(RclError, match="thread 'empty' has nothing to run"):
        threads.start()
    assert not first.alive
    threads.threads.pop()
    with threads:
        with pytest.raises(RclError, match="the threads run already"):
            threads.start()
        with pytest.raises(RclError, match="make them all before"):
            threads.executor("late")
    for wrong in ("urgent", 1, None):
        with pytest.raises(TypeError, match="the class of a group is REAL_TIME_CRITICAL"):
            CallbackGroup("x", wrong)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="a policy is made by"):
        threads.executor("x", "fifo")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="numbers of processors"):
        threads.executor("x", cpus="0")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="numbered from 0"):
        threads.executor("x", cpus=[-1])
