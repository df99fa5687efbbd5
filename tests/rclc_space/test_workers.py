"""One worker for each subscription: READY and BUSY, its policy, and triggers of several. A7 numbers the facts."""

import threading
from typing import Any

import pytest

from muros.client import Qos
from muros.rclc import ThreadError, Workers, any_of
from muros.rclc.host.workers import WorkerState
from muros.rclc.scheduling import other
from tests.rclc_space.crew import Crew, here, until
from tests.rclc_space.ways import PATIENCE, Direct

from std_msgs.msg import Int32


def spun(crew: Crew, node: Any) -> Any:
    """Threads that spin the context of a node with nothing else to do."""
    made = crew.threads(node.context)
    made.executor("idle").add(node.timer(60.0, lambda: None))
    return made


def test_the_dispatcher_takes_only_for_workers_that_are_ready(crew: Crew) -> None:
    """A busy worker gets nothing, and holds up nobody; what came last meanwhile is there when it is ready again."""
    far, node = crew.node("far"), crew.node()
    fast: list[int] = []
    slow: list[tuple[int, str]] = []
    entered, release = threading.Event(), threading.Event()

    def dawdle(msg: Any) -> None:
        slow.append((msg.data, here()))
        entered.set()
        assert release.wait(PATIENCE)

    workers = Workers(node.context)
    crew.teams.append(workers)
    first = workers.add(node.subscription(Int32, "slow", dawdle, Qos(depth=1)), policy=other(1))
    second = workers.add(
        node.subscription(Int32, "fast", None, Qos(depth=50)), lambda msg: fast.append(msg.data)
    )
    publishers = [far.publisher(Int32, name, Qos(depth=50)) for name in ("slow", "fast")]
    with workers, spun(crew, far):
        crew.meet(*publishers)
        assert first.state.value == "ready"
        crew.publish(publishers[0], Int32(data=0))
        assert entered.wait(PATIENCE)
        assert first.state.value == "busy"
        for number in range(20):
            for publisher in publishers:
                crew.publish(publisher, Int32(data=number + 1))
        until(lambda: len(fast) == 20)
        assert first.runs == 1
        release.set()
        until(lambda: slow[-1][0] == 20)
        until(lambda: first.state.value == "ready")
    assert slow == [(0, "slow"), (20, "slow")]
    assert (first.runs, second.runs) == (2, 20)


def test_a_worker_of_several_subscriptions_is_called_when_all_have_something(crew: Crew) -> None:
    far, node = crew.node("far"), crew.node()
    fused: list[tuple[int, int]] = []
    loose: list[tuple[Any, Any]] = []
    workers = Workers(node.context)
    crew.teams.append(workers)
    workers.add(
        [node.subscription(Int32, name, None) for name in ("laser", "imu")],
        lambda laser, imu: fused.append((laser.data, imu.data)),
    )
    pair = [node.subscription(Int32, name, None) for name in ("left", "right")]
    workers.add(pair, lambda left, right: loose.append((left, right)), trigger=any_of(*pair), name="loose")
    assert [thread.name for thread in workers.threads] == ["laser imu", "loose"]
    laser, imu, left, right = publishers = [
        far.publisher(Int32, name) for name in ("laser", "imu", "left", "right")
    ]
    with workers, spun(crew, far):
        crew.meet(*publishers)
        crew.publish(laser, Int32(data=1))
        crew.publish(left, Int32(data=5))
        until(lambda: loose)
        assert not fused
        crew.publish(imu, Int32(data=2))
        until(lambda: fused)
        crew.publish(right, Int32(data=6))
        until(lambda: len(loose) == 2)
    assert fused == [(1, 2)]
    assert [(a and a.data, b and b.data) for a, b in loose] == [(5, None), (None, 6)]


def test_a_worker_whose_callback_raises_has_ended() -> None:
    crew = Crew(Direct("local:"))
    node = crew.node()
    publisher = node.publisher(Int32, "number")
    workers = Workers(node.context)
    crew.teams.append(workers)
    worker = workers.add(node.subscription(Int32, "number", lambda msg: 1 // msg.data))
    workers.start()
    crew.publish(publisher, Int32(data=0))
    with pytest.raises(ThreadError, match="thread 'number' has ended: ZeroDivisionError"):
        workers.join(PATIENCE)
    assert worker.state is WorkerState.ENDED
    with pytest.raises(ValueError, match="a worker needs a subscription"):
        workers.add([])
    with pytest.raises(TypeError, match="the callback of a worker is a function"):
        workers.add(node.subscription(Int32, "other", None))
    crew.close()
