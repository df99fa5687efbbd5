"""Actions on every runtime, by the ids of the acceptance cases: A of the client, B of the server."""

from muros.compat import const
from tests.board.broker import Broker

from example_interfaces.action import Fibonacci

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

_EXECUTING = const(2)
_SUCCEEDED = const(4)
_CANCELED = const(5)
_ABORTED = const(6)


def count(goal: "Any") -> "Iterator[float]":
    """Gives a number at each step; goals of negative order abort, others may be cancelled."""
    sequence = [0, 1]
    for _ in range(abs(goal.request.order)):
        if goal.canceling:
            goal.canceled(Fibonacci.Result(sequence=sequence))
            return
        sequence.append((sequence[-1] + sequence[-2]) % 1000)
        while not goal.feedback(Fibonacci.Feedback(sequence=sequence[-12:])):
            yield 0.001  # the window to the agent is full
        yield 0.002
    if goal.request.order < 0:
        goal.abort(Fibonacci.Result(sequence=sequence))
    else:
        goal.succeed(Fibonacci.Result(sequence=sequence))


class Pair:
    """A server and a client, and what the client has heard."""

    def __init__(self, result_timeout: float = 10.0) -> None:
        self.broker = Broker()
        self.agrees = True
        self.server = (
            self.broker.context()
            .node("server")
            .action_server(
                Fibonacci,
                "count",
                count,
                lambda request: request.order != 13,
                lambda goal: self.agrees,
                goals=5,
                result_timeout=result_timeout,
                clock=lambda: (7, self.broker.now),
            )
        )
        self.client = self.broker.context().node("client").action_client(Fibonacci, "count")
        self.responses: "list[Any]" = []
        self.feedback: "list[Any]" = []
        self.results: "list[Any]" = []
        self.broker.settle()

    def send(self, order: int) -> "Any":
        """Sends a goal."""
        self.broker.until(lambda: self.client.parts[0].entity.room())
        goal = self.client.send_goal(
            Fibonacci.Goal(order=order),
            lambda goal, accepted: self.responses.append((goal, accepted)),
            lambda goal, piece: self.feedback.append((goal, len(piece.sequence))),
            lambda goal, result: self.results.append((goal, result)),
        )
        assert goal is not None
        return goal

    def pieces(self, goal: "Any") -> "list[int]":
        """The lengths of what a goal's feedback was."""
        return [n for of, n in self.feedback if of is goal]

    def result(self, goal: "Any") -> "list[int]":
        """Waits for the result of a goal; its numbers."""
        self.broker.until(lambda: goal.done)
        return list(goal.result.sequence)

    def cancel(self, goal: "Any") -> "list[bool | None]":
        """Asks to cancel a goal; the answer will be there."""
        answers: "list[bool | None]" = []
        self.broker.until(lambda: goal.cancel(lambda goal, canceling: answers.append(canceling)))
        return answers


def test_a1_b1_a_goal_is_accepted() -> None:
    pair = Pair()
    goal = pair.send(3)
    assert (goal.accepted, goal.status) == (None, 0)
    pair.broker.until(lambda: pair.responses)
    assert pair.responses == [(goal, True)]
    assert (goal.stamp[0], 1000 < goal.stamp[1] <= pair.broker.now) == (7, True)
    assert pair.result(goal) == [0, 1, 1, 2, 3]
    assert pair.client.goals == []


def test_a2_b2_a_goal_is_rejected() -> None:
    pair = Pair()
    goal = pair.send(13)
    pair.broker.until(lambda: pair.responses)
    assert pair.responses == [(goal, False)]
    assert (pair.client.goals, pair.server.goals) == ([], [])
    assert pair.result(pair.send(1)) == [0, 1, 1], "the next goal is taken"


def test_a3_b3_ten_pieces_of_feedback_then_success() -> None:
    pair = Pair()
    goal = pair.send(10)
    assert pair.result(goal) == [0, 1, 1, 2, 3, 5, 8, 13, 21, 34, 55, 89]
    pair.broker.run(20)
    assert (goal.status, pair.pieces(goal)) == (_SUCCEEDED, list(range(3, 13)))


def test_a4_b4_five_pieces_of_feedback_then_abort() -> None:
    pair = Pair()
    goal = pair.send(-5)
    assert pair.result(goal) == [0, 1, 1, 2, 3, 5, 8]
    pair.broker.run(20)
    assert (goal.status, pair.pieces(goal)) == (_ABORTED, [3, 4, 5, 6, 7])


def test_a5_b5_cancelling_is_accepted() -> None:
    pair = Pair()
    goal = pair.send(1000)
    pair.broker.until(lambda: len(pair.feedback) > 2)
    answers = pair.cancel(goal)
    assert pair.result(goal)[:4] == [0, 1, 1, 2]
    assert (answers, goal.status) == ([True], _CANCELED)


def test_a6_b6_cancelling_is_rejected_and_the_goal_goes_on() -> None:
    pair = Pair()
    pair.agrees = False
    goal = pair.send(10)
    pair.broker.until(lambda: pair.feedback)
    answers = pair.cancel(goal)
    assert len(pair.result(goal)) == 12
    assert (answers, goal.status) == ([False], _SUCCEEDED)


def test_a7_b7_five_goals_in_parallel() -> None:
    pair = Pair()
    goals = [pair.send(10) for _ in range(5)]
    for goal in goals:
        assert len(pair.result(goal)) == 12
    pair.broker.run(20)
    for goal in goals:
        assert pair.pieces(goal) == list(range(3, 13))


def test_a8_b8_destroying_twice() -> None:
    pair = Pair()
    pair.result(pair.send(1))
    for _ in range(2):
        pair.server.destroy()
        pair.client.destroy()
    assert [executor.context.handles for executor in pair.broker.executors] == [[], []]


def test_b9_a_result_is_kept_for_who_asks_late_and_then_forgotten() -> None:
    pair = Pair(0.4)
    goal = pair.send(1)
    assert pair.result(goal) == [0, 1, 1]
    late = pair.client.parts[2]
    request = Fibonacci.GetResult.Request()
    request.goal_id.uuid = goal.id
    replies: "list[Any]" = []
    pair.broker.until(lambda: late.send(request, replies.append))
    pair.broker.until(lambda: replies)
    assert (replies[0].status, list(replies[0].result.sequence)) == (_SUCCEEDED, [0, 1, 1])
    pair.broker.run(500)
    assert pair.server.goals == []
    pair.broker.until(lambda: late.send(request, replies.append))
    pair.broker.until(lambda: len(replies) == 2)
    assert replies[1].status == 0, "nobody knows it any more"


def test_who_is_cancelled() -> None:
    """By an id, by a time, by both, or all: the policies of action_msgs/srv/CancelGoal."""
    pair = Pair()
    goals: "list[Any]" = []
    for _ in range(4):
        goals.append(pair.send(10000))
        pair.broker.until(lambda: goals[-1].status == _EXECUTING)
        pair.broker.run(10)
    answers: "list[Any]" = []

    def cancel(identity: "bytes | None", stamp: "tuple[int, int] | None") -> "tuple[int, list[bytes]]":
        answers.clear()
        pair.broker.until(
            lambda: pair.client.cancel(identity, stamp, lambda code, ids: answers.append((code, ids)))
        )
        pair.broker.until(lambda: answers)
        code, ids = answers[0]
        return code, sorted(ids)

    assert cancel(bytes(range(16)), None) == (2, []), "nobody knows it"
    assert cancel(None, (7, goals[0].stamp[1])) == (0, [goals[0].id])
    pair.result(goals[0])
    assert cancel(goals[0].id, None) == (3, []), "it has ended"
    assert cancel(goals[2].id, (7, goals[1].stamp[1])) == (0, sorted([goals[1].id, goals[2].id]))
    pair.agrees = False
    assert cancel(None, None)[0] == 1
    pair.agrees = True
    assert goals[3].id in cancel(None, None)[1]
    for goal in goals:
        pair.result(goal)
        assert goal.status == _CANCELED
