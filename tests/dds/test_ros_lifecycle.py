"""Managed nodes between muros and ROS 2, both ways, and `muros lifecycle` on nodes of ROS 2."""

import time
from collections.abc import Iterator
from typing import Any

import pytest

from muros.rclc import Context, Executor, LifecycleClient
from muros.rclc.lifecycle_states import STATES, TRANSITIONS
from tests.cli.shell import Shell
from tests.dds.domains import Domain, free_domain
from tests.dds.peers import PROGRAMS, Peer, start
from tests.rclc_space.test_lifecycle import STEPS
from tests.rclc_space.test_ros import Program

PATIENCE = 15.0
KINDS = {
    "change_state": "ChangeState",
    "get_state": "GetState",
    "get_available_states": "GetAvailableStates",
    "get_available_transitions": "GetAvailableTransitions",
    "get_transition_graph": "GetAvailableTransitions",
}


@pytest.fixture(scope="module", params=["jazzy", "kilted"])
def ros(request: pytest.FixtureRequest) -> Iterator[Peer]:
    """A ROS 2 process that can make managed nodes."""
    with start(request.param, discovery="localhost", program=PROGRAMS / "lifecycle.py") as peer:
        yield peer


@pytest.fixture
def domain(ros: Peer, monkeypatch: pytest.MonkeyPatch) -> Iterator[Domain]:
    """A domain of the test's own; what the test made in ROS 2 is taken away after it."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as number:
        yield number
        ros.do("reset")


def test_ros_moves_a_node_of_ours(ros: Peer, domain: Domain) -> None:
    program = Program(f"dds:{int(domain)}")
    called: list[str] = []
    lifecycle = program.context.node("camera", "lab").lifecycle(
        on_configure=lambda: called.append("configure"),
        on_activate=lambda: called.append("activate"),
        on_deactivate=lambda: False,
        on_shutdown=lambda: called.append("shutdown"),
    )
    program.start()
    try:
        node = ros.do("node", name="mover", domain=int(domain))
        events = ros.do(
            "subscription",
            node=node,
            topic="/lab/camera/transition_event",
            type="lifecycle_msgs/msg/TransitionEvent",
        )
        ros.do("matched", thing=events)
        clients = {
            name: ros.do("client", node=node, name=f"/lab/camera/{name}", type=f"lifecycle_msgs/srv/{kind}")
            for name, kind in KINDS.items()
        }

        def ask(name: str, **request: Any) -> Any:
            (answer,) = ros.do("call", client=clients[name], request=request)
            return answer

        def change(**transition: Any) -> Any:
            return ask("change_state", transition=transition)["success"]

        def rows(name: str) -> list[tuple[int, str, int, int]]:
            return [
                (
                    row["transition"]["id"],
                    row["transition"]["label"],
                    row["start_state"]["id"],
                    row["goal_state"]["id"],
                )
                for row in ask(name)["available_transitions"]
            ]

        assert ask("get_state")["current_state"] == {"id": 1, "label": "unconfigured"}
        states = ask("get_available_states")["available_states"]
        assert [(state["id"], state["label"]) for state in states] == list(STATES)
        assert rows("get_transition_graph") == list(TRANSITIONS)
        assert [row[1] for row in rows("get_available_transitions")] == ["configure", "shutdown"]
        assert change(id=3) is False
        assert change(id=1) is True
        assert change(label="activate") is True
        assert lifecycle.state == "active"
        assert change(id=4) is False
        assert change(id=7) is True
        assert ask("get_state")["current_state"] == {"id": 4, "label": "finalized"}
        assert called == ["configure", "activate", "shutdown"]
        told = ros.do("take", subscription=events, count=len(STEPS))
        assert [(event["start_state"]["label"], event["goal_state"]["label"]) for event in told] == STEPS
        assert [event["transition"]["id"] for event in told] == [1, 10, 3, 30, 4, 41, 7, 50]
        assert [text for text in program.problems if "there is no transition 3 from here" in text]
    finally:
        program.close()


def test_we_move_a_node_of_ros(ros: Peer, domain: Domain) -> None:
    ros.do("lifecycle_node", name="lidar", domain=int(domain), namespace="/lab", fails=["activate"])
    context = Context(f"dds:{int(domain)}")
    try:
        client = LifecycleClient(context.node("mover"), "/lab/lidar")
        events: list[tuple[str, str]] = []
        client.on_event(lambda start, goal: events.append((start, goal)))
        end = time.monotonic() + PATIENCE
        while (state := client.state(timeout=1.0)) is None:
            assert time.monotonic() < end
        assert state == "unconfigured"
        assert client.states() == list(STATES)
        assert [row[:2] for row in client.transitions()] == [(1, "configure"), (5, "shutdown")]
        assert len(client.transitions(everything=True)) == len(TRANSITIONS)
        assert client.change("configure") is True
        assert client.change("activate") is False
        assert client.state() == "inactive"
        assert client.change("shutdown") is True
        assert client.state() == "finalized"
        executor = Executor(context)
        while len(events) < 6:
            assert time.monotonic() < end + PATIENCE
            executor.spin_some(0.1)
        assert events == [
            ("unconfigured", "configuring"),
            ("configuring", "inactive"),
            ("inactive", "activating"),
            ("activating", "inactive"),
            ("inactive", "shuttingdown"),
            ("shuttingdown", "finalized"),
        ]
    finally:
        context.close()


def test_the_command_moves_a_node_of_ros(ros: Peer, domain: Domain) -> None:
    ros.do("lifecycle_node", name="lidar", domain=int(domain), namespace="/lab", fails=["activate"])
    ros.do("node", name="plain", domain=int(domain))
    shell = Shell(domain)
    nodes, states, listed = shell.outputs("lifecycle nodes", "lifecycle get", "lifecycle list /lab/lidar")
    assert nodes == "/lab/lidar\n"
    assert states == "/lab/lidar: unconfigured [1]\n"
    assert listed == (
        "- configure [1]\n\tStart: unconfigured\n\tGoal: configuring\n"
        "- shutdown [5]\n\tStart: unconfigured\n\tGoal: shuttingdown\n"
    )
    done = shell.run("lifecycle set /lab/lidar configure")
    assert (done.stdout, done.stderr, done.returncode) == ("Transitioning successful\n", "", 0)
    done = shell.run("lifecycle set /lab/lidar activate")
    assert (done.stdout, done.stderr, done.returncode) == ("", "muros: Transitioning failed\n", 1)
    assert shell.run("lifecycle get /lab/lidar").stdout == "inactive [2]\n"
