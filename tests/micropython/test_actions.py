"""An action served by MicroPython through an agent, and one that MicroPython uses."""

from pathlib import Path
from typing import Any

from muros.interfaces import board
from muros.rclc import ActionServer
from tests.micropython.runtimes import require
from tests.micropython.test_lifecycle import Board, stage
from tests.rclc_space.ways import Stage

from action_msgs.msg import GoalStatusArray
from example_interfaces.action import Fibonacci

__all__ = ["stage"]

TYPES = ["example_interfaces/action/Fibonacci"]

SERVER = """
import sys
from muros.client import Udp
from muros.compat import loans
from muros.rclc import Context, Executor, GoalError

from example_interfaces.action import Fibonacci

context = Context(Udp("127.0.0.1", int(sys.argv[1])))
context.on_problem(lambda code, text: print("problem", code, text) if code == 16 else None)
node = context.node("counter", "lab")
ended = []

def run(goal):
    sequence = [0, 1]
    for _ in range(goal.request.order):
        if goal.canceling:
            goal.canceled(Fibonacci.Result(sequence=sequence))
            break
        sequence.append(sequence[-1] + sequence[-2])
        while not goal.feedback(Fibonacci.Feedback(sequence=sequence)):
            yield 0.01
        yield 0.02
    else:
        goal.succeed(Fibonacci.Result(sequence=sequence))
    try:
        goal.abort()
    except GoalError as error:
        print(error.code, str(error).split(" of ")[1])
    ended.append(goal.status)

server = node.action_server(
    Fibonacci, "count", run, lambda goal: goal.order != 13, lambda goal: True, goals=1, clock=lambda: (7, 8)
)
executor = Executor(context)
while len(ended) < 2:
    executor.spin_some(0.05)
for i in range(30):
    executor.spin_some(0.01)
print(ended, server.refused, server.lost, len(server.goals), "muros.rclc.actions" in sys.modules, loans)
context.close()
"""

CLIENT = """
import sys
from muros.client import Udp
from muros.rclc import Context, Executor

from example_interfaces.action import Fibonacci

context = Context(Udp("127.0.0.1", int(sys.argv[1])))
client = context.node("asker").action_client(Fibonacci, "/lab/count")
goal = None
while goal is None:
    goal = client.call(Fibonacci.Goal(order=4), 5.0)
print(goal.accepted, goal.status, list(goal.result.sequence), goal.stamp)
goal = client.call(Fibonacci.Goal(order=13), 5.0)
print(goal.accepted, goal.status, goal.result)

results = []
pieces = []
answers = []

def on_feedback(goal, piece):
    pieces.append(list(piece.sequence))
    if len(pieces) == 2:
        goal.cancel(lambda goal, canceling: answers.append(canceling))

sent = client.send_goal(
    Fibonacci.Goal(order=1000), on_feedback=on_feedback, on_result=lambda goal, result: results.append(result)
)
executor = Executor(context)
while not results:
    executor.spin_some(0.05)
print(answers, sent.status, pieces[:2], list(results[0].sequence)[:4], client.goals)
context.close()
"""


class ActionBoard(Board):
    """A board with the types of an action."""

    def __init__(self, program: str, port: int, folder: Path) -> None:
        require("unix")
        board.generate(TYPES, folder, action_services=True, constants=())
        super().__init__(program, port, folder)


def test_an_action_of_a_board(stage: Stage, tmp_path: Path) -> None:
    way: Any = stage.way
    running = ActionBoard(SERVER, way.link.port, tmp_path)
    node = stage.node("asker")
    client = node.action_client(Fibonacci, "/lab/count")
    states: list[list[int]] = []
    node.subscription(
        GoalStatusArray,
        "/lab/count/_action/status",
        lambda array: states.append([entry.status for entry in array.status_list]),
        "status",
    )
    responses: list[bool | None] = []
    lengths: list[int] = []
    results: list[Any] = []

    def send(order: int) -> Any:
        stage.until(lambda: client.parts[0].entity.room())
        return client.send_goal(
            Fibonacci.Goal(order=order),
            lambda goal, accepted: responses.append(accepted),
            lambda goal, piece: lengths.append(len(piece.sequence)),
            lambda goal, result: results.append(list(result.sequence)),
            timeout=20.0,
        )

    goal = send(13)
    stage.until(lambda: running.ended or goal.accepted is False)
    goal = send(5)
    stage.until(lambda: running.ended or results)
    assert (goal.status, goal.stamp, results) == (4, (7, 8), [[0, 1, 1, 2, 3, 5, 8]])
    stage.until(lambda: len(lengths) == 5)
    assert lengths == [3, 4, 5, 6, 7]
    long = send(1000)
    stage.until(lambda: len(lengths) > 6)
    other = send(1)
    stage.until(lambda: other.accepted is False)
    answers: list[bool | None] = []
    stage.until(lambda: long.cancel(lambda goal, canceling: answers.append(canceling)))
    stage.until(lambda: len(results) == 2)
    assert (answers, long.status, results[1][:4]) == ([True], 5, [0, 1, 1, 2])
    stage.until(lambda: running.ended)
    assert running.lines() == [
        "2301 action 'count' is succeeded: it cannot abort",
        "problem 16 action 'count' refused a goal: 1 of 1 are active. Make it with goals=2.",
        "2301 action 'count' is canceled: it cannot abort",
        "[4, 5] 1 0 2 False []",
    ]
    assert states[-1] == [4, 5]


def test_a_board_uses_an_action(stage: Stage, tmp_path: Path) -> None:
    way: Any = stage.way

    def run(goal: Any) -> Any:
        sequence = [0, 1]
        for _ in range(goal.request.order):
            if goal.canceling:
                goal.canceled(Fibonacci.Result(sequence=sequence))
                return
            sequence.append((sequence[-1] + sequence[-2]) % 1000)
            while not goal.feedback(Fibonacci.Feedback(sequence=sequence[-8:])):
                yield 0.01
            yield 0.02
        goal.succeed(Fibonacci.Result(sequence=sequence))

    server: ActionServer = stage.node("counter", "lab").action_server(
        Fibonacci,
        "count",
        run,
        on_goal=lambda goal: goal.order != 13,
        on_cancel=lambda goal: True,
        clock=lambda: (7, 8),
    )
    stage.until(lambda: stage.contexts[0].state == "CONNECTED")
    running = ActionBoard(CLIENT, way.link.port, tmp_path)
    stage.until(lambda: running.ended)
    assert running.lines() == [
        "True 4 [0, 1, 1, 2, 3, 5] (7, 8)",
        "False 0 None",
        "[True] 5 [[0, 1, 1], [0, 1, 1, 2]] [0, 1, 1, 2] []",
    ]
    assert [goal.status for goal in server.goals] == [4, 5]
