"""Executors in asyncio programs: beside other tasks, over sessions and spaces, and in a space of the loop's own."""

import asyncio
import gc
import threading
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from muros.rclc import LET, Context, Executor, GuardCondition, Qos
from muros.space import open_space
from tests.rclc_space.ways import PATIENCE, Stage

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32

LONG = 100.0
"""Seconds; whoever is woken does not wait so long, whoever is not lets the test's time limit end it."""


def run(program: Coroutine[Any, Any, None]) -> None:
    """Runs an asyncio program."""
    asyncio.run(asyncio.wait_for(program, 3 * PATIENCE))


async def until(condition: Callable[[], object]) -> None:
    """Lets others run until a condition holds."""
    async with asyncio.timeout(PATIENCE):
        while not condition():
            await asyncio.sleep(0.001)


async def end(*tasks: asyncio.Task[None]) -> None:
    """Cancels tasks and waits for their end."""
    for task in tasks:
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task


def test_nodes_in_tasks_talk_while_others_run(stage: Stage) -> None:
    talker, listener = stage.node("talker"), stage.node("listener")
    publisher = talker.publisher(Int32, "value")
    got: list[int] = []
    listener.subscription(Int32, "value", lambda message: got.append(message.data))
    stage.meet(publisher)

    async def program() -> None:
        tasks = [asyncio.create_task(executor.spin_async()) for executor in stage.executors]
        for i in range(20):
            await until(lambda: publisher.publish(Int32(data=i)))  # noqa: B023
            await until(lambda: len(got) > i)  # noqa: B023
        assert not any(task.done() for task in tasks)
        await end(*tasks)

    run(program())
    assert got == list(range(20))


def test_a_request_is_awaited(stage: Stage) -> None:
    server, asking = stage.node("server"), stage.node("asking")
    server.service(AddTwoInts, "add", lambda request: AddTwoInts.Response(sum=request.a + request.b))
    client = asking.client(AddTwoInts, "add")
    stage.meet(client)

    async def program() -> None:
        tasks = [asyncio.create_task(executor.spin_async()) for executor in stage.executors]
        for i in range(5):
            reply: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
            await until(lambda: client.send(AddTwoInts.Request(a=i, b=1), reply.set_result))  # noqa: B023
            assert (await reply).sum == i + 1
        await end(*tasks)

    run(program())


def test_stop_from_a_thread_ends_a_wait_at_once(stage: Stage) -> None:
    stage.node("node")
    stage.meet()
    (executor,) = (Executor(context, timeout=LONG) for context in stage.contexts)

    async def program() -> None:
        task = asyncio.create_task(executor.spin_async())
        await asyncio.sleep(0)
        for _ in range(5):
            threading.Thread(target=executor.stop).start()
            await asyncio.wait_for(task, PATIENCE)
            task = asyncio.create_task(executor.spin_async())
            await asyncio.sleep(0)
        await end(task)
        assert not await executor.spin_some_async(0.0)

    run(program())


def test_closing_the_context_ends_a_wait(stage: Stage) -> None:
    stage.node("node")
    stage.meet()
    context = stage.contexts[0]

    async def program() -> None:
        task = asyncio.create_task(Executor(context, timeout=LONG).spin_async())
        await asyncio.sleep(0.01)
        context.close()
        await asyncio.wait_for(task, PATIENCE)

    run(program())


def test_what_waiting_raises_comes_out(stage: Stage) -> None:
    """The thread that waits hands on what it meets, and waits again afterwards."""
    stage.node("node")
    stage.meet()
    executor = Executor(stage.contexts[0])
    executor.add(GuardCondition(stage.contexts[0], print))
    middleware: Any = stage.contexts[0].middleware

    def fails(timeout: float) -> None:
        raise OSError("gone")

    async def program() -> None:
        middleware.wait = fails
        with pytest.raises(OSError, match="gone"):
            await executor.spin_some_async(1.0)
        del middleware.wait
        assert not await executor.spin_some_async(0.01)

    run(program())


def test_a_guard_condition_ends_a_wait(stage: Stage) -> None:
    stage.node("node")
    stage.meet()
    context = stage.contexts[0]
    calls: list[str] = []
    guard = GuardCondition(context, lambda: calls.append(threading.current_thread().name))
    executor = Executor(context)
    executor.add(guard)

    async def program() -> None:
        for i in range(5):
            waiting = asyncio.create_task(executor.spin_until_async(lambda: len(calls) > i, LONG))  # noqa: B023
            await asyncio.sleep(0.01)
            threading.Thread(target=guard.trigger).start()
            assert await waiting

    run(program())
    assert set(calls) == {threading.current_thread().name}, "callbacks run in the thread of the loop"


def test_timeouts(stage: Stage) -> None:
    stage.node("node")
    stage.meet()
    executor = Executor(stage.contexts[0])
    executor.add(GuardCondition(stage.contexts[0], print))

    async def program() -> None:
        assert not await executor.spin_some_async(0.02)
        assert not await executor.spin_until_async(lambda: False, 0.02)

    run(program())


def test_timers_and_periods(stage: Stage) -> None:
    node = stage.node("node")
    stage.meet()
    calls: list[str] = []
    executor = Executor(stage.contexts[0], period=0.002, semantics=LET)
    executor.add(node.timer(0.001, lambda: calls.append("timer")))

    async def program() -> None:
        task = asyncio.create_task(executor.spin_period_async())
        await until(lambda: len(calls) >= 10)
        await end(task)
        await executor.spin_one_period_async()

    run(program())


def test_an_error_of_a_callback_comes_out(stage: Stage) -> None:
    node = stage.node("node")
    stage.meet()
    node.timer(0.001, lambda: 1 / 0)

    async def program() -> None:
        with pytest.raises(ZeroDivisionError):
            await stage.executors[0].spin_async()

    run(program())


def test_executors_of_one_context_rouse_each_other(stage: Stage) -> None:
    """What one takes from the middleware may be for the other, which waits."""
    talker, listener = stage.node("talker"), stage.node("listener")
    publishers = [talker.publisher(Int32, f"t{i}") for i in range(2)]
    got: list[tuple[int, int]] = []
    context = stage.contexts[1]
    executors = [Executor(context, timeout=LONG) for _ in range(2)]
    for i, executor in enumerate(executors):
        executor.add(
            listener.subscription(Int32, f"t{i}", None, Qos(depth=100)),
            lambda message, i=i: got.append((i, message.data)),
        )
    stage.meet(*publishers)

    async def program() -> None:
        tasks = [asyncio.create_task(executor.spin_async()) for executor in [*executors, stage.executors[0]]]
        for number in range(20):
            for publisher in publishers:
                await until(lambda: publisher.publish(Int32(data=number)))  # noqa: B023
            await until(lambda: len(got) == 2 * number + 2)  # noqa: B023
        await end(*tasks)

    run(program())
    assert sorted(got) == [(i, number) for i in range(2) for number in range(20)]


def test_a_space_that_the_program_serves(url: str) -> None:
    """The loop of the program serves the space, so nobody may wait for it; executors do without."""
    got: list[int] = []

    async def program() -> None:
        with open_space(url) as space:
            talker, listener = Context(space), Context(space)
            publisher = talker.node("talker").publisher(Int32, "value")
            listener.node("listener").subscription(Int32, "value", lambda message: got.append(message.data))
            executors = [Executor(context, timeout=LONG) for context in (talker, listener)]
            tasks = [asyncio.create_task(executor.spin_async()) for executor in executors]
            await until(lambda: publisher.matched)
            for i in range(10):
                assert publisher.publish(Int32(data=i))
                await until(lambda: len(got) > i)  # noqa: B023
            threading.Thread(target=executors[0].stop).start()
            await asyncio.wait_for(tasks[0], PATIENCE)
            await end(tasks[1])
            assert not await executors[1].spin_some_async(0.01)
            waiting = asyncio.create_task(executors[1].spin_async())
            await asyncio.sleep(0)
            listener.close()
            await asyncio.wait_for(waiting, PATIENCE)
            talker.close()

    run(program())
    assert got == list(range(10))


def test_the_thread_that_waits_ends_with_its_executor() -> None:
    def waiting() -> int:
        gc.collect()
        return sum(thread.name == "muros asyncio" for thread in threading.enumerate())

    async def program() -> None:
        await until(lambda: waiting() == 0)
        context = Context("local:")
        executor = Executor(context)
        executor.add(GuardCondition(context, print))
        assert not await executor.spin_some_async(0.01)
        assert waiting() == 1
        del executor
        context.close()
        await until(lambda: waiting() == 0)

    run(program())
