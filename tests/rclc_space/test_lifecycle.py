"""Managed nodes and who moves them, through an agent and straight on a space."""

from typing import Any

from muros.rclc import LifecycleClient
from muros.rclc.lifecycle_states import STATES, TRANSITIONS
from tests.rclc_space.ways import Stage

from std_msgs.msg import Int32

LABELS = dict(STATES)
GRAPH = [(number, label, LABELS[start], LABELS[goal]) for number, label, start, goal in TRANSITIONS]


STEPS = [
    ("unconfigured", "configuring"),
    ("configuring", "inactive"),
    ("inactive", "activating"),
    ("activating", "active"),
    ("active", "deactivating"),
    ("deactivating", "active"),
    ("active", "shuttingdown"),
    ("shuttingdown", "finalized"),
]
"""What is told of a node that is configured, activated, not deactivated, and shut down."""


class Mover:
    """A client whose questions are asked in executors."""

    def __init__(self, stage: Stage, name: str) -> None:
        self.stage = stage
        self.client = LifecycleClient(stage.node("mover"), name)
        self.events: list[tuple[str, str]] = []
        self.client.on_event(lambda start, goal: self.events.append((start, goal)))

    def ask(self, question: str, *given: Any, **named: Any) -> Any:
        """The answer to a question."""
        answers: list[Any] = []
        method = getattr(self.client, question)
        self.stage.until(lambda: method(*given, **named, on_done=answers.append))
        self.stage.until(lambda: answers)
        return answers[0]


def test_a_node_is_moved_from_outside(stage: Stage) -> None:  # B5: all five services, events
    node = stage.node("camera", "lab")
    called: list[str] = []
    lifecycle = node.lifecycle(
        on_configure=lambda: called.append("configure"),
        on_activate=lambda: called.append("activate"),
        on_deactivate=lambda: False,
        on_shutdown=lambda: called.append("shutdown"),
    )
    problems: list[str] = []
    node.context.on_problem(lambda code, text: problems.append(text))
    mover = Mover(stage, "/lab/camera")
    stage.meet(lifecycle.events)
    assert mover.ask("state") == "unconfigured"
    assert mover.ask("states") == list(STATES)
    assert mover.ask("transitions", everything=True) == GRAPH
    assert mover.ask("transitions") == [row for row in GRAPH if row[0] in (1, 5)]
    assert mover.ask("change", "activate") is False
    assert "node camera is unconfigured: there is no transition 'activate'" in problems[-1]
    assert mover.ask("change", "configure") is True
    assert mover.ask("change", 3) is True
    assert (lifecycle.state, called) == ("active", ["configure", "activate"])
    assert mover.ask("change", "deactivate") is False
    assert mover.ask("state") == "active"
    assert mover.ask("change", "shutdown") is True
    assert (mover.ask("state"), mover.ask("transitions")) == ("finalized", [])
    assert called[-1] == "shutdown"
    stage.until(lambda: len(mover.events) == len(STEPS))
    assert mover.events == STEPS
    assert lifecycle.lost == 0
    mover.client.destroy()


def test_what_a_managed_publisher_publishes(stage: Stage) -> None:
    node = stage.node("sensor")
    lifecycle = node.lifecycle()
    publisher = lifecycle.publisher(Int32, "depth")
    got: list[int] = []
    stage.node("listener").subscription(Int32, "depth", lambda message: got.append(message.data))
    stage.meet(publisher.inner)
    node.context.on_problem(lambda code, text: None)
    assert not publisher.publish(Int32(data=1))
    lifecycle.configure()
    lifecycle.activate()
    stage.until(lambda: publisher.publish(Int32(data=2)))
    stage.until(lambda: got)
    lifecycle.deactivate()
    assert not publisher.publish(Int32(data=3))
    lifecycle.activate()
    stage.until(lambda: publisher.publish(Int32(data=4)))
    stage.until(lambda: len(got) > 1)
    assert got == [2, 4]


def test_nobody_answers(stage: Stage) -> None:
    client = LifecycleClient(stage.node("mover"), "nobody")
    assert client.state(timeout=0.05) is None
    assert client.change("shutdown", timeout=0.05) is None
    answers: list[Any] = []
    stage.until(lambda: client.change("shutdown", timeout=0.05, on_done=answers.append))
    stage.until(lambda: answers)
    assert answers == [None]
