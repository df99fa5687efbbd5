"""Actions of programs, through an agent and straight on a space; A and B number the cases of micro-ROS."""

import time
from collections.abc import Iterator
from typing import Any

import pytest

from muros.client import Session, Udp
from muros.links import UdpLink
from muros.rclc import ActionClient, ActionServer, CapacityError, Context, Executor, RclError
from muros.rclc.action_client import SentGoal
from muros.rclc.goals import Goal
from tests.client.agent_thread import RunningAgent
from tests.rclc_space.ways import PATIENCE, Stage

from action_msgs.msg import GoalStatusArray
from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from std_msgs.msg import String

EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = 2, 3, 4, 5, 6
NONE, REJECTED, UNKNOWN_GOAL, TERMINATED = 0, 1, 2, 3


def count(goal: Any) -> Iterator[float]:
    """Gives a number at each step; goals of negative order abort, others may be cancelled."""
    sequence = [0, 1]
    for _ in range(abs(goal.request.order)):
        if goal.canceling:
            goal.canceled(Fibonacci.Result(sequence=sequence))
            return
        sequence.append(sequence[-1] + sequence[-2])
        while not goal.feedback(Fibonacci.Feedback(sequence=sequence)):
            yield 0.0  # the window to the agent is full
        yield 0.002
    result = Fibonacci.Result(sequence=sequence)
    if goal.request.order < 0:
        goal.abort(result)
    else:
        goal.succeed(result)


class Pair:
    """A server and a client on a stage, and what the client has heard."""

    def __init__(self, stage: Stage, on_execute: Any = count, **options: Any) -> None:
        self.stage = stage
        self.asked: list[int] = []
        self.agrees = True
        self.goals: list[Goal] = []

        def on_goal(request: Any) -> bool:
            self.asked.append(request.order)
            return bool(request.order != 13)

        def on_cancel(goal: Goal) -> bool:
            self.goals.append(goal)
            return self.agrees

        options = {"on_goal": on_goal, "on_cancel": on_cancel} | options
        self.server: ActionServer = stage.node("server").action_server(
            Fibonacci, "count", on_execute=on_execute, **options
        )
        self.client: ActionClient = stage.node("client").action_client(Fibonacci, "count")
        self.responses: list[tuple[SentGoal, bool | None]] = []
        self.feedback: list[tuple[SentGoal, list[int]]] = []
        self.results: list[tuple[SentGoal, Any]] = []
        stage.until(lambda: all(context.state == "CONNECTED" for context in stage.contexts))
        if stage.way.direct:
            stage.until(lambda: all(p.entity.entity.servers for p in self.client.parts[:3]))
            stage.until(lambda: all(p.entity.entity.matched for p in self.client.parts[3:]))
            stage.until(lambda: self.server.feedback.entity.matched and self.server.status.entity.matched)  # type: ignore[attr-defined]

    def send(self, order: int, **options: Any) -> SentGoal:
        made: list[SentGoal | None] = []

        def sent() -> bool:
            made.append(
                self.client.send_goal(
                    Fibonacci.Goal(order=order),
                    lambda goal, accepted: self.responses.append((goal, accepted)),
                    lambda goal, piece: self.feedback.append((goal, list(piece.sequence))),
                    lambda goal, result: self.results.append((goal, result)),
                    **options,
                )
            )
            return made[-1] is not None

        self.stage.until(sent)
        assert made[-1] is not None
        return made[-1]

    def pieces(self, goal: SentGoal) -> list[int]:
        """The lengths of what a goal's feedback was."""
        return [len(piece) for of, piece in self.feedback if of is goal]

    def result(self, goal: SentGoal) -> list[int] | None:
        """Waits for the result of a goal; its numbers."""
        self.stage.until(lambda: any(of is goal for of, _ in self.results))
        (found,) = [result for of, result in self.results if of is goal]
        return None if found is None else list(found.sequence)

    def cancel(self, **which: Any) -> tuple[int | None, list[bytes]]:
        """Asks to cancel and waits for the answer."""
        answers: list[tuple[int | None, list[bytes]]] = []
        assert self.client.cancel(on_answer=lambda code, ids: answers.append((code, ids)), **which)
        self.stage.until(lambda: answers)
        return answers[0]

    def until_executing(self, *goals: SentGoal) -> None:
        self.stage.until(lambda: all(goal.status == EXECUTING for goal in goals))


def endless(goal: Goal) -> Iterator[float]:
    """Goes on until it is cancelled."""
    while not goal.canceling:
        yield 0.002
    goal.canceled(Fibonacci.Result(sequence=[goal.request.order]))


def states(stage: Stage) -> list[list[int]]:
    """What somebody who comes late hears of the states of all goals, from the first array on."""
    heard: list[list[int]] = []
    stage.node("late").subscription(
        GoalStatusArray,
        "/count/_action/status",
        lambda array: heard.append([entry.status for entry in array.status_list]),
        "status",
    )
    stage.until(lambda: heard)
    return heard


def test_a1_b1_a_goal_is_accepted(stage: Stage) -> None:
    pair = Pair(stage)
    goal = pair.send(3)
    assert (goal.accepted, goal.status) == (None, 0)
    stage.until(lambda: pair.responses)
    assert pair.responses == [(goal, True)]
    assert pair.asked == [3]
    assert abs(goal.stamp[0] - time.time()) < 3600
    assert pair.result(goal) == [0, 1, 1, 2, 3]
    assert pair.client.goals == []


def test_a2_b2_a_goal_is_rejected(stage: Stage) -> None:
    pair = Pair(stage)
    goal = pair.send(13)
    stage.until(lambda: pair.responses)
    assert pair.responses == [(goal, False)]
    assert pair.client.goals == []
    assert pair.server.goals == []
    assert pair.result(pair.send(1)) == [0, 1, 1], "the next goal is taken"


def test_a3_b3_ten_pieces_of_feedback_then_success(stage: Stage) -> None:
    pair = Pair(stage)
    goal = pair.send(10)
    assert pair.result(goal) == [0, 1, 1, 2, 3, 5, 8, 13, 21, 34, 55, 89]
    assert goal.status == SUCCEEDED
    stage.until(lambda: len(pair.feedback) == 10)
    assert pair.pieces(goal) == list(range(3, 13))


def test_a4_b4_five_pieces_of_feedback_then_abort(stage: Stage) -> None:
    pair = Pair(stage)
    goal = pair.send(-5)
    assert pair.result(goal) == [0, 1, 1, 2, 3, 5, 8]
    assert goal.status == ABORTED
    stage.until(lambda: len(pair.feedback) == 5)
    assert pair.pieces(goal) == [3, 4, 5, 6, 7]


def test_a5_b5_cancelling_is_accepted(stage: Stage) -> None:
    pair = Pair(stage)
    goal = pair.send(10000)
    stage.until(lambda: len(pair.feedback) > 2)
    answers: list[Any] = []
    assert goal.cancel(lambda of, canceling: answers.append((of, canceling)))
    assert (pair.result(goal) or [])[:4] == [0, 1, 1, 2]
    assert answers == [(goal, True)]
    assert goal.status == CANCELED
    assert [g.id for g in pair.goals] == [goal.id]


def test_a6_b6_cancelling_is_rejected_and_the_goal_goes_on(stage: Stage) -> None:
    pair = Pair(stage)
    pair.agrees = False
    goal = pair.send(10)
    stage.until(lambda: pair.feedback)
    answers: list[Any] = []
    assert goal.cancel(lambda of, canceling: answers.append((of, canceling)))
    assert len(pair.result(goal) or []) == 12
    stage.until(lambda: answers)
    assert answers == [(goal, False)]
    assert goal.status == SUCCEEDED


def test_a7_b7_five_goals_in_parallel(stage: Stage) -> None:
    pair = Pair(stage)
    goals = [pair.send(10) for _ in range(5)]
    for goal in goals:
        assert len(pair.result(goal) or []) == 12
    stage.until(lambda: len(pair.feedback) == 50)
    assert all(pair.pieces(goal) == list(range(3, 13)) for goal in goals)


def test_a8_b8_destroying_twice(stage: Stage) -> None:
    pair = Pair(stage)
    pair.result(pair.send(1))
    for _ in range(2):
        pair.server.destroy()
        pair.client.destroy()
    assert all(context.handles == [] for context in stage.contexts)


def test_b9_a_result_is_kept_for_who_asks_late_and_then_forgotten(stage: Stage) -> None:
    pair = Pair(stage, result_timeout=0.4)
    goal = pair.send(1)
    assert pair.result(goal) == [0, 1, 1]
    (kept,) = pair.server.goals
    assert kept.status == SUCCEEDED
    replies: list[Any] = []
    late = pair.client.parts[2]
    request = Fibonacci.GetResult.Request()
    request.goal_id.uuid = goal.id
    assert late.send(request, replies.append)
    stage.until(lambda: replies)
    assert (replies[0].status, list(replies[0].result.sequence)) == (SUCCEEDED, [0, 1, 1])
    stage.until(lambda: not pair.server.goals)
    assert late.send(request, replies.append)
    stage.until(lambda: len(replies) == 2)
    assert replies[1].status == 0, "nobody knows it any more"


def test_the_states_are_published_and_a_late_reader_gets_the_last(stage: Stage) -> None:
    pair = Pair(stage, endless)
    goal = pair.send(1)
    pair.until_executing(goal)
    heard = states(stage)
    assert heard[0] == [EXECUTING]
    goal.cancel()
    stage.until(lambda: heard[-1] == [CANCELED])


@pytest.mark.parametrize("policy", ["all", "until", "one", "one and until"])
def test_policies_of_cancelling(stage: Stage, policy: str) -> None:
    stamps = iter([(10, 0), (10, 5), (20, 0), (30, 0)])
    pair = Pair(stage, endless, clock=lambda: next(stamps))
    goals = []
    for order in range(4):
        goals.append(pair.send(order))
        pair.until_executing(*goals)
    choices: dict[str, tuple[dict[str, Any], list[int]]] = {
        "all": ({}, [0, 1, 2, 3]),
        "until": ({"stamp": (10, 5)}, [0, 1]),
        "one": ({"identity": goals[2].id}, [2]),
        "one and until": ({"identity": goals[3].id, "stamp": (10, 4)}, [0, 3]),
    }
    which, expected = choices[policy]
    code, ids = pair.cancel(**which)
    assert code == NONE
    assert ids == [goals[n].id for n in expected]
    for n in expected:
        assert pair.result(goals[n]) == [n]
        assert goals[n].status == CANCELED
    assert [goal.status for goal in pair.client.goals] == [EXECUTING] * (4 - len(expected))


def test_codes_of_cancelling(stage: Stage) -> None:
    pair = Pair(stage, endless)
    assert pair.cancel() == (NONE, []), "nothing to cancel is no error"
    assert pair.cancel(identity=b"nobody's goal !!") == (UNKNOWN_GOAL, [])
    goal = pair.send(7)
    pair.until_executing(goal)
    pair.agrees = False
    assert pair.cancel() == (REJECTED, [])
    assert pair.cancel(identity=goal.id) == (REJECTED, [])
    pair.agrees = True
    assert pair.cancel(identity=goal.id) == (NONE, [goal.id])
    assert pair.result(goal) == [7]
    assert pair.cancel(identity=goal.id) == (TERMINATED, [])


def test_a_function_may_return_the_result_or_finish_later(stage: Stage) -> None:
    kept: list[Goal] = []

    def run(goal: Goal) -> Any:
        if goal.request.order:
            return Fibonacci.Result(sequence=[1])
        kept.append(goal)
        return None

    pair = Pair(stage, run)
    quick, slow = pair.send(1), pair.send(0)
    assert pair.result(quick) == [1]
    pair.until_executing(slow)
    kept[0].succeed(Fibonacci.Result(sequence=[2]))
    assert pair.result(slow) == [2]


def test_a_generator_that_returns_nothing_aborts_its_goal(stage: Stage) -> None:
    def run(goal: Goal) -> Iterator[None]:
        yield

    pair = Pair(stage, run)
    goal = pair.send(1)
    assert pair.result(goal) == []
    assert goal.status == ABORTED


def test_what_a_goal_raises_aborts_it_and_comes_out(stage: Stage) -> None:
    def run(goal: Goal) -> Iterator[float]:
        yield 0.0
        raise ZeroDivisionError(goal.request.order)

    pair = Pair(stage, run)
    goal = pair.send(1)
    with pytest.raises(ZeroDivisionError):
        stage.until(lambda: False)
    assert pair.result(goal) == []
    assert goal.status == ABORTED


def test_goals_put_off(stage: Stage) -> None:
    queue: list[Goal] = []
    pair = Pair(stage, on_accepted=queue.append)
    first, second = pair.send(1), pair.send(2)
    stage.until(lambda: len(queue) == 2)
    stage.until(lambda: second.accepted and first.status == second.status == 1)
    assert pair.cancel(identity=second.id)[0] == NONE
    assert queue[1].canceling
    queue[1].canceled()
    queue[0].execute()
    assert pair.result(first) == [0, 1, 1]
    assert pair.result(second) == []
    assert (first.status, second.status) == (SUCCEEDED, CANCELED)


def test_no_more_goals_than_allowed(stage: Stage) -> None:
    problems: list[str] = []
    pair = Pair(stage, endless, goals=2)
    stage.contexts[0].on_problem(lambda code, text: problems.append(text))
    pair.until_executing(pair.send(1), pair.send(2))
    third = pair.send(3)
    stage.until(lambda: third.accepted is not None)
    assert third.accepted is False
    assert pair.server.refused == 1
    assert problems == ["action 'count' refused a goal: 2 of 2 are active. Make it with goals=3."]


def test_no_more_results_than_allowed(stage: Stage) -> None:
    pair = Pair(stage, results=2)
    for order in range(4):
        pair.result(pair.send(order))
    assert [len(goal.result.sequence) for goal in pair.server.goals] == [4, 5]
    assert pair.server.lost == 2


def test_a_client_bounds_its_goals(stage: Stage) -> None:
    node = stage.node("client")
    client = node.action_client(Fibonacci, "count", goals=1)
    stage.until(lambda: client.send_goal(Fibonacci.Goal()) is not None)
    with pytest.raises(CapacityError, match="1 goals of 1"):
        client.send_goal(Fibonacci.Goal())


def test_nobody_answers(stage: Stage) -> None:
    client = stage.node("client").action_client(Fibonacci, "nobody")
    responses: list[bool | None] = []
    stage.until(
        lambda: client.send_goal(
            Fibonacci.Goal(), lambda goal, accepted: responses.append(accepted), timeout=0.05
        )
    )
    stage.until(lambda: responses)
    assert responses == [None]
    assert client.goals == []


def test_a_result_that_does_not_come_in_time(stage: Stage) -> None:
    pair = Pair(stage, endless)
    goal = pair.send(1, result_timeout=0.1)
    assert pair.result(goal) is None
    assert goal.status == EXECUTING


def test_wrong_use_is_said_at_once() -> None:
    context = Context("local:")
    node = context.node("wrong")
    with pytest.raises(TypeError, match="std_msgs/msg/String is no action"):
        node.action_client(String, "count")
    with pytest.raises(TypeError, match="AddTwoInts is no action"):
        node.action_server(AddTwoInts, "count", count)
    with pytest.raises(TypeError, match="needs on_execute"):
        node.action_server(Fibonacci, "count")
    with pytest.raises(TypeError, match="on_goal is a function"):
        node.action_server(Fibonacci, "count", count, on_goal=5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="goals is 0"):
        node.action_server(Fibonacci, "count", count, goals=0)
    with pytest.raises(ValueError, match="result_timeout is -1"):
        node.action_server(Fibonacci, "count", count, result_timeout=-1)
    with pytest.raises(ValueError, match="letters, digits"):
        node.action_server(Fibonacci, "co-unt", count)
    assert context.handles == []
    node.action_server(Fibonacci, "count", lambda goal: Fibonacci.Feedback())
    client = node.action_client(Fibonacci, "count")
    with pytest.raises(TypeError, match="send_goal takes example_interfaces/action/Fibonacci_Goal here"):
        client.send_goal(Fibonacci.Result())
    with pytest.raises(RclError, match="served by this very context"):
        client.call(Fibonacci.Goal())
    context.close()


def test_a_result_of_another_type_is_refused(stage: Stage) -> None:
    pair = Pair(stage, lambda goal: Fibonacci.Feedback())
    goal = pair.send(1)
    with pytest.raises(TypeError, match="a goal takes example_interfaces/action/Fibonacci_Result here"):
        stage.until(lambda: pair.results)
    assert goal.result is None


def test_a_goal_outlives_its_agent() -> None:
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)

    class Way:
        direct = False

        def open(self, domain_id: int | None = None) -> Context:
            session = Session(Udp("127.0.0.1", link.port), keepalive=100, retry=100)
            context = Context(session)
            context.on_problem(lambda code, text: None)  # that the agent is gone
            return context

        def close(self) -> None:
            agent.stop()

    stage = Stage(Way())
    try:
        released: list[int] = []

        def run(goal: Goal) -> Iterator[float]:
            while not released:
                yield 0.01
            goal.succeed(Fibonacci.Result(sequence=[3]))

        pair = Pair(stage, run)
        goal = pair.send(1)
        pair.until_executing(goal)
        agent.stop()
        stage.until(lambda: all(context.state != "CONNECTED" for context in stage.contexts))
        agent = RunningAgent(UdpLink(link.port, "127.0.0.1"))
        stage.until(lambda: all(context.state == "CONNECTED" for context in stage.contexts))
        heard = states(stage)
        assert heard[0] == [EXECUTING], "the new agent knows the states"
        released.append(1)
        assert pair.result(goal) == [3]
        assert goal.status == SUCCEEDED
    finally:
        stage.close()


class Robber:
    """A requester whose first request for a result goes nowhere."""

    def __init__(self, requester: Any) -> None:
        self.requester = requester
        self.asked = 0

    def room(self) -> bool:
        return bool(self.requester.room())

    def send(self, request: Any) -> int:
        self.asked += 1
        return 10**6 if self.asked == 1 else int(self.requester.send(request))

    def destroy(self) -> None:
        self.requester.destroy()


def test_a_result_that_was_lost_is_asked_for_again(stage: Stage) -> None:
    pair = Pair(stage)
    robber = pair.client.parts[2].entity = Robber(pair.client.parts[2].entity)
    goal = pair.send(1)
    assert pair.result(goal) == [0, 1, 1]
    assert robber.asked == 2


def test_an_executor_counts_an_action_as_one_handle() -> None:
    context = Context("local:")
    node = context.node("both")
    server = node.action_server(Fibonacci, "count", count)
    client = node.action_client(Fibonacci, "count")
    executor = Executor(context, handles=2)
    executor.add(server)
    executor.add(client)
    with pytest.raises(CapacityError, match="2 handles of 2"):
        executor.add(node.timer(1.0, lambda: None))
    results: list[list[int]] = []
    client.send_goal(Fibonacci.Goal(order=2), on_result=lambda goal, result: results.append(result.sequence))
    end = time.monotonic() + PATIENCE
    while not results:
        assert time.monotonic() < end
        executor.spin_some(0.1)
    assert list(results[0]) == [0, 1, 1, 2]
    executor.remove(client)
    client.destroy()
    node.destroy()
    context.close()


def test_a_server_that_was_destroyed_says_nothing_more(stage: Stage) -> None:
    kept: list[Goal] = []
    pair = Pair(stage, kept.append)
    goal = pair.send(1)
    pair.until_executing(goal)
    pair.server.destroy()
    assert kept[0].feedback(Fibonacci.Feedback()) is False
    kept[0].succeed(Fibonacci.Result())
    assert pair.server.lost == 1
    stage.until(lambda: True)
