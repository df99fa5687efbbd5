"""The states of goals are those of the table, and what does not fit is refused."""

import json
from pathlib import Path
from typing import Any

import pytest

from muros.interfaces import action, message
from muros.rclc import GoalError
from muros.rclc.actions import new_id
from muros.rclc.goals import AFTER, Goal

TABLE = json.loads((Path(__file__).parents[1] / "vectors/rmw/actions.json").read_text())
STATES: dict[str, int] = TABLE["states"]
EVENTS: dict[str, int] = TABLE["events"]
LEGAL = {(a, e): b for a, e, b in TABLE["transitions"]}


class Server:
    """What a goal needs of its server."""

    name = "count"
    kind = action("example_interfaces/action/Fibonacci")

    def __init__(self) -> None:
        self.heard: list[str] = []

    def start(self, goal: Goal) -> None:
        self.heard.append("start")

    def changed(self) -> None:
        self.heard.append("changed")

    def ended(self, goal: Goal) -> None:
        self.heard.append("ended")

    def send_feedback(self, goal: Goal, feedback: Any) -> bool:
        self.heard.append("feedback")
        return True


def goal_in(state: str) -> tuple[Goal, Server]:
    server: Any = Server()
    entry = message("action_msgs/msg/GoalStatus")(status=STATES[state])
    return Goal(server, new_id(), Server.kind.Goal(order=3), entry), server


def test_the_table_is_that_of_the_specification() -> None:
    for state, number in STATES.items():
        for event, row in EVENTS.items():
            assert AFTER[row * 7 + number] == STATES[LEGAL.get((state, event), "UNKNOWN")]
    assert len(AFTER) == 7 * len(EVENTS)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("event", ["EXECUTE", "SUCCEED", "ABORT", "CANCELED"])
def test_methods_follow_the_table(state: str, event: str) -> None:
    goal, server = goal_in(state)
    calls = {"EXECUTE": goal.execute, "SUCCEED": goal.succeed, "ABORT": goal.abort, "CANCELED": goal.canceled}
    if (state, event) in LEGAL:
        calls[event]()
        assert goal.status == STATES[LEGAL[state, event]]
        assert goal.active == (LEGAL[state, event] not in TABLE["terminal"])
        assert "changed" in server.heard
    else:
        with pytest.raises(GoalError, match=rf"action 'count' is {state.lower()}: it cannot") as caught:
            calls[event]()
        assert caught.value.code == 2301
        assert goal.status == STATES[state]
        assert server.heard == []


@pytest.mark.parametrize("state", [s for s in STATES if s != "UNKNOWN"])
def test_feedback_only_of_goals_that_have_not_ended(state: str) -> None:
    goal, server = goal_in(state)
    if state in TABLE["terminal"]:
        with pytest.raises(GoalError, match="has ended") as caught:
            goal.feedback(Server.kind.Feedback())
        assert caught.value.code == 2300
    else:
        assert goal.feedback(Server.kind.Feedback())
        assert server.heard == ["feedback"]


def test_ids_are_uuids_and_differ() -> None:
    made = {new_id() for _ in range(100)}
    assert len(made) == 100
    assert {(len(i), i[6] >> 4, i[8] >> 6) for i in made} == {(16, 4, 2)}
