"""Managed nodes: the state machine against the table of ROS 2, what callbacks decide, what is told and held back."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rclc import CapacityError, Executor, RclError, TransitionError, lifecycle_states, lifecycles
from muros.rclc.lifecycle import Lifecycle
from tests.rclc.virtual import WAYS, Bench

from std_msgs.msg import Int32

TABLE = json.loads((Path(__file__).parents[1] / "vectors/rmw/lifecycle.json").read_text())
LABELS = ("configure", "activate", "deactivate", "cleanup", "shutdown", "error")
UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED = 1, 2, 3, 4


class Managed:
    """A managed node: what its callbacks do, what it tells and what was called."""

    def __init__(self, bench: Bench, services: bool = True, **does: Callable[[], object]) -> None:
        self.node = bench.context.node("board")
        self.called: list[str] = []
        self.problems: list[tuple[int, str]] = []
        self.node.context.on_problem(lambda code, text: self.problems.append((code, text)))
        callbacks: Any = {f"on_{name}": self._callback(name, does.get(name)) for name in LABELS}
        self.lifecycle: Lifecycle = self.node.lifecycle(
            services=services, time=lambda: (1700000000, 5), **callbacks
        )
        self.events: list[Any] = []
        events: Any = self.lifecycle.events
        events.publish = self._keep
        bench.settle()

    def _callback(self, name: str, does: Callable[[], object] | None) -> Callable[[], object]:
        def callback() -> object:
            self.called.append(name)
            return does() if does else None

        return callback

    def _keep(self, event: Any) -> bool:
        self.events.append(event)
        return True

    def steps(self) -> list[tuple[str, str]]:
        """Where each event says that it came from and went to."""
        return [(event.start_state.label, event.goal_state.label) for event in self.events]

    def go(self, *transitions: str) -> "Managed":
        """Goes through transitions, all of which succeed."""
        for transition in transitions:
            assert self.lifecycle.change(transition)
        return self


def fail() -> bool:
    return False


def crash() -> None:
    raise OSError("no sensor")


def test_the_table_is_that_of_ros() -> None:
    assert [(state["id"], state["label"]) for state in TABLE["states"]] == list(lifecycle_states.STATES)
    rows = [(row["id"], row["label"], row["start_id"], row["goal_id"]) for row in TABLE["transitions"]]
    assert rows == list(lifecycle_states.TRANSITIONS)
    names = [row["name"].removeprefix("~/") for row in TABLE["interfaces"] if row["kind"] == "service"]
    assert [name for name, _ in lifecycle_states.SERVICES] == names


def test_l1_create_and_destroy(bench: Bench) -> None:
    managed = Managed(bench)
    assert managed.lifecycle.state == TABLE["initial_state"] == "unconfigured"
    assert len(managed.lifecycle.services) == 5
    managed.node.destroy()
    assert managed.node.context.handles == []
    assert Managed(bench, services=False).lifecycle.services == []


def test_l2_to_active_and_back(bench: Bench) -> None:
    managed = Managed(bench)
    states = []
    for transition in ("configure", "activate", "deactivate", "cleanup"):
        managed.go(transition)
        states.append(managed.lifecycle.id)
    assert states == [INACTIVE, ACTIVE, INACTIVE, UNCONFIGURED]


def test_l3_callbacks_are_called_in_their_order(bench: Bench) -> None:
    managed = Managed(bench)
    lifecycle = managed.lifecycle
    for n, step in enumerate(
        (lifecycle.configure, lifecycle.activate, lifecycle.deactivate, lifecycle.cleanup), 1
    ):
        assert step()
        assert managed.called == list(LABELS[:n])


def test_l4_services_are_handles_that_an_executor_counts(bench: Bench) -> None:
    managed = Managed(bench)
    first, second, third, *_ = managed.lifecycle.services
    small = Executor(managed.node.context, handles=1)
    small.add(first)
    with pytest.raises(CapacityError, match="handles=2"):
        small.add(second)
    large = Executor(managed.node.context, handles=3)
    for handle in (first, second, third):
        large.add(handle)


@pytest.mark.parametrize("case", TABLE["cases"], ids=lambda case: "-".join(case["do"]))
def test_cases(bench: Bench, case: dict[str, Any]) -> None:
    does: Any = {}
    for word in case["do"]:
        name, _, how = word.rstrip(")").partition("(")
        if how:
            does[name] = {"fails": fail, "raises": crash}[how]
    managed = Managed(bench, **does)
    results = []
    for word in case["do"]:
        transition = word.partition("(")[0]
        if case.get("error"):
            with pytest.raises(TransitionError):
                managed.lifecycle.change(transition)
        else:
            results.append(managed.lifecycle.change(transition))
    assert results == [not does] * len(results)
    assert managed.lifecycle.state == case.get("final", "unconfigured")
    assert managed.called[: len(case.get("callback_order", []))] == case.get("callback_order", [])
    if "events" in case:
        assert managed.steps() == [tuple(event) for event in case["events"]]


@pytest.mark.parametrize("start", ["unconfigured", "inactive", "active", "finalized"])
@pytest.mark.parametrize("row", TABLE["transitions"], ids=lambda row: f"{row['id']}")
def test_each_transition_is_legal_from_its_own_state_alone(
    bench: Bench, start: str, row: dict[str, Any]
) -> None:
    """By its number; labels of steps that nobody may ask for are refused too."""
    ways = {"inactive": ["configure"], "active": ["configure", "activate"], "finalized": ["shutdown"]}
    managed = Managed(bench).go(*ways.get(start, []))
    managed.events.clear()
    if row["start"] == start:
        assert managed.lifecycle.change(row["id"])
        (event, _) = managed.events
        assert (event.transition.id, event.transition.label) == (row["id"], row["label"])
        assert (event.start_state.id, event.goal_state.id) == (row["start_id"], row["goal_id"])
    else:
        with pytest.raises(
            TransitionError, match=f"is {start}: there is no transition {row['id']}"
        ) as caught:
            managed.lifecycle.change(row["id"])
        assert caught.value.code == 1
        assert (managed.lifecycle.state, managed.events) == (start, [])


@pytest.mark.parametrize(
    "way", [[], ["configure"], ["configure", "activate"]], ids=lambda way: f"after{len(way)}"
)
@pytest.mark.parametrize("does", [None, fail])
def test_shutdown_from_everywhere_ends_in_finalized(
    bench: Bench, way: list[str], does: Callable[[], object] | None
) -> None:
    callbacks: Any = {"shutdown": does} if does else {}
    managed = Managed(bench, **callbacks).go(*way)
    assert managed.lifecycle.shutdown() is (does is None)
    assert (managed.lifecycle.state, managed.called[-1]) == ("finalized", "shutdown")
    assert managed.steps()[-1] == ("shuttingdown", "finalized")
    with pytest.raises(TransitionError, match="from here, none at all"):
        managed.lifecycle.configure()


@pytest.mark.parametrize("name", LABELS[:5])
@pytest.mark.parametrize(
    ("on_error", "final"),
    [(None, "unconfigured"), (fail, "finalized"), (crash, "finalized")],
    ids=["recovers", "fails", "raises"],
)
def test_what_raises_is_an_error(
    bench: Bench, name: str, on_error: Callable[[], object] | None, final: str
) -> None:
    way = {"activate": ["configure"], "deactivate": ["configure", "activate"], "cleanup": ["configure"]}
    does: Any = {name: crash} | ({"error": on_error} if on_error else {})
    managed = Managed(bench, **does).go(*way.get(name, []))
    assert not managed.lifecycle.change(name)
    assert managed.lifecycle.state == final
    assert managed.called[-2:] == [name, "error"]
    assert managed.steps()[-2:] == [(managed.steps()[-2][0], "errorprocessing"), ("errorprocessing", final)]
    assert isinstance(managed.lifecycle.error, OSError)
    assert managed.problems[0] == (lifecycles.RAISED, f"on_{name} of node board raised OSError: no sensor")
    assert len(managed.problems) == (2 if on_error is crash else 1)


def test_an_error_without_callback_is_the_end(bench: Bench) -> None:
    node = bench.context.node("board")
    node.context.on_problem(lambda code, text: None)
    lifecycle = node.lifecycle(on_configure=crash)
    assert not lifecycle.configure()
    assert lifecycle.state == "finalized"


@pytest.mark.parametrize(
    ("result", "state"),
    [(None, 2), (True, 2), (97, 2), ("done", 2), (0, 2), (False, 1), (98, 1), (99, 4)],
)
def test_what_callbacks_return(bench: Bench, result: object, state: int) -> None:
    lifecycle = bench.context.node("board").lifecycle(on_configure=lambda: result)
    assert lifecycle.configure() is (state == INACTIVE)
    assert lifecycle.id == state


def test_no_transition_within_a_transition(bench: Bench) -> None:
    managed = Managed(bench, configure=lambda: managed.lifecycle.activate())
    assert not managed.lifecycle.configure()
    assert isinstance(managed.lifecycle.error, TransitionError)
    assert (
        "is configuring: there is no transition 'activate' from here, none at all" in managed.problems[0][1]
    )


def test_events_bear_the_time(bench: Bench) -> None:
    managed = Managed(bench).go("configure")
    assert [(event.stamp.sec, event.stamp.nanosec) for event in managed.events] == [(1700000000, 5)] * 2
    lifecycle = bench.context.node("board").lifecycle()
    told: list[Any] = []
    events: Any = lifecycle.events
    events.publish = told.append  # which says None: not taken
    lifecycle.configure()
    assert told[0].stamp.sec > 1700000000, "the system's time"
    assert lifecycle.lost == 2


def test_managed_publishers_publish_while_active_alone(bench: Bench) -> None:
    managed = Managed(bench)
    publisher = managed.lifecycle.publisher(Int32, "value")
    sent: list[int] = []
    inner: Any = publisher.inner

    def keep(message: Any) -> bool:
        sent.append(message.data)
        return True

    inner._writer.publish = keep
    number = 0

    def publish(taken: bool) -> None:
        nonlocal number
        number += 1
        assert publisher.publish(Int32(data=number)) is taken

    publish(False)
    publish(False)
    assert managed.problems == [
        (lifecycles.INACTIVE, "a message on value was not published: node board is unconfigured, not active")
    ]
    managed.go("configure")
    publish(False)
    managed.go("activate")
    publish(True)
    managed.go("deactivate")
    publish(False)
    assert (sent, publisher.held) == ([4], 4)
    assert [text.split("node ")[1] for _, text in managed.problems] == [
        "board is unconfigured, not active",
        "board is inactive, not active",
        "board is inactive, not active",
    ]
    managed.go("activate")
    with pytest.raises(TypeError, match="publish takes std_msgs/msg/Int32 here, not 5"):
        publisher.publish(5)
    publisher.destroy()
    assert managed.lifecycle.publishers == []


def test_one_lifecycle_for_each_node(bench: Bench) -> None:
    node = bench.context.node("board")
    node.lifecycle()
    handles = list(node.context.handles)
    with pytest.raises(RclError, match="node board has a lifecycle already"):
        node.lifecycle()
    assert node.context.handles == handles


@pytest.mark.parametrize("bench", ["agent"], indirect=True)  # the length of names is bounded there alone
def test_a_lifecycle_that_cannot_be_made_leaves_nothing(bench: Bench) -> None:
    node = bench.context.node("n" * 30)
    with pytest.raises(ValueError, match=r"characters"):
        node.lifecycle()
    assert (node.entities, bench.context.handles) == ([], [])


@pytest.mark.parametrize("name", ["on_configure", "on_error", "time"])
def test_callbacks_must_be_callable(bench: Bench, name: str) -> None:
    wrong: Any = {name: 5}
    with pytest.raises(TypeError, match="a callback of a lifecycle is a function, not 5") as caught:
        bench.context.node("board").lifecycle(**wrong)
    assert getattr(caught.value, "code", None) == 11


@pytest.mark.parametrize("way", WAYS)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([*LABELS[:5], "fly", *range(9), 10, 60]),
            st.sampled_from([97, 98, 99, None, False]),
        ),
        max_size=30,
    ),
    st.sampled_from([97, 98, 99]),
)
def test_whatever_is_asked_every_step_is_one_of_the_table(
    way: str, asked: list[tuple[int | str, object]], on_error: int
) -> None:
    result: object = None
    does: Any = {name: lambda: result for name in LABELS[:5]} | {"error": lambda: on_error}
    bench = WAYS[way]()
    managed = Managed(bench, **does)
    known = {(row["id"], row["label"], row["start_id"], row["goal_id"]) for row in TABLE["transitions"]}
    for transition, result in asked:
        before, steps = managed.lifecycle.id, len(managed.events)
        try:
            done = managed.lifecycle.change(transition)
        except TransitionError:
            assert (managed.lifecycle.id, len(managed.events)) == (before, steps)
            continue
        assert done == (result in (97, None))
        assert managed.lifecycle.id <= FINALIZED, "it never stays on the way"
        at = before
        for event in managed.events[steps:]:
            step = (event.transition.id, event.transition.label, event.start_state.id, event.goal_state.id)
            assert step in known
            assert event.start_state.id == at
            at = event.goal_state.id
        assert at == managed.lifecycle.id
    bench.close()
