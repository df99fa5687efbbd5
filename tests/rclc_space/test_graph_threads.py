"""The graph where several threads run a context: changes reach the thread of their handle, and others may wait."""

import threading

from muros.rclc import BEST_EFFORT, CallbackGroup
from tests.rclc_space.crew import Crew, until
from tests.rclc_space.ways import PATIENCE

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32


def test_changes_are_told_in_the_thread_of_the_handle(crew: Crew) -> None:
    far, node = crew.node("far"), crew.node()
    told: list[tuple[list[str], str]] = []
    watch = node.graph.on_change(lambda graph: told.append((graph.nodes(), threading.current_thread().name)))
    group = CallbackGroup("watching", BEST_EFFORT)
    group.add(watch)
    threads = crew.threads(node.context)
    threads.assign(group)
    other = crew.threads(far.context)
    other.executor("far").add(far.timer(0.01, lambda: None))
    with threads, other:
        until(lambda: told and "/far" in told[-1][0])
        late = far.context.node("late")
        until(lambda: "/late" in told[-1][0])
        late.destroy()
        until(lambda: "/late" not in told[-1][0])
    assert len({name for _, name in told}) == 1


def test_another_thread_waits_for_a_service_and_is_confirmed(crew: Crew) -> None:
    far, node = crew.node("far"), crew.node()
    client = node.client(AddTwoInts, "add")
    publisher = node.publisher(Int32, "value")
    group = CallbackGroup("asking", BEST_EFFORT)
    group.add(client)
    threads = crew.threads(node.context)
    threads.assign(group)
    far.subscription(Int32, "value", lambda message: None)
    far.service(AddTwoInts, "add", lambda asked: AddTwoInts.Response(sum=asked.a + asked.b))
    other = crew.threads(far.context)
    serving = other.executor("far")
    for handle in list(far.context.handles):
        serving.add(handle)
    with threads, other:
        assert client.wait_for_service(timeout=PATIENCE)
        assert publisher.wait_for_subscriptions(timeout=PATIENCE)
        until(lambda: publisher.publish(Int32(data=1), timeout=PATIENCE))
        assert client.call(AddTwoInts.Request(a=1, b=2), timeout=PATIENCE).sum == 3
