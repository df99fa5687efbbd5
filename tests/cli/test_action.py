"""`muros action`: what it prints is what `ros2 action` prints."""

import asyncio
import re
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

from muros.rclc import Context, Executor
from tests.cli.scene import Scene, play

from example_interfaces.action import Fibonacci

TYPE = "example_interfaces/action/Fibonacci"
ACCEPTED = (
    r"Waiting for an action server to become available...\n"
    r"Sending goal:\n     order: \d+\n\nGoal accepted with ID: [0-9a-f]{32}\n\n"
)


def count(goal: Any) -> Iterator[float]:
    """Numbers until the order is reached; a great order waits to be cancelled."""
    sequence = [0, 1]
    for _ in range(goal.request.order):
        if goal.canceling:
            goal.canceled(Fibonacci.Result(sequence=sequence))
            return
        sequence.append(sequence[-1] + sequence[-2])
        goal.feedback(Fibonacci.Feedback(sequence=sequence[-2:]))
        yield 0.02 if goal.request.order < 10 else 0.1
    goal.succeed(Fibonacci.Result(sequence=sequence))


def with_server(scenario: Callable[[Scene, Any], Awaitable[None]]) -> None:
    """Plays a scenario beside a program that serves an action."""

    async def whole(scene: Scene) -> None:
        context = Context(scene.space)
        server = context.node("counter", "lab").action_server(
            Fibonacci,
            "count",
            count,
            on_goal=lambda request: request.order != 13,
            on_cancel=lambda goal: goal.request.order != 14,
        )
        executor = Executor(context)

        async def spin() -> None:
            while True:
                executor.spin_some(0)
                await asyncio.sleep(0.001)

        spinning = asyncio.ensure_future(spin())
        try:
            await scenario(scene, server)
        finally:
            spinning.cancel()
            context.close()

    play(whole)


def test_list_type_find_and_info() -> None:
    async def scenario(scene: Scene, server: Any) -> None:
        scene.reader("/user", "/lab/count/_action/feedback", f"{TYPE}_FeedbackMessage")
        scene.writer("/other", "/zeta/_action/feedback", "tf2_msgs/action/LookupTransform_FeedbackMessage")
        assert (await scene.muros("action list")).out == "/lab/count\n/zeta\n"
        assert (await scene.muros("action list -c")).out == "2\n"
        assert (await scene.muros("action list -t")).out == (
            f"/lab/count [{TYPE}]\n/zeta [tf2_msgs/action/LookupTransform]\n"
        )
        assert (await scene.muros("action type /lab/count")).out == f"{TYPE}\n"
        assert (await scene.muros(f"action find {TYPE}")).out == "/lab/count\n"
        assert (await scene.muros(f"action find -c {TYPE}")).out == "1\n"
        assert (await scene.muros("action info /lab/count")).out == (
            "Action: /lab/count\nAction clients: 1\n    /user\nAction servers: 1\n    /lab/counter\n"
        )
        assert (await scene.muros("action info -t /lab/count")).out == (
            f"Action: /lab/count\nAction clients: 1\n    /user [{TYPE}]\n"
            f"Action servers: 1\n    /lab/counter [{TYPE}]\n"
        )
        assert (await scene.muros("action info -c lab/count")).out == (
            "Action: /lab/count\nAction clients: 1\nAction servers: 1\n"
        )
        done = await scene.muros("action info /lab/cout")
        assert (done.error, done.status) == (
            "Unknown action '/lab/cout': did you mean /lab/count?",
            1,
        )

    with_server(scenario)


def test_send_goal() -> None:
    async def scenario(scene: Scene, server: Any) -> None:
        done = await scene.muros(f"action send_goal /lab/count {TYPE} '{{order: 3}}'")
        assert re.fullmatch(
            ACCEPTED
            + r"Result:\n    sequence:\n- 0\n- 1\n- 1\n- 2\n- 3\n\nGoal finished with status: SUCCEEDED\n",
            done.out,
        )
        assert done.err == ""

    with_server(scenario)


def test_send_goal_with_feedback() -> None:
    async def scenario(scene: Scene, server: Any) -> None:
        done = await scene.muros(f"action send_goal -f /lab/count {TYPE} 'order: 2'")
        feedback = r"Feedback:\n    sequence:\n- 1\n- 1\n\nFeedback:\n    sequence:\n- 1\n- 2\n\n"
        assert re.fullmatch(
            ACCEPTED
            + feedback
            + r"Result:\n    sequence:\n- 0\n- 1\n- 1\n- 2\n\nGoal finished with status: SUCCEEDED\n",
            done.out,
        )

    with_server(scenario)


def test_a_goal_that_is_rejected() -> None:
    async def scenario(scene: Scene, server: Any) -> None:
        done = await scene.muros(f"action send_goal /lab/count {TYPE} 'order: 13'")
        assert done.out.endswith("Goal was rejected.\n")

    with_server(scenario)


def test_ctrl_c_cancels_the_goal() -> None:
    async def scenario(scene: Scene, server: Any) -> None:
        running = scene.start(f"action send_goal /lab/count {TYPE} 'order: 1000'")
        await scene.until(lambda: "accepted" in running.out.getvalue())
        done = await running.stop()
        assert re.fullmatch(ACCEPTED + r"Canceling goal...\nGoal canceled.\n", done.out)
        await scene.until(lambda: [goal.status for goal in server.goals] == [5])

    with_server(scenario)


def test_a_server_that_refuses_to_cancel() -> None:
    async def scenario(scene: Scene, server: Any) -> None:
        running = scene.start(f"action send_goal /lab/count {TYPE} 'order: 14'")
        await scene.until(lambda: "accepted" in running.out.getvalue())
        done = await running.stop()
        assert done.out.endswith("Canceling goal...\n")
        assert done.err == "muros: the goal was not canceled: the server refuses to cancel it\n"

    with_server(scenario)


def test_a_goal_that_takes_too_long_is_cancelled() -> None:
    async def scenario(scene: Scene, server: Any) -> None:
        done = await scene.muros(f"action send_goal /lab/count {TYPE} 'order: 1000' --timeout 0.3")
        assert done.error == "no answer from /lab/count/_action/get_result within 0.3 s"
        assert done.out.endswith("Canceling goal...\nGoal canceled.\n")

    with_server(scenario)


def test_what_is_asked_wrongly() -> None:
    async def scenario(scene: Scene) -> None:
        done = await scene.muros(f"action send_goal /nobody {TYPE} 'order: 1' --timeout 0.05")
        assert (done.error, done.status) == ("nobody serves /nobody in domain 0", 1)
        done = await scene.muros("action send_goal /nobody std_msgs/msg/String x")
        assert (done.error, done.status) == (
            "std_msgs/msg/String is no action: those are called package/action/Type",
            2,
        )
        done = await scene.muros(f"action send_goal /nobody {TYPE} 'ordre: 1'")
        assert done.error == f"{TYPE}_Goal has no field 'ordre' (did you mean order?)"

    play(scenario)
