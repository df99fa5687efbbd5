"""Threads and a space that the program's own asyncio loop serves: what they may do, and what is refused in words."""

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import pytest

from muros.rclc import (
    LET,
    LOW_PRIORITY,
    CallbackGroup,
    Context,
    Executor,
    GuardCondition,
    RclError,
    SensePlanAct,
    Threads,
    Workers,
)
from muros.space import open_space
from tests.rclc_space.test_async import end, run, until

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32


def in_a_thread(function: Callable[[], object]) -> BaseException | None:
    """Calls a function in another thread; what it raised."""
    raised: list[BaseException] = []

    def call() -> None:
        try:
            function()
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=call)
    thread.start()
    thread.join()
    return raised[0] if raised else None


@pytest.mark.parametrize("kind", [Threads, Workers])
def test_threads_are_refused(url: str, kind: Any) -> None:
    async def program() -> None:
        with open_space(url) as space:
            context = Context(space)
            group = CallbackGroup("group")
            group.add(context.node("node").timer(1.0, print))
            with pytest.raises(
                RclError, match=r"loop of this program serves the space.*spin_async"
            ) as caught:
                kind(context)
            assert caught.value.code
            task = asyncio.create_task(Executor(context).spin_async())
            await asyncio.sleep(0)
            assert not task.done(), "the context is as it was"
            await end(task)
            context.close()

    run(program())


def test_what_other_threads_do_is_refused(url: str) -> None:
    async def program() -> None:
        with open_space(url) as space:
            context = Context(space)
            node = context.node("node")
            publisher = node.publisher(Int32, "value")
            node.subscription(Int32, "value", print)
            service = node.service(AddTwoInts, "add", lambda request: None)
            client = node.client(AddTwoInts, "add")
            await until(lambda: publisher.matched)
            for use in (
                lambda: publisher.publish(Int32(data=1)),
                lambda: client.send(AddTwoInts.Request(), print),
                lambda: service.entity.reply(bytes(24), AddTwoInts.Response()),
                lambda: node.publisher(Int32, "other"),
                lambda: node.graph.nodes(),
                lambda: context.node("another"),
            ):
                error = in_a_thread(use)
                assert isinstance(error, RclError), use
                assert "call_soon_threadsafe" in str(error)
            error = in_a_thread(Executor(context).spin)
            assert isinstance(error, RclError)
            assert "other threads may not use it" in str(error)
            assert isinstance(in_a_thread(context.close), RclError)
            context.close()

    run(program())


def test_a_thread_hands_over_and_wakes(url: str) -> None:
    """What the errors advise; guard conditions and stop() come from any thread as ever."""
    got: list[int] = []

    async def program() -> None:
        loop = asyncio.get_running_loop()
        with open_space(url) as space:
            context = Context(space)
            node = context.node("node")
            publisher = node.publisher(Int32, "value")
            node.subscription(Int32, "value", lambda message: got.append(message.data))
            condition = GuardCondition(context, lambda: got.append(-1))
            executor = Executor(context)
            task = asyncio.create_task(executor.spin_async())
            await until(lambda: publisher.matched)
            message = Int32(data=5)
            assert in_a_thread(lambda: loop.call_soon_threadsafe(publisher.publish, message)) is None
            await until(lambda: got == [5])
            assert in_a_thread(condition.trigger) is None
            await until(lambda: got == [5, -1])
            assert in_a_thread(executor.stop) is None
            await asyncio.wait_for(task, 5.0)
            context.close()

    run(program())


def test_late_callbacks_go_on_in_their_thread(url: str) -> None:
    """With LOW_PRIORITY callbacks run in a thread of their own; what they publish leaves from that of the loop."""
    got: list[int] = []
    threads: list[str] = []

    async def program() -> None:
        with open_space(url) as space:
            context = Context(space)
            node = context.node("node")
            publisher = node.publisher(Int32, "value")

            def compute() -> None:
                threads.append(threading.current_thread().name)
                publisher.publish(Int32(data=len(threads)))

            executor = Executor(context, semantics=LET, period=0.01, overrun=LOW_PRIORITY)
            executor.add(node.timer(0.01, compute))
            listening = Executor(context)
            listening.add(node.subscription(Int32, "value", lambda message: got.append(message.data)))
            await until(lambda: publisher.matched)
            tasks = [
                asyncio.create_task(executor.spin_period_async()),
                asyncio.create_task(listening.spin_async()),
            ]
            await until(lambda: len(got) >= 3)
            await end(*tasks)
            context.close()

    run(program())
    assert got[:3] == [1, 2, 3]
    assert set(threads) == {"muros LET"}


def test_sense_plan_act_is_refused(url: str) -> None:
    async def program() -> None:
        with open_space(url) as space:
            context = Context(space)
            context.node("node").subscription(Int32, "value", print)
            robot = SensePlanAct(["sense"])
            robot.add("sense", Executor(context))
            with pytest.raises(RclError, match="give the context a space of its own"):
                robot.run(0.01, turns=2)
            context.close()

    run(program())


def test_while_the_loop_stands_still_any_thread_may_close(url: str) -> None:
    loop = asyncio.new_event_loop()

    async def begin() -> tuple[Any, Context]:
        space = open_space(url)
        context = Context(space)
        context.node("node")
        return space, context

    async def close() -> None:
        space.close()

    space, context = loop.run_until_complete(begin())
    assert in_a_thread(context.close) is None
    loop.run_until_complete(close())
    loop.close()
