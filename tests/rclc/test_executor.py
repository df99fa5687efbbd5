"""The executor: what it runs, when, and what it refuses. Cases are named as in the C library, in virtual time."""

import json
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import pytest

from muros.client import Udp
from muros.rclc import (
    ALWAYS,
    GO_ON,
    LET,
    RCLCPP,
    CallbackGroup,
    CapacityError,
    Context,
    Executor,
    GuardCondition,
    HandleError,
    Qos,
    RclError,
    all_of,
    always,
    any_of,
    one,
)
from tests.rclc.virtual import Bench, InSpace

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String

FIVE: Any = 5


class Topics:
    """Publishers of one context, subscriptions of the other that note what comes, in `got`."""

    def __init__(self, bench: Bench, count: int, qos: Any = "default") -> None:
        self.bench = bench
        talker, listener = bench.talker.node("talker"), bench.context.node("listener")
        self.got: list[tuple[int, int | None]] = []
        self.subscriptions = [
            listener.subscription(Int32, f"topic_{i}", self._noter(i), qos) for i in range(count)
        ]
        self.publishers = [talker.publisher(Int32, f"topic_{i}", qos) for i in range(count)]
        bench.settle()

    def say(self, *values: tuple[int, int]) -> None:
        """Publishes (topic, number) in this order, and has all arrive."""
        for topic, value in values:
            assert self.publishers[topic].publish(Int32(data=value))
            self.bench.settle()

    def _noter(self, topic: int) -> Callable[[Any], object]:
        return lambda message: self.got.append((topic, None if message is None else message.data))


def refused(context: Context, use: Callable[[Context], object], kind: type[Exception], said: str) -> None:
    """What makes no sense is said in one line, with the return code of the C library."""
    with pytest.raises(kind) as caught:
        use(context)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert getattr(caught.value, "code", None) == 11


REFUSED: list[tuple[Callable[[Context], object], type[Exception], str]] = [
    (lambda c: Executor(FIVE), TypeError, "Executor needs a context, not 5"),
    (lambda c: Executor(c, -1), ValueError, "handles is -1: it must be how many may be added"),
    (lambda c: Executor(c, trigger=FIVE), TypeError, "trigger is a function, not 5"),
    (lambda c: Executor(c, semantics=7), ValueError, "semantics is 7: it must be RCLCPP or LET"),
    (lambda c: Executor(c, period=0), ValueError, "period is 0: it must be a number of seconds above 0"),
    (lambda c: Executor(c, timeout=-1), ValueError, "timeout is -1: it must be a number of seconds above 0"),
    (lambda c: Executor(c, overrun=0), ValueError, "overrun is 0: it must be GO_ON, CANCEL_CURRENT"),
    (lambda c: Executor(c, messages=0), ValueError, "messages is 0: it must be how many one publisher"),
    (lambda c: Executor(c, on_error=3), TypeError, "on_error is a function, not 3"),
    (lambda c: Executor(c, on_overrun=FIVE), TypeError, "on_overrun is a function, not 5"),
    (lambda c: Executor(c).spin_period(), ValueError, "there is no period: give one, spin_period(0.01)"),
    (lambda c: Executor(c).spin_period(-1), ValueError, "period is -1: it must be"),
    (lambda c: Executor(c).spin_one_period(), ValueError, "there is no period"),
]


@pytest.mark.parametrize(("use", "kind", "said"), REFUSED, ids=[case[2] for case in REFUSED])
def test_x1_init_refuses_what_makes_no_sense(
    bench: Bench, use: Callable[[Context], object], kind: type[Exception], said: str
) -> None:
    refused(bench.context, use, kind, said)


def test_x1_init(bench: Bench) -> None:
    executor = bench.executor(5, all_of(), semantics=LET, period=0.01, timeout=0.5, on_error=GO_ON)
    assert (executor.capacity, executor.handles, executor.errors, executor.overruns) == (5, [], 0, 0)


def test_x2_x34_what_has_ended_does_nothing(bench: Bench) -> None:
    executor = bench.executor()
    bench.context.node("node").timer(0.001, lambda: 1 / 0)
    bench.context.close()
    bench.context.close()
    executor.spin()
    assert not executor.spin_some(0.0)
    assert not executor.spin_until(lambda: False, 1.0)


ADDED: dict[str, Callable[[Context], Any]] = {
    "subscription": lambda c: c.node("n").subscription(Int32, "topic", print),
    "timer": lambda c: c.node("n").timer(1.0, print),
    "service": lambda c: c.node("n").service(AddTwoInts, "add", print),
    "client": lambda c: c.node("n").client(AddTwoInts, "add"),
    "guardcondition": lambda c: GuardCondition(c, print),
}


@pytest.mark.parametrize("make", ADDED.values(), ids=list(ADDED))
def test_x3_to_x12_add_and_remove(bench: Bench, make: Callable[[Context], Any]) -> None:
    executor = bench.executor(2)
    handle = make(bench.context)
    executor.add(handle)
    assert executor.handles == [handle]
    with pytest.raises(HandleError, match="was added already: an executor runs each handle once") as caught:
        executor.add(handle)
    assert caught.value.code == 11
    for wrong in (None, 5, type(handle), object()):
        with pytest.raises(TypeError, match="an executor cannot run") as refused:
            executor.add(wrong)
        assert getattr(refused.value, "code", None) == 11
    with pytest.raises(HandleError, match="belongs to another context: an executor runs handles of its own"):
        executor.add(make(bench.talker))
    with pytest.raises(TypeError, match="the callback of a handle is a function"):
        executor.add(make(bench.open()), FIVE)
    assert executor.handles == [handle], "what is refused leaves nothing behind"
    executor.remove(handle)
    assert executor.handles == []
    with pytest.raises(HandleError, match="is not in this executor") as absent:
        executor.remove(handle)
    assert (absent.value.code, isinstance(absent.value, RclError)) == (1, True)


def test_x5_too_many(bench: Bench) -> None:
    first, second = (bench.context.node("n").timer(1.0, print) for _ in range(2))
    executor = bench.executor(1)
    executor.add(first)
    with pytest.raises(
        CapacityError, match=r"executor is full: 1 handles of 1 in use\. Create it with handles=2\."
    ) as e:
        executor.add(second)
    assert (e.value.code, executor.handles) == (1, [first])
    assert second in bench.context.handles, "it is still there for others"


def test_x6_remove_keeps_the_order_of_the_others(bench: Bench) -> None:
    one_, two, three = topics = Topics(bench, 3).subscriptions
    executor = bench.executor()
    for subscription in topics:
        executor.add(subscription)
    for taken, left in ((three, [one_, two, three]), (two, [one_, three, two]), (one_, [three, two, one_])):
        executor.remove(taken)
        executor.add(taken)
        assert executor.handles == left


def test_one_executor_runs_a_handle(local: InSpace) -> None:
    topics = Topics(local, 2)
    first, second = local.executor(), local.executor(trigger=any_of())
    for subscription in topics.subscriptions:
        first.add(subscription)
    second.add(topics.subscriptions[1], lambda message: topics.got.append((7, message.data)))
    assert (first.handles, second.handles) == (topics.subscriptions[:1], topics.subscriptions[1:])
    topics.say((0, 1), (1, 2))
    first.spin_some()
    assert topics.got == [(0, 1)]
    second.spin_some()
    assert topics.got == [(0, 1), (7, 2)]


def test_a_whole_node(local: InSpace) -> None:
    node, other = local.context.node("node"), local.context.node("other")
    calls: list[str] = []
    first = node.timer(0, lambda: calls.append("first"))
    other.timer(0, lambda: calls.append("other"))
    node.subscription(Int32, "topic", lambda message: calls.append("second"))
    parameters = node.parameters()
    executor, mine = local.executor(), local.executor()
    mine.add(first)
    executor.add_node(node)
    assert len(executor.handles) == 1 + len(parameters.handles)
    local.talker.node("talker").publisher(Int32, "topic").publish(Int32())
    assert executor.spin_some()
    assert calls == ["second"]
    with pytest.raises(HandleError, match="node 'node' belongs to another context"):
        Executor(local.talker).add_node(node)
    with pytest.raises(CapacityError):
        local.executor(1).add_node(made_with_two(local))


def made_with_two(local: InSpace) -> Any:
    """A node with two timers."""
    node = local.context.node("two")
    node.timer(1.0, print)
    node.timer(1.0, print)
    return node


def test_spin_some_waits_as_long_as_it_takes(local: InSpace) -> None:
    local.context.node("n").timer(5000.0, print)
    start = local.now
    assert local.executor().spin_some(None)
    assert local.now - start == 5_000_000


def test_x13_spin_timer(bench: Bench) -> None:
    calls: list[int] = []
    bench.context.node("n").timer(0.1, lambda: calls.append(bench.now))
    bench.settle()
    calls.clear()
    executor = bench.executor()
    start = bench.now
    while bench.now < start + 500:
        executor.spin_some(0.05)
    assert len(calls) == 5
    assert {later - before for before, later in pairwise(calls)} <= {99, 100, 101}


def test_x14_a_timer_cancels_itself(bench: Bench) -> None:
    calls: list[int] = []

    def call() -> None:
        calls.append(1)
        if len(calls) == 3:
            timer.cancel()

    timer = bench.context.node("n").timer(0.1, call)
    executor = bench.executor()
    for _ in range(100):
        executor.spin_some(0.05)
    assert len(calls) == 3


def test_x15_a_cancelled_timer_stops_no_messages(bench: Bench) -> None:
    topics = Topics(bench, 1)
    timer = bench.context.node("n").timer(0.01, lambda: 1 / 0)
    timer.cancel()
    executor = bench.executor()
    for i in range(3):
        topics.say((0, i))
        executor.spin_some(0.1)
    assert topics.got == [(0, 0), (0, 1), (0, 2)]


def test_x16_spin_some_api(bench: Bench) -> None:
    topics = Topics(bench, 1)
    executor = bench.executor()
    for wrong in (cast(Any, "x"), math.nan, cast(Any, [])):
        with pytest.raises(ValueError, match=r"timeout is .*: it must be a number of seconds") as caught:
            executor.spin_some(wrong)
        assert getattr(caught.value, "code", None) == 11
    start = bench.now
    assert (executor.spin_some(), bench.now) == (False, start), "it does not wait unless told to"
    assert executor.spin_some(0.1) is False
    assert bench.now == start + 100, "nothing has come"
    topics.say((0, 42))
    start = bench.now
    assert executor.spin_some(0.1) is True
    assert (topics.got, bench.now) == ([(0, 42)], start)


def test_x17_pub_sub_example(bench: Bench) -> None:
    topics = Topics(bench, 1)
    topics.say((0, 42))
    assert bench.executor().spin_some(0.1)
    assert topics.got == [(0, 42)]


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0)])
def test_x18_sequential(bench: Bench, order: tuple[int, int, int]) -> None:
    topics = Topics(bench, 3)
    executor = bench.executor()
    for subscription in topics.subscriptions:
        executor.add(subscription)
    topics.say(*[(topic, i) for i in range(3) for topic in order])
    for passes in range(1, 4):
        executor.spin_some(0.1)
        assert len(topics.got) == 3 * passes, "one message of each subscription in a pass"
    assert topics.got == [(topic, i) for i in range(3) for topic in range(3)]


def test_x19_invocation(bench: Bench) -> None:
    topics = Topics(bench, 2)
    executor = bench.executor(trigger=always)
    executor.add(topics.subscriptions[0], when=ALWAYS)
    executor.add(topics.subscriptions[1])
    topics.say((0, 5), (1, 6))
    executor.spin_some(0.01)
    executor.spin_some(0.01)
    assert topics.got == [(0, 5), (1, 6), (0, None)]
    with pytest.raises(ValueError, match="when is 7: it must be ON_NEW_DATA or ALWAYS"):
        executor.add(topics.subscriptions[1], when=7)
    with pytest.raises(
        HandleError, match=r"the callback of the timer of 1000 ms, cannot run ALWAYS: only subscr"
    ):
        executor.add(bench.context.node("n").timer(1.0, print), when=ALWAYS)


def test_always_waits_for_news_and_then_for_the_end(local: InSpace) -> None:
    topics = Topics(local, 1)
    executor = local.executor(trigger=always)
    executor.add(topics.subscriptions[0], when=ALWAYS)
    start = local.now
    assert executor.spin_some(0.25)
    assert (local.now - start, topics.got) == (250, [(0, None)])
    executor.trigger = None
    assert not executor.spin_some(0.25), "without a trigger something has to be new"
    assert topics.got == [(0, None)]


def test_always_at_a_fixed_rate(local: InSpace) -> None:
    topics = Topics(local, 1)
    executor = local.executor(trigger=always, period=0.02)
    executor.add(topics.subscriptions[0], when=ALWAYS)
    for i in range(4):
        if i == 2:
            topics.say((0, i))
        executor.spin_one_period()
    assert topics.got == [(0, None), (0, None), (0, 2), (0, None)]


def test_x20_what_is_added_between_two_spins(bench: Bench) -> None:
    topics = Topics(bench, 2)
    executor = bench.executor()
    executor.add(topics.subscriptions[0])
    topics.say((0, 1), (1, 1))
    executor.spin_some(0.1)
    executor.add(topics.subscriptions[1])
    topics.say((0, 2))
    executor.spin_some(0.1)
    assert topics.got == [(0, 1), (0, 2), (1, 1)]


def test_x21_spin_period_keeps_its_pace_and_catches_up(bench: Bench) -> None:
    starts: list[int] = []
    executor = bench.executor()

    def call(message: object) -> None:
        starts.append(bench.now)
        if len(starts) == 10:
            bench.take(50)
        if len(starts) == 100:
            executor.stop()

    executor.trigger = always
    executor.add(Topics(bench, 1).subscriptions[0], call, when=ALWAYS)
    begin = bench.now
    executor.spin_period(0.02)
    expected = [begin + 20 * i for i in range(100)]
    assert starts[10:12] == [begin + 230, begin + 230], "what is late is caught up without a pause"
    assert [at for i, at in enumerate(starts) if i not in (10, 11)] == [
        at for i, at in enumerate(expected) if i not in (10, 11)
    ]


def test_spin_one_period_goes_on_where_the_last_has_ended(local: InSpace) -> None:
    executor = local.executor(period=0.02)
    start = local.now
    executor.spin_one_period()
    local.take(15)
    executor.spin_one_period()
    assert local.now == start + 40
    executor.spin_one_period(0.005)
    assert local.now == start + 45


def seen_behind(bench: Bench, semantics: int) -> list[list[int]]:
    """B has 1; A, which comes before it, publishes 2 there: what B sees in this pass and in the next one."""
    node, talker = bench.context.node("node"), bench.talker.node("talker")
    got: list[int] = []
    publisher = node.publisher(Int32, "b", Qos(depth=1))
    a = node.subscription(Int32, "a", None)
    b = node.subscription(Int32, "b", lambda message: got.append(message.data), Qos(depth=1))
    executor = bench.executor(trigger=any_of(), semantics=semantics)

    def forward(message: Any) -> None:
        publisher.publish(Int32(data=2))
        bench.take(20)
        bench.context.middleware.spin_once()  # as long as it would take until it is there

    executor.add(a, forward)
    executor.add(b)
    publishers = [talker.publisher(Int32, name) for name in ("a", "b")]
    bench.settle()
    for value, sender in enumerate(publishers):
        assert sender.publish(Int32(data=value))
    bench.settle()
    passes = []
    for _ in range(2):
        executor.spin_some()
        bench.settle()
        passes.append(got.copy())
        got.clear()
    return passes


def test_x22_rclcpp_sees_what_was_published_in_the_same_pass(bench: Bench) -> None:
    assert seen_behind(bench, RCLCPP) == [[2], []]


def test_x23_let_sees_what_was_there_at_the_start(bench: Bench) -> None:
    assert seen_behind(bench, LET) == [[1], [2]]


def test_x24_trigger_one(bench: Bench) -> None:
    topics = Topics(bench, 2)
    executor = bench.executor(trigger=one(topics.subscriptions[1]))
    for subscription in topics.subscriptions:
        executor.add(subscription)
    topics.say((0, 1), (0, 2))
    assert not executor.spin_some(0.01)
    topics.say((1, 3))
    assert executor.spin_some(0.01)
    assert topics.got == [(0, 1), (1, 3)]
    assert not executor.spin_some(0.01), "the second of the first topic waits for the trigger again"


@pytest.mark.parametrize("named", [False, True])
def test_x25_trigger_any(bench: Bench, named: bool) -> None:
    topics = Topics(bench, 3)
    executor = bench.executor(trigger=any_of(*topics.subscriptions[1:]) if named else any_of())
    for subscription in topics.subscriptions:
        executor.add(subscription)
    topics.say((0, 1))
    assert executor.spin_some(0.01) is not named
    topics.say((2, 1))
    executor.spin_some(0.01)
    assert topics.got == [(0, 1), (2, 1)]


def test_x26_trigger_all(bench: Bench) -> None:
    topics = Topics(bench, 2)
    executor = bench.executor(trigger=all_of())
    for subscription in topics.subscriptions:
        executor.add(subscription)
    topics.say((1, 1))
    assert not executor.spin_some(0.01)
    topics.say((0, 1))
    assert executor.spin_some(0.01)
    assert topics.got == [(0, 1), (1, 1)]


def test_x26_trigger_all_takes_the_newest(bench: Bench) -> None:
    """The trigger example of the documentation: two callbacks only with both messages, and the newest string."""
    talker, node = bench.talker.node("talker"), bench.context.node("node")
    said: list[str] = []
    text = node.subscription(String, "text", lambda m: said.append(m.data), Qos(depth=1))
    number = node.subscription(Int32, "number", lambda m: said.append(str(m.data)), Qos(depth=1))
    executor = bench.executor(trigger=all_of(text, number))
    executor.add(text)
    executor.add(number)
    texts, numbers = talker.publisher(String, "text"), talker.publisher(Int32, "number")
    bench.settle()
    for i in range(1, 7):
        texts.publish(String(data=f"Hello World!{i}"))
        bench.settle()
        executor.spin_some()
        if i % 3 == 0:
            numbers.publish(Int32(data=i))
            bench.settle()
            executor.spin_some()
    assert said == ["Hello World!3", "3", "Hello World!6", "6"]


@pytest.mark.parametrize("how", ["added", "not added", "trigger set later"])
def test_until_a_trigger_says_so_nothing_runs_early(local: InSpace, how: str) -> None:
    topics = Topics(local, 1, Qos(depth=10))
    subscription = topics.subscriptions[0]
    subscription.depth = 2
    executor = local.executor(trigger=None if how == "trigger set later" else all_of())
    if how != "not added":
        executor.add(subscription)
    gate = GuardCondition(local.context, print)
    executor.trigger = all_of(subscription, gate)
    topics.say(*[(0, i) for i in range(5)])
    assert not executor.spin_some(0.0)
    assert topics.got == []
    assert subscription.lost == 3


def test_x27_trigger_of_the_users_own(bench: Bench) -> None:
    topics = Topics(bench, 2)
    seen: list[list[Any]] = []

    def both(handles: list[Any]) -> bool:
        seen.append(list(handles))
        return all(handle.ready(bench.context.clock()) for handle in handles)

    executor = bench.executor(trigger=both)
    for subscription in topics.subscriptions:
        executor.add(subscription)
    topics.say((1, 1))
    assert not executor.spin_some(0.0)
    topics.say((0, 1))
    assert executor.spin_some(0.0)
    assert seen == [topics.subscriptions] * 2


def test_x28_x29_x30_services(bench: Bench) -> None:
    node, asking = bench.context.node("server"), bench.talker.node("client")
    seen: list[bytes] = []
    state = {"factor": 42}

    def answer(request: Any) -> Any:
        seen.append(service.identity)
        return AddTwoInts.Response(sum=request.a + request.b + (state["factor"] if request.a == 0 else 0))

    service = node.service(AddTwoInts, "add", answer)
    client = asking.client(AddTwoInts, "add")
    bench.settle()
    got: list[int] = []
    for a, b in ((1, 2), (0, 0)):
        assert client.send(AddTwoInts.Request(a=a, b=b), lambda reply: got.append(reply.sum))
        bench.settle()
        bench.executor().spin_some(0.1)
        bench.settle()
        Executor(bench.talker).spin_some(0.1)
    assert got == [3, 42]
    assert len(set(seen)) == 2
    assert {len(identity) for identity in seen} == {24}


def test_a_request_is_answered_once(bench: Bench) -> None:
    service = bench.context.node("server").service(AddTwoInts, "add", lambda request: None)
    client = bench.talker.node("client").client(AddTwoInts, "add")
    bench.settle()
    answers: list[Any] = []
    assert client.send(AddTwoInts.Request(), answers.append, timeout=1.0)
    bench.settle()
    assert bench.executor().spin_some(0.1)
    for number in (1, 2):
        service.reply(service.identity, AddTwoInts.Response(sum=number))
        bench.settle()
    asking = Executor(bench.talker)
    while asking.spin_some(0.1):
        pass
    bench.take(2000)
    assert not asking.spin_some(0.1)
    assert [answer.sum for answer in answers] == [1]


def test_x31_a_callback_with_a_context_is_a_closure(bench: Bench) -> None:
    topics = Topics(bench, 1)
    got: list[tuple[int, int]] = []
    executor = bench.executor()
    context_value = 42
    executor.add(topics.subscriptions[0], lambda message: got.append((context_value, message.data)))
    topics.say((0, 1))
    executor.spin_some(0.1)
    assert got == [(42, 1)]


def test_x32_x33_guard_conditions(bench: Bench) -> None:
    calls: list[int] = []
    guard = GuardCondition(bench.context, lambda: calls.append(1))
    executor = bench.executor()
    executor.add(guard)
    guard.trigger()
    guard.trigger()
    assert executor.spin_some()
    assert not executor.spin_some()
    assert calls == [1]
    guard.trigger()
    executor.remove(guard)
    assert not executor.spin_some()
    assert calls == [1]


# Ending


@pytest.mark.parametrize("spin", [Executor.spin, lambda executor: executor.spin_period(0.02)])
def test_a_callback_stops_what_spins(bench: Bench, spin: Callable[[Executor], None]) -> None:
    calls: list[int] = []
    executor = bench.executor()

    def call() -> None:
        calls.append(1)
        if len(calls) >= 3:
            executor.stop()

    executor.add(bench.context.node("n").timer(0.01, call))
    spin(executor)
    assert len(calls) == 3
    assert bench.context.running
    spin(executor)
    assert len(calls) == 4, "it may spin again"


def test_a_stop_that_comes_first_ends_the_next_spin(local: InSpace) -> None:
    executor = local.executor()
    executor.stop()
    executor.spin()
    assert local.waits == []


def test_spin_until(local: InSpace) -> None:
    calls: list[int] = []
    local.context.node("n").timer(0.1, lambda: calls.append(1))
    executor = local.executor()
    start = local.now
    assert executor.spin_until(lambda: len(calls) == 3, 1.0)
    assert local.now == start + 300
    assert not executor.spin_until(lambda: len(calls) == 100, 1.0)
    assert local.now == start + 1300
    executor.stop()
    assert not executor.spin_until(lambda: False)


def test_spin_until_looks_whenever_a_wait_has_ended(local: InSpace) -> None:
    """What the middleware itself brings about, a state or a match, is no news for a handle."""
    came: list[int] = []

    def woken_early() -> None:
        came.append(1)
        local.now -= 200

    local.on_wait = woken_early
    assert local.executor(timeout=0.3).spin_until(lambda: came)
    assert local.waits == [300]


def test_a_round_of_spin_waits_as_long_as_it_is_told(local: InSpace) -> None:
    executor = local.executor(timeout=0.3)
    executor.add(GuardCondition(local.context, print))
    local.on_wait = lambda: executor.stop() if len(local.waits) == 2 else None
    executor.spin()
    assert local.waits == [300, 300]


# Errors of callbacks


def broken(message: object) -> None:
    """A callback that raises."""
    raise ZeroDivisionError("the gain is 0")


def test_an_error_is_raised_and_says_whose_it_is(bench: Bench) -> None:
    topics = Topics(bench, 1)
    executor = bench.executor()
    executor.add(topics.subscriptions[0], broken)
    topics.say((0, 1), (0, 2))
    with pytest.raises(ZeroDivisionError, match="the gain is 0") as caught:
        executor.spin_some(0.1)
    assert caught.value.__notes__ == ["raised by broken, the callback of subscription 'topic_0'"]
    with pytest.raises(ZeroDivisionError):
        executor.spin()
    assert executor.errors == 2


@pytest.mark.parametrize("semantics", [RCLCPP, LET])
def test_a_trigger_that_raises_is_an_error_like_others(bench: Bench, semantics: int) -> None:
    topics = Topics(bench, 1)
    told: list[tuple[int, str]] = []
    bench.context.on_problem(lambda code, text: told.append((code, text)))
    raises = bench.executor(trigger=broken, semantics=semantics)
    raises.add(topics.subscriptions[0])
    topics.say((0, 1))
    with pytest.raises(ZeroDivisionError) as caught:
        raises.spin_some(0.1)
    assert caught.value.__notes__[0].startswith("raised by the trigger")
    goes_on = bench.executor(trigger=broken, semantics=semantics, on_error=GO_ON)
    goes_on.add(topics.subscriptions[0])
    assert not goes_on.spin_some(0.1)
    assert goes_on.errors
    assert told[0][1].startswith("the trigger")
    goes_on.trigger = None
    goes_on.spin_some(0.1)
    assert topics.got == [(0, 1)]


def test_an_executor_may_go_on_and_tell(bench: Bench) -> None:
    topics = Topics(bench, 2)
    told: list[tuple[int, str]] = []
    bench.context.on_problem(lambda code, text: told.append((code, text)))
    executor = bench.executor(on_error=GO_ON)
    executor.add(topics.subscriptions[0], broken)
    executor.add(topics.subscriptions[1])
    for i in range(5):
        topics.say((0, i), (1, i))
        executor.spin_some(0.1)
    assert topics.got == [(1, i) for i in range(5)]
    assert executor.errors == 5
    assert [code for code, _ in told] == [51] * 3, "the 1st, 2nd and 4th"
    assert told[0][1].startswith(
        "broken, the callback of subscription 'topic_0', raised ZeroDivisionError: the gain is 0 (test_executor.py:"
    )
    assert told[2][1].endswith("The executor goes on, 4 so far.")


def test_a_function_may_decide_whether_to_go_on(local: InSpace) -> None:
    topics = Topics(local, 1)
    seen: list[tuple[Any, Exception]] = []

    def decide(handle: Any, error: Exception) -> bool:
        seen.append((handle, error))
        return len(seen) < 3

    executor = local.executor(on_error=decide)
    executor.add(topics.subscriptions[0], broken)
    topics.say((0, 1), (0, 2), (0, 3))
    executor.spin_some()
    executor.spin_some()
    with pytest.raises(ZeroDivisionError):
        executor.spin_some()
    assert [handle for handle, _ in seen] == topics.subscriptions * 3


def test_errors_of_what_is_run_early_are_told_too(local: InSpace) -> None:
    """A subscription of depth 1 has its callback run when the second message comes, inside the middleware."""
    topics = Topics(local, 1, Qos(depth=5))
    topics.subscriptions[0].depth = 1
    seen: list[Any] = []
    executor = local.executor(on_error=lambda handle, error: seen.append(handle) or True)  # type: ignore[func-returns-value]
    executor.add(topics.subscriptions[0], broken)
    topics.say((0, 1), (0, 2))
    executor.spin_some()
    assert seen == topics.subscriptions * 2
    strict = local.executor()
    executor.remove(topics.subscriptions[0])
    strict.add(topics.subscriptions[0])
    topics.say((0, 1), (0, 2))
    with pytest.raises(ZeroDivisionError) as caught:
        strict.spin_some()
    assert caught.value.__notes__ == ["raised by broken, the callback of subscription 'topic_0'"]


NAMED: dict[str, Callable[[Context], Any]] = {
    "print, the callback of the timer of 20 ms": lambda c: c.node("n").timer(0.02, print),
    "print, the callback of service '/add'": lambda c: c.node("n").service(AddTwoInts, "add", print),
    "a callback of client '/add'": lambda c: c.node("n").client(AddTwoInts, "add"),
    "print, the callback of a guard condition": lambda c: GuardCondition(c, print),
    "method, the callback of subscription 'x'": lambda c: c.node("n").subscription(
        Int32, "x", Named().method
    ),
}


class Named:
    """Something with a method."""

    def method(self, message: object) -> None:
        """A callback."""


@pytest.mark.parametrize("said", NAMED)
def test_callbacks_are_called_by_name(local: InSpace, said: str) -> None:
    from muros.rclc.host.handles import describe

    assert describe(NAMED[said](local.context)).replace("Named.", "") == said


# Timers


def test_timers_of_hosts_are_exact(local: InSpace) -> None:
    clock = 0.0
    local.context.clock = lambda: clock  # type: ignore[assignment,return-value]
    calls: list[float] = []
    timer = local.context.node("n").timer(1 / 400, lambda: calls.append(clock))
    executor = local.executor()
    for _ in range(4000):
        clock += 0.25
        executor.spin_some()
    assert len(calls) == 400
    assert calls[:3] == [2.5, 5.0, 7.5]
    assert timer.exchange_period(0.5) == 1 / 400
    assert timer.period == 500


# Handles, and what errors are called


def test_h1_to_h5_handles(bench: Bench) -> None:
    """What a handle is when it is made, when an executor has it, and when it is gone."""
    from muros.rclc.executor import Handle

    bare = Handle(bench.context)
    assert (bare.entity, bare.handles, bare.eager) == (None, None, True)
    assert bare.left(0) >= 1_000_000, "it is never ready by itself"
    assert bench.context.handles == [bare]
    bare.destroy()
    assert bench.context.handles == []
    subscription = bench.context.node("n").subscription(Int32, "topic", print)
    executor = bench.executor()
    executor.add(subscription)
    assert subscription.handles is executor.handles
    assert subscription.entity is not None
    executor.remove(subscription)
    assert executor.handles == []


def test_x6_removing_what_is_not_there(bench: Bench) -> None:
    executor = bench.executor()
    timer = bench.context.node("n").timer(1.0, print)
    executor.add(bench.context.node("n").timer(2.0, print))
    with pytest.raises(HandleError) as absent:
        executor.remove(timer)
    assert str(absent.value) == "print, the callback of the timer of 1000 ms, is not in this executor"
    assert absent.value.code == 1
    with pytest.raises(TypeError, match="an executor cannot run None: add subscriptions") as none:
        executor.remove(None)
    assert getattr(none.value, "code", None) == 11


@pytest.mark.parametrize("semantics", [RCLCPP, LET])
@pytest.mark.parametrize("gone", [0, 1, 2])
@pytest.mark.parametrize("how", ["destroy", "remove"])
def test_who_takes_a_handle_away_shifts_no_others(bench: Bench, semantics: int, gone: int, how: str) -> None:
    calls: list[int] = []

    def call(i: int) -> None:
        calls.append(i)
        if i == 1:
            guards[gone].destroy() if how == "destroy" else executor.remove(guards[gone])

    guards = [GuardCondition(bench.context, lambda i=i: call(i)) for i in range(4)]  # type: ignore[misc]
    executor = bench.executor(semantics=semantics)
    for guard in guards:
        executor.add(guard)
        guard.trigger()
    assert executor.spin_some()
    assert calls == [i for i in range(4) if i != gone or i <= 1]
    assert not executor.spin_some()


def test_who_ends_a_client_when_nobody_has_answered_hears_no_more_of_it(bench: Bench) -> None:
    client = bench.context.node("n").client(AddTwoInts, "add")
    bench.settle()
    answers: list[None] = []

    def ended(reply: Any) -> None:
        answers.append(reply)
        client.destroy()

    executor = bench.executor()
    for _ in range(3):
        assert client.send(AddTwoInts.Request(), ended, timeout=0.05)
    assert executor.spin_until(lambda: answers, 1.0)
    assert not executor.spin_some(0.1)
    assert answers == [None]


MISUSED: list[tuple[Callable[[Context], object], type[Exception], str]] = [
    (lambda c: c.node("n").timer(1.0, print).exchange_period(-1), ValueError, "period of a timer is -1: it"),
    (lambda c: c.node("n").timer(1.0, print).exchange_period(math.nan), ValueError, "timer is nan: it"),
    (lambda c: c.node("n").timer(1.0, print).exchange_period(cast(Any, "x")), ValueError, "timer is 'x': it"),
    (lambda c: GuardCondition(c, FIVE), TypeError, "the callback of a guard condition is a function, not 5"),
    (lambda c: GuardCondition(FIVE, print), TypeError, "GuardCondition needs a context, not 5"),
    (lambda c: Executor(c).spin_some(cast(Any, "x")), ValueError, "timeout is 'x': it must be a number of"),
    (lambda c: Executor(c).spin_until(bool, math.nan), ValueError, "timeout is nan: it must be a number"),
    (lambda c: CallbackGroup(FIVE), TypeError, "the name of a group is a str, not 5"),
    (lambda c: CallbackGroup("g").add(None), TypeError, "a group cannot run None: add subscriptions"),
    (
        lambda c: Context(Udp("127.0.0.1", 9), client_key=0),
        ValueError,
        "client_key is 0x0: it must be from 1",
    ),
]


@pytest.mark.parametrize(("use", "kind", "said"), MISUSED, ids=[case[2] for case in MISUSED])
def test_wrong_use_has_the_code_of_the_c_library(
    local: InSpace, use: Callable[[Context], object], kind: type[Exception], said: str
) -> None:
    refused(local.context, use, kind, said)


def test_errors_bear_the_codes_of_the_c_library() -> None:
    codes = json.loads((Path(__file__).parents[1] / "vectors/rmw/return_codes.json").read_text())["rcl"]
    assert HandleError.code == codes["INVALID_ARGUMENT"]
    assert CapacityError.code == codes["ERROR"]


def test_the_numbers_of_problems_are_told_apart() -> None:
    from muros.rclc import let
    from muros.rclc.host import executor as host_executor
    from muros.rclc.host import handles as host_handles
    from muros.space import rclc

    ours = {let.OVERRUN, host_executor.CALLBACK, host_handles.MALFORMED}
    theirs = {rclc.ENCODING, rclc.NETWORK, rclc.NOT_SPUN, rclc.OTHER, *rclc.PROBLEMS.values()}
    assert len(ours) == 3
    assert not ours & theirs
