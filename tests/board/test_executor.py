"""Executors of boards on every runtime, in virtual time: order, triggers, periods, ALWAYS, LET, errors."""

from muros.client import Session
from muros.client.raw import Raw
from muros.compat import const, ticks_add
from muros.rclc.context import Context
from muros.rclc.errors import CapacityError
from muros.rclc.executor import Executor
from muros.rclc.guard import GuardCondition
from muros.rclc.handle_error import HandleError
from muros.rclc.triggers import all_of, always, any_of, one
from tests.board.agent import Agent
from tests.board.harness import allocates, raises
from tests.board.test_client import Number

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

_RCLCPP = const(0)
_LET = const(1)
_ALWAYS = const(1)
_GO_ON = const(1)
_CANCEL_CURRENT = const(2)
_CANCEL_WITHOUT_OUTPUT = const(3)
_CANCEL_NEXT = const(4)


class Way(Agent):
    """An agent; waiting for it lets time pass."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 1000
        self.on_wait: "Callable[[], object] | None" = None

    def wait(self, timeout: int) -> None:
        if not self.inbox:
            self.now += max(timeout, 1)
        if self.on_wait is not None:
            self.on_wait()


class Service:
    """A service of numbers."""

    TYPE = "example_interfaces/srv/AddTwoInts"
    Request = Response = Number


class Bench:
    """A context on an agent; ``heard`` is when, in ms since it was connected, a wait found something that had left."""

    def __init__(self, **session: "Any") -> None:
        self.way = Way()
        self.session = Session(self.way, 1, **session)
        self.context = Context(self.session)
        self.context.clock = lambda: self.way.now
        made: "Any" = self.context
        self.node = made.node("node")
        self.node._topic = lambda name: "rt/" + name  # hosts lend no private methods
        self.node._resolve = lambda name: "/" + name
        self.heard: "list[Any]" = []
        self.start = 0

    def connect(self) -> None:
        for _ in range(20):
            self.way.now += 10
            self.session.spin_once(self.way.now)
        assert self.session.state == 2
        self.way.written.clear()
        self.start = self.way.now
        self.way.on_wait = None

    def executor(self, handles: int = 0, trigger: "Any" = None, **options: "Any") -> "Any":
        return Executor(self.context, handles, trigger, **options)

    def at(self) -> int:
        return self.way.now - self.start

    def hear(self) -> None:
        if self.way.written:
            self.heard.append(self.at())

    def written(self) -> "list[int]":
        """The numbers that have left since it was asked last."""
        numbers = [message[-4] | message[-3] << 8 for message in self.way.written]
        self.way.written.clear()
        return numbers


def number(value: int) -> Number:
    made = Number()
    made.data = value
    return made


def give(subscription: "Any", value: int) -> None:
    subscription.deliver(bytes((value, 0, 0, 0)), 0, 4)


def test_x5_x6_capacity_and_order() -> None:
    bench = Bench()
    timers = [bench.node.timer(1.0, None) for _ in range(3)]
    executor = bench.executor(2)
    executor.add(timers[0])
    executor.add(timers[1])
    with raises(CapacityError) as full:
        executor.add(timers[2])
    assert "executor is full: 2 handles of 2 in use. Create it with handles=3." in str(full.value)
    executor.remove(timers[0])
    executor.add(timers[0])
    assert executor.handles == [timers[1], timers[0]]
    with raises(HandleError) as wrong:
        executor.add(timers[1])
    error: "Any" = wrong.value
    assert error.code == 11
    with raises(HandleError) as wrong:
        executor.remove(timers[2])
    error = wrong.value
    assert error.code == 1
    other = Bench().node.timer(1.0, None)
    for handle in (other, None, 5):
        with raises(HandleError):
            executor.add(handle)


def test_x13_timers() -> None:
    bench = Bench()
    bench.connect()
    calls: "list[int]" = []
    bench.node.timer(0.1, lambda: calls.append(bench.at()))
    executor = bench.executor()
    for _ in range(10):
        executor.spin_some(0.05)
    assert calls == [100, 200, 300, 400, 500]


def test_a_timer_keeps_its_phase_and_skips_what_it_has_missed() -> None:
    bench = Bench()
    timer = bench.node.timer(0.1, lambda: None)
    start = bench.way.now
    left: "list[int]" = []
    for late in (100, 299, 300, 401, 599, 1099):
        assert timer.ready(start + late)
        timer.run(start + late)
        left.append(timer.left(start + late))
    assert left == [100, 1, 100, 99, 1, 1]
    assert timer.since == 500


def test_a_timer_without_a_period_is_ready_after_weeks_too() -> None:
    bench = Bench()
    timer = bench.node.timer(0, lambda: None)
    now = bench.way.now
    for _ in range(6):
        assert timer.ready(now), "ticks of boards begin again after twelve days"
        timer.run(now)
        now = ticks_add(now, 1 << 28)


def test_x14_x15_a_timer_cancels_itself_and_stops_no_messages() -> None:
    bench = Bench()
    calls: "list[int]" = []
    got: "list[int]" = []

    def call() -> None:
        calls.append(bench.at())
        if len(calls) == 3:
            timer.cancel()

    subscription = bench.node.subscription(Number, "a", lambda m: got.append(m.data))
    bench.connect()
    timer = bench.node.timer(0.1, call)
    executor = bench.executor()
    for _ in range(10):
        executor.spin_some(0.05)
    assert calls == [100, 200, 300]
    for value in (1, 2, 3):
        give(subscription, value)
        assert executor.spin_some(0.05)
    assert got == [1, 2, 3]
    assert len(calls) == 3
    timer.reset()
    executor.spin_some(0.2)
    assert len(calls) == 4


def test_x18_x20_x31_the_order_of_adding() -> None:
    bench = Bench()
    got: "list[Any]" = []
    made = [bench.node.subscription(Number, name, None) for name in ("a", "b", "c")]
    bench.connect()
    executor = bench.executor()

    def noter(name: str) -> "Callable[[Any], object]":
        return lambda message: got.append((name, message.data))

    for i in range(3):
        executor.add(made[i], noter("abc"[i]))
    for order in ((0, 1, 2), (2, 1, 0), (1, 2, 0)):
        for i in order:
            give(made[i], 10 + i)
        got.clear()
        assert executor.spin_some()
        assert got == [("a", 10), ("b", 11), ("c", 12)]
    late = bench.node.subscription(Number, "d", None)
    executor.add(late, noter("d"))
    give(late, 13)
    give(made[0], 14)
    got.clear()
    executor.spin_some()
    assert got == [("a", 14), ("d", 13)]


def test_x28_x29_x30_services() -> None:
    bench = Bench()
    seen: "list[bytes]" = []
    offset = 42

    def answer(request: "Any") -> Number:
        seen.append(service.identity)
        return number(request.data + offset)

    service = bench.node.service(Service, "add", answer)
    bench.connect()
    executor = bench.executor()
    for i in range(2):
        service.deliver(bytes((i,)) * 24, bytes((i, 0, 0, 0)), 0, 4)
    assert executor.spin_some()
    assert executor.spin_some()
    assert not executor.spin_some()
    assert seen == [bytes(24), b"\1" * 24]
    assert bench.written() == [42, 43]


def test_x19_invocation() -> None:
    bench = Bench()
    got: "list[Any]" = []
    first = bench.node.subscription(Number, "a", lambda m: got.append(m if m is None else m.data))
    second = bench.node.subscription(Number, "b", lambda m: got.append(10 * m.data))
    bench.connect()
    executor = bench.executor(trigger=always)
    executor.add(first, None, _ALWAYS)
    executor.add(second)
    give(first, 5)
    give(second, 6)
    executor.spin_some()
    executor.spin_some()
    assert got == [5, 60, None]
    executor.trigger = None
    executor.spin_some()
    assert got == [5, 60, None]
    with raises(HandleError):
        executor.add(bench.node.timer(1.0, None), None, _ALWAYS)


def test_x21_periods() -> None:
    bench = Bench()
    starts: "list[int]" = []
    executor = bench.executor(trigger=always, period=0.02)

    def call(message: object) -> None:
        starts.append(bench.at())
        if len(starts) == 2:
            bench.way.now += 50
        if len(starts) == 6:
            executor.stop()

    executor.add(bench.node.subscription(Number, "a", None), call, _ALWAYS)
    bench.connect()
    executor.spin_period()
    assert starts == [0, 20, 70, 70, 80, 100], "what is late is caught up"
    executor.spin_one_period()
    executor.spin_one_period(0.005)
    assert bench.at() == 145
    assert starts[6:] == [100, 140], "where the last has ended, at once since that one was stopped"


def test_spin_ends_when_it_is_told() -> None:
    bench = Bench()
    calls: "list[int]" = []
    executor = bench.executor()

    def call() -> None:
        calls.append(1)
        if len(calls) >= 3:
            executor.stop()

    bench.node.timer(0.01, call)
    bench.connect()
    executor.spin()
    assert len(calls) == 3
    executor.spin()
    assert len(calls) == 4


def test_x24_to_x27_triggers() -> None:
    bench = Bench()
    got: "list[str]" = []
    a = bench.node.subscription(Number, "a", lambda m: got.append("a"))
    b = bench.node.subscription(Number, "b", lambda m: got.append("b"))
    bench.connect()
    executor = bench.executor()
    executor.add(a)
    executor.add(b)
    cases: "Any" = (
        (one(b), 0, 1, 1),
        (any_of(), 1, 1, 1),
        (all_of(), 0, 0, 1),
        (all_of(a), 1, 0, 1),
        (lambda handles: len(handles) == 2 and b.ready(0), 0, 1, 1),
    )
    for trigger, with_a, with_b, with_both in cases:
        executor.trigger = trigger
        for handles, expected in (((a,), with_a), ((b,), with_b), ((b, a), with_both)):
            for handle in handles:
                give(handle, 1)
            got.clear()
            assert executor.spin_some() == bool(expected)
            assert (
                got
                == (["a", "b"] if len(handles) == 2 else ["a"] if handles[0] is a else ["b"])[
                    : len(handles) * expected
                ]
            )
            a.take()
            b.take()


def test_x32_guard_conditions() -> None:
    bench = Bench()
    calls: "list[int]" = []
    guard = GuardCondition(bench.context, lambda: calls.append(1))
    bench.connect()
    executor = bench.executor()
    guard.trigger()
    assert executor.spin_some()
    assert not executor.spin_some()
    guard.trigger()
    guard.destroy()
    assert not executor.spin_some()
    assert calls == [1]


def seen_behind(semantics: int) -> "list[int]":
    """B has 1; A, which comes before it, has 2 put in its place: what B sees."""
    bench = Bench()
    got: "list[int]" = []
    a = bench.node.subscription(Number, "a", None)
    b = bench.node.subscription(Number, "b", lambda m: got.append(m.data))
    bench.connect()
    executor = bench.executor(trigger=any_of(), semantics=semantics)
    executor.add(a, lambda m: give(b, 2) if semantics == _RCLCPP else None)
    executor.add(b)
    give(a, 1)
    give(b, 1)
    executor.spin_some()
    return got


def test_x22_x23_semantics() -> None:
    assert seen_behind(_RCLCPP) == [2]
    assert seen_behind(_LET) == [1]


def test_let_outputs_leave_at_the_end_of_the_period_in_the_order_of_adding() -> None:
    bench = Bench()
    out = bench.node.publisher(Number, "out")
    loose = bench.node.publisher(Number, "loose", "sensor_data")
    message = Number()
    executor = bench.executor(semantics=_LET, period=0.01)
    calls: "list[Any]" = []

    def call(value: int, publisher: "Any") -> None:
        calls.append((bench.at(), value))
        message.data = value
        assert publisher.publish(message)
        message.data = value + 100
        assert publisher.publish(message)
        bench.way.now += 3

    executor.add(bench.node.timer(0, lambda: call(1, out)))
    executor.add(bench.node.timer(0, lambda: call(2, loose)))
    executor.add(bench.node.timer(0.02, lambda: call(3, out)), None, 0, 0.015)
    bench.connect()
    bench.way.on_wait = bench.hear
    numbers = []
    for _ in range(4):
        executor.spin_one_period()
        bench.session.spin_once(bench.way.now)
        numbers.append(bench.written())
    assert calls[:4] == [(0, 1), (3, 2), (6, 3), (10, 1)]
    assert (26, 3) in calls
    assert numbers == [[1, 101, 2, 102], [1, 101, 2, 102, 3, 103]] * 2
    assert bench.heard == [], "nothing leaves before the end of a period"
    assert executor.let.overruns == 0


def test_let_more_outputs_than_the_window_has_room_for() -> None:
    bench = Bench(history=2)
    out = bench.node.publisher(Number, "out")
    executor = bench.executor(semantics=_LET, period=0.01)

    def call() -> None:
        for i in range(8):
            assert out.publish(number(i))

    timer = bench.node.timer(0, call)
    executor.add(timer)
    bench.connect()
    executor.spin_one_period()
    timer.cancel()
    for _ in range(10):
        executor.spin_one_period()
    assert bench.written() == [0, 1, 2, 3, 4, 5, 6, 7]


def test_let_bounds_what_is_published() -> None:
    bench = Bench()
    out = bench.node.publisher(Number, "out")
    executor = bench.executor(semantics=_LET, period=0.01, messages=2)
    caught: "list[str]" = []

    def call() -> None:
        try:
            for i in range(8):
                out.publish(number(i))
        except CapacityError as error:
            caught.append(str(error))

    executor.add(bench.node.timer(0, call), None, 0, 0, 3)
    bench.connect()
    executor.spin_one_period()
    assert caught == [
        "3 messages of 3 of rt/out wait for the end of the period. Give the executor messages=4."
    ]
    bench.session.spin_once(bench.way.now)
    assert bench.written() == [0, 1, 2]


def test_let_holds_back_no_log() -> None:
    bench = Bench()
    log = bench.node.publisher(Number, "rosout")
    out = bench.node.publisher(Number, "out")
    said: "list[list[int]]" = []

    def call() -> None:
        for i in range(2):
            assert log.publish(number(i + 10))
        assert out.publish(number(1))
        said.append(bench.written())

    executor = bench.executor(semantics=_LET, period=0.01, messages=1)
    timer = bench.node.timer(0, call)
    executor.add(timer)
    bench.connect()
    executor.spin_one_period()
    timer.cancel()
    executor.spin_one_period()
    assert said == [[10, 11]]
    assert bench.written() == [1]


def test_let_answers_and_requests_leave_at_the_end() -> None:
    bench = Bench()
    service = bench.node.service(Service, "add", lambda request: number(request.data + 1))
    client = bench.node.client(Service, "other")
    seen: "list[Any]" = []

    def ask() -> None:
        client.send(number(7), seen.append)
        timer.cancel()

    timer: "Any" = bench.node.timer(0, ask)
    bench.connect()
    executor = bench.executor(semantics=_LET, period=0.01)
    service.deliver(bytes(24), bytes((5, 0, 0, 0)), 0, 4)
    bench.way.on_wait = bench.hear
    executor.spin_one_period()
    assert bench.heard == []
    bench.session.spin_once(bench.way.now)
    assert sorted(bench.written()) == [6, 7]
    asked = [one[0] for one in client._asked]
    assert len(asked) == 1
    client.deliver(asked[0], bytes((9, 0, 0, 0)), 0, 4)
    executor.spin_one_period()
    assert seen[0].data == 9


def test_let_runs_nothing_between_two_periods() -> None:
    bench = Bench()
    got: "list[int]" = []
    a = bench.node.subscription(Number, "a", None)
    executor = bench.executor(semantics=_LET, period=0.01)
    executor.add(a, lambda m: got.append(m.data))
    bench.connect()
    give(a, 1)
    give(a, 2)
    assert got == []
    executor.spin_one_period()
    assert (got, a.lost) == ([2], 1)


def test_a_callback_in_let_may_destroy_ping_and_close() -> None:
    bench = Bench(history=1)
    out = bench.node.publisher(Number, "out")
    other = bench.node.publisher(Number, "other")
    pinged: "list[bool]" = []

    def destroy() -> None:
        out.publish(number(1))
        other.destroy()

    def call() -> None:
        out.publish(number(2))
        pinged.append(bench.context.ping(0.1))
        bench.context.close()

    executor = bench.executor(semantics=_LET, period=0.01)
    timer = bench.node.timer(0, destroy)
    executor.add(timer)
    bench.connect()
    executor.spin_one_period()
    timer.cancel()
    executor.spin_one_period()
    assert bench.written() == [1]
    executor.add(bench.node.timer(0, call))
    executor.spin_period()
    assert pinged == [True]
    assert bench.session.state == 0


def overrun(policy: int) -> "Any":
    """Three callbacks of 2 ms; the second takes 15 ms in the second of five periods: when they begin, what leaves."""
    bench = Bench(history=16)
    outs = [bench.node.publisher(Number, "out") for _ in range(3)]
    executor = bench.executor(semantics=_LET, period=0.01, overrun=policy)
    calls: "list[int]" = []
    durations = [2, 2, 2]

    def caller(i: int) -> "Any":
        def call() -> None:
            calls.append(bench.at())
            outs[i].publish(number(bench.at()))
            bench.way.now += durations[i]

        return call

    for i in range(3):
        executor.add(bench.node.timer(0, caller(i)))
    told: "list[Any]" = []
    bench.context.on_problem(lambda code, text: told.append((code, text)))
    bench.connect()
    executor.spin_one_period()
    durations[1] = 15
    executor.spin_one_period()
    durations[1] = 2
    for _ in range(3):
        executor.spin_one_period()
    bench.session.spin_once(bench.way.now)
    assert told[0] == (50, "a callback took 15 ms and ended 7 ms behind its let of 10 ms, for the 1. time")
    return calls, bench.written(), executor.let.overruns


def test_let_overruns() -> None:
    calls, numbers, overruns = overrun(_GO_ON)
    assert calls == [0, 2, 4, 10, 12, 27, 29, 31, 33, 35, 37, 39, 41, 43, 45]
    assert (numbers, overruns) == (calls, 6)
    calls, numbers, overruns = overrun(_CANCEL_CURRENT)
    assert calls == [0, 2, 4, 10, 12, 27, 29, 31, 33, 35, 40, 42, 44]
    assert (numbers, overruns) == (calls, 2)
    calls, numbers, overruns = overrun(_CANCEL_WITHOUT_OUTPUT)
    assert calls == [0, 2, 4, 10, 12, 27, 29, 31, 33, 35, 40, 42, 44]
    assert (numbers, overruns) == ([0, 2, 4, 31, 33, 35, 40, 42, 44], 2)
    calls, numbers, overruns = overrun(_CANCEL_NEXT)
    assert calls == [0, 2, 4, 10, 12, 27, 30, 32, 34, 40, 42, 44]
    assert (numbers, overruns) == (calls, 2)


def test_what_boards_have_not_is_refused() -> None:
    bench = Bench()
    for options in ({"overrun": 5, "semantics": _LET}, {"color": 3}):
        with raises(ValueError):
            bench.executor(**options)
    with raises(ValueError):
        bench.executor().spin_period()


def test_errors_are_raised_or_decided_about() -> None:
    for semantics in (_RCLCPP, _LET):
        bench = Bench()
        ran: "list[int]" = []
        seen: "list[Any]" = []

        def decide(handle: "Any", error: Exception, seen: "list[Any]" = seen) -> bool:
            seen.append(handle)
            return len(seen) < 3

        timer = bench.node.timer(0, lambda: [][1])
        bench.node.timer(0, lambda ran=ran: ran.append(1))
        bench.connect()
        executor = bench.executor(on_error=decide, semantics=semantics)
        executor.spin_some()
        executor.spin_some()
        assert (seen, ran) == ([timer, timer], [1, 1])
        with raises(IndexError):
            executor.spin_some()
        with raises(IndexError):
            bench.executor(semantics=semantics).spin_some()
        assert ran == [1, 1]


def test_a_callback_that_raises_publishes_nothing_in_let() -> None:
    bench = Bench()
    out = bench.node.publisher(Number, "out")
    executor = bench.executor(semantics=_LET, on_error=lambda handle, error: True)

    def call() -> None:
        out.publish(number(1))
        raise OSError

    executor.add(bench.node.timer(0, call))
    executor.add(bench.node.timer(0, lambda: out.publish(number(2))))
    bench.connect()
    executor.spin_some()
    bench.session.spin_once(bench.way.now)
    assert bench.written() == [2]
    assert [executor.let.task(handle).result for handle in executor.handles] == ["HANDLING_ERROR", "NO_ERROR"]


def test_an_idle_round_with_a_trigger_allocates_nothing() -> None:
    bench = Bench()
    a = bench.node.subscription(Number, "a", None)
    bench.node.timer(1.0, None)
    bench.connect()
    bench.way.counting = True

    def never(handles: "list[Any]") -> bool:
        return a.ready(0)  # type: ignore[no-any-return]

    executor = bench.executor(trigger=never)

    def idle() -> None:
        executor.round(0)

    assert allocates(idle) == 0


def test_what_was_sent_raw_is_held_back_too() -> None:
    bench = Bench()
    out = bench.node.publisher(Number, "out")
    executor = bench.executor(semantics=_LET, period=0.01)
    timer = bench.node.timer(0, lambda: out.publish(Raw(b"\x09\0\0\0")))
    executor.add(timer)
    bench.connect()
    bench.way.on_wait = bench.hear
    executor.spin_one_period()
    timer.cancel()
    executor.spin_one_period()
    assert bench.heard == [20], "what leaves at the end of the first is there in the second"
    assert bench.written() == [9]
