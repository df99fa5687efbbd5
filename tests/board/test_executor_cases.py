"""Executors and handles on every runtime: those of the acceptance cases X and H that `test_executor` has not."""

from muros.compat import const
from muros.rclc import CapacityError, Executor, GuardCondition, HandleError, all_of
from muros.rclc.executor import Handle
from tests.board.broker import Broker
from tests.board.harness import raises

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

_LET = const(1)


def nothing(*_: object) -> None:
    """A callback."""


MAKERS: "dict[str, Any]" = {
    "subscription": lambda context: context.node("n").subscription(Int32, "topic", nothing),
    "timer": lambda context: context.node("n").timer(1.0, nothing),
    "service": lambda context: context.node("n").service(AddTwoInts, "add", nothing),
    "client": lambda context: context.node("n").client(AddTwoInts, "add"),
    "guard condition": lambda context: GuardCondition(context, nothing),
}


def test_x1_init() -> None:
    context = Broker().context()
    plain = Executor(context)
    assert (plain.capacity, plain.handles is context.handles, plain.trigger) == (0, True, None)
    trigger = all_of()
    executor: "Any" = Executor(context, 5, trigger, semantics=_LET, period=0.01)
    assert (executor.capacity, executor.trigger is trigger, executor.period) == (5, True, 10)
    for options in ({"overrun": 99, "semantics": _LET}, {"semantics": 7}):
        wrong: "Any" = options
        with raises(ValueError):
            Executor(context, 1, None, **wrong)


def test_x2_x34_what_has_ended_does_nothing() -> None:
    broker = Broker()
    context = broker.context()
    executor = broker.executors[0]
    assert executor.spin_some() is False, "it needs no preparing"
    calls: "list[int]" = []
    context.node("n").timer(0.001, lambda: calls.append(1))
    context.close()
    context.close()
    executor.spin()
    assert calls == []


def test_x3_to_x12_add_and_remove() -> None:
    for name in MAKERS:
        context = Broker().context()
        executor = Executor(context, 2)
        handle = MAKERS[name](context)
        executor.add(handle)
        assert (executor.handles, context.handles) == ([handle], [])
        with raises(HandleError) as caught:
            executor.add(handle)
        error: "Any" = caught.value
        assert error.code == 11
        with raises(HandleError) as caught:
            executor.add(MAKERS[name](Broker().context()))
        for wrong in (None, 5, object()):
            with raises(Exception) as refused:
                executor.add(wrong)
            error = refused.value
            assert error.code == 11
        assert executor.handles == [handle], "what is refused leaves nothing behind"
        executor.remove(handle)
        assert executor.handles == []
        with raises(HandleError) as caught:
            executor.remove(handle)
        error = caught.value
        assert error.code == 1


def test_x4_x31_a_callback_with_a_context_is_a_closure() -> None:
    broker = Broker()
    publisher = broker.context().node("one").publisher(Int32, "topic")
    context = broker.context()
    got: "list[tuple[int, int]]" = []
    value = 42
    broker.executors[1].add(
        context.node("two").subscription(Int32, "topic", None),
        lambda message: got.append((value, message.data)),
    )
    broker.settle()
    assert publisher.publish(Int32(data=7))
    broker.until(lambda: got)
    assert got == [(42, 7)]


def test_x5_too_many() -> None:
    context = Broker().context()
    executor = Executor(context, 1)
    executor.add(context.node("n").timer(1.0, nothing))
    with raises(CapacityError) as caught:
        executor.add(context.node("n").timer(1.0, nothing))
    error: "Any" = caught.value
    assert (error.code, len(executor.handles)) == (1, 1)


def test_x16_x17_pub_sub_example() -> None:
    broker = Broker()
    publisher = broker.context().node("one").publisher(Int32, "topic")
    got: "list[int]" = []
    context = broker.context()
    context.node("two").subscription(Int32, "topic", lambda message: got.append(message.data))
    broker.settle()
    executor = broker.executors.pop()
    start = broker.now
    assert (executor.spin_some(), broker.now) == (False, start), "it does not wait unless told to"
    assert executor.spin_some(0.05) is False
    assert 50 <= broker.now - start < 60
    assert publisher.publish(Int32(data=42))
    assert executor.spin_some(0.05) is True
    assert got == [42]


def test_x33_a_guard_condition_that_was_removed() -> None:
    context = Broker().context()
    calls: "list[int]" = []
    guard = GuardCondition(context, lambda: calls.append(1))
    executor = Executor(context)
    executor.add(guard)
    guard.trigger()
    assert executor.spin_some() and not executor.spin_some()
    guard.trigger()
    executor.remove(guard)
    assert not executor.spin_some()
    assert calls == [1]


def test_h1_to_h5_handles() -> None:
    broker = Broker()
    context = broker.context()
    bare = Handle(context)
    assert (bare.entity, bare.handles, bare.eager) == (None, None, True)
    assert bare.left(0) >= 1000000, "it is never ready by itself"
    assert context.handles == [bare]
    bare.destroy()
    assert context.handles == []
    subscription = context.node("n").subscription(Int32, "topic", nothing)
    executor = Executor(context)
    executor.add(subscription)
    assert subscription.handles is executor.handles
    assert subscription.entity is not None
    executor.remove(subscription)
    assert (executor.handles, context.handles) == ([], [])
