"""Actions of programs and of rclpy, both ways, and `muros action` on those of rclpy."""

import os
import shlex
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from muros import interfaces
from muros.rclc import Context, Executor
from tests.dds.peers import Peer
from tests.rclc_space.ways import PATIENCE

TYPE = "test_msgs/action/Fibonacci"
FIBONACCI = "int32 order\n---\nint32[] sequence\n---\nint32[] sequence\n"
CANCELING, SUCCEEDED, CANCELED, ABORTED = 3, 4, 5, 6


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The definition of the action of the peers' tests."""
    made = tmp_path_factory.mktemp("types") / "test_msgs"
    (made / "action").mkdir(parents=True)
    (made / "action/Fibonacci.action").write_text(FIBONACCI)
    return made


@pytest.fixture(scope="module")
def kind(folder: Path) -> Any:
    """The action of the peers' tests."""
    interfaces.add_path(folder)
    return interfaces.action(TYPE)


def test_rclpy_sends_goals_to_us(context: Context, ros: Peer, kind: Any, dds_url: str) -> None:
    def run(goal: Any) -> Iterator[float]:
        sequence = [0, 1]
        for _ in range(abs(goal.request.order)):
            if goal.canceling:
                goal.canceled(kind.Result(sequence=sequence))
                return
            sequence.append(sequence[-1] + sequence[-2])
            goal.feedback(kind.Feedback(sequence=sequence))
            yield 0.02
        result = kind.Result(sequence=sequence)
        goal.abort(result) if goal.request.order < 0 else goal.succeed(result)

    context.node("counter", "lab").action_server(
        kind, "count", run, on_goal=lambda goal: goal.order != 13, on_cancel=lambda goal: True
    )
    ended = threading.Event()

    def spin() -> None:
        executor = Executor(context)
        while not ended.is_set():
            executor.spin_some(0.1)

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    try:
        node = ros.do("node", name="asker", domain=int(dds_url.partition(":")[2]))
        client = ros.do("action_client", node=node, name="/lab/count", type=TYPE)
        states = ros.do(
            "subscription",
            node=node,
            topic="/lab/count/_action/status",
            type="action_msgs/msg/GoalStatusArray",
            qos={"depth": 50, "durability": "transient_local"},
        )
        outcome = ros.do("goal", client=client, goal={"order": 6})
        assert outcome["status"] == SUCCEEDED
        assert outcome["result"] == {"sequence": [0, 1, 1, 2, 3, 5, 8, 13]}
        assert [len(piece["sequence"]) for piece in outcome["feedback"]] == [3, 4, 5, 6, 7, 8]
        assert ros.do("goal", client=client, goal={"order": 13}) == {"accepted": False}
        assert ros.do("goal", client=client, goal={"order": -2})["status"] == ABORTED
        outcome = ros.do("goal", client=client, goal={"order": 10000}, cancel_after=2)
        assert (outcome["cancelled"], outcome["status"]) == (1, CANCELED)
        arrays = ros.do("take", subscription=states, count=7, wait=PATIENCE)
        seen = [[entry["status"] for entry in array["status_list"]] for array in arrays]
        assert seen[-1] == [SUCCEEDED, ABORTED, CANCELED]
        assert [SUCCEEDED, ABORTED, CANCELING] in seen
    finally:
        ended.set()
        thread.join(PATIENCE)


def test_we_send_goals_to_rclpy(context: Context, ros: Peer, kind: Any, dds_url: str) -> None:
    node = ros.do("node", name="counter", domain=int(dds_url.partition(":")[2]))
    ros.do("action_server", node=node, name="/count", type=TYPE, period=0.02)
    client = context.node("asker").action_client(kind, "/count")
    heard: list[int] = []
    goal = client.call(
        kind.Goal(order=5),
        timeout=PATIENCE,
        on_feedback=lambda goal, piece: heard.append(len(piece.sequence)),
    )
    assert goal is not None
    assert (goal.accepted, goal.status) == (True, SUCCEEDED)
    assert list(goal.result.sequence) == [0, 1, 1, 2, 3, 5, 8]
    assert heard[-3:] == [5, 6, 7]
    answers: list[bool | None] = []

    def cancel(goal: Any, piece: Any) -> None:
        if len(piece.sequence) == 4:
            goal.cancel(lambda goal, canceling: answers.append(canceling))

    goal = client.call(kind.Goal(order=500), timeout=PATIENCE, on_feedback=cancel)
    assert goal is not None
    assert answers == [True]
    assert goal.status == CANCELED
    assert list(goal.result.sequence)[:4] == [0, 1, 1, 2]
    assert client.goals == []


def test_the_command_and_rclpy(context: Context, ros: Peer, folder: Path, dds_url: str) -> None:
    domain = int(dds_url.partition(":")[2])
    node = ros.do("node", name="counter", domain=domain)
    ros.do("action_server", node=node, name="/count", type=TYPE, period=0.02)
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}

    def run(line: str, number: int = 0) -> str:
        command = [sys.executable, "-m", "muros", "action", *shlex.split(line)]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            said = ""
            while number and "accepted" not in said:
                said += process.stdout.readline()
            if number:
                process.send_signal(number)
            said += process.stdout.read()
            assert process.wait(PATIENCE) == (130 if number else 0)
        return said

    assert run("list -t") == f"/count [{TYPE}]\n"
    assert run("info /count") == "Action: /count\nAction clients: 0\nAction servers: 1\n    /counter\n"
    said = run(f"send_goal -f /count {TYPE} '{{order: 2}}' --types {folder}")
    assert said.count("Feedback:\n") == 2
    assert said.endswith(
        "Result:\n    sequence:\n- 0\n- 1\n- 1\n- 2\n\nGoal finished with status: SUCCEEDED\n"
    )
    said = run(f"send_goal /count {TYPE} '{{order: 500}}' --types {folder}", signal.SIGINT)
    assert said.endswith("Canceling goal...\nGoal canceled.\n")
