"""An action server that counts Fibonacci numbers, and a client: one source for boards (MicroPython) and computers.

    python fibonacci.py dds:                         # then: muros action send_goal -f /fibonacci \\
                                                     #   example_interfaces/action/Fibonacci '{order: 8}'
    micropython fibonacci.py udp 127.0.0.1 8888
    python fibonacci.py dds: ask 8                   # sends a goal to a server that runs elsewhere
    python fibonacci.py dds: ask 1000 5              # and cancels it after 5 pieces of feedback

The server works at several goals at once and agrees to cancel each of them.
"""

import sys

from muros.rclc import Context, Executor

from example_interfaces.action import Fibonacci

STATES = ("unknown", "accepted", "executing", "canceling", "succeeded", "canceled", "aborted")


def count(goal):  # type: ignore[no-untyped-def]
    """Counts, a number each tenth of a second; the executor goes on with other things at each ``yield``."""
    sequence = [0, 1]
    print("counting to", goal.request.order)
    while len(sequence) <= goal.request.order:
        if goal.canceling:
            print("canceled at", len(sequence))
            goal.canceled(Fibonacci.Result(sequence=sequence))
            return
        sequence.append((sequence[-1] + sequence[-2]) & 0x7FFFFFFF)
        goal.feedback(Fibonacci.Feedback(sequence=sequence[-8:]))
        yield 0.1
    goal.succeed(Fibonacci.Result(sequence=sequence))
    print("counted to", goal.request.order)


def serve(context: "Context") -> None:
    """Serves until it is interrupted."""
    context.node("counter").action_server(
        Fibonacci,
        "fibonacci",
        count,
        on_goal=lambda request: request.order >= 0,
        on_cancel=lambda goal: True,
    )
    Executor(context).spin()


def ask(context: "Context", order: int, patience: int) -> None:
    """Sends a goal and prints what becomes of it; cancels it after so many pieces of feedback (0: never)."""
    client = context.node("asker").action_client(Fibonacci, "fibonacci")
    pieces = []

    def on_feedback(goal, feedback):  # type: ignore[no-untyped-def]
        pieces.append(feedback.sequence[-1])
        if len(pieces) == patience:
            goal.cancel()

    goal = client.call(Fibonacci.Goal(order=order), 60.0, on_feedback)
    if goal is None:
        print("nobody answers")
    elif not goal.accepted:
        print("the goal was rejected")
    elif goal.result is None:
        print("no result yet")
    else:
        print("heard", pieces)
        print(STATES[goal.status], list(goal.result.sequence))
    context.close()


def open_context(words: "list[str]") -> "Context":
    """The way into the graph that the words name."""
    if words[0] != "udp":
        return Context(words[0])
    from muros.client import Udp

    return Context(Udp(words[1], int(words[2])))


def main(words: "list[str]") -> None:
    """Is the server, or a client."""
    context = open_context(words)
    if "ask" in words:
        numbers = words[words.index("ask") + 1 :]
        ask(context, int(numbers[0]), int(numbers[1]) if len(numbers) > 1 else 0)
    else:
        serve(context)


if __name__ == "__main__":
    main(sys.argv[1:])
