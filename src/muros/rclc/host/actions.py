"""Actions on hosts: what boards have, and checks of what is asked for. See ``host.context``."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from muros.client import reasons
from muros.rclc import action_client as client_
from muros.rclc import action_server as server_
from muros.rclc import actions, goals
from muros.rclc.errors import RclError
from muros.rclc.host.checks import WrongTypeError, WrongValueError, be_callable, fits, no_class, other
from muros.rclc.host.sharing import call_elsewhere, hand_over

if TYPE_CHECKING:
    from muros.rclc.host.context import Context, Node
    from muros.rclc.memory import Rules

Callback = Callable[..., object] | None


class Goal(goals.Goal):
    """A goal that a server has accepted; see ``muros.rclc.goals.Goal``. TypeError for messages of other types."""

    def feedback(self, message: Any) -> bool:
        """Tells the client how it goes; whether that was taken. Raises GoalError when the goal has ended."""
        if not fits(message, self.server.kind.Feedback):
            raise other(message, self.server.kind.Feedback, "feedback")
        return super().feedback(message)

    def finish(self, event: int, result: Any) -> None:
        """Ends with a result."""
        if result is not None and not fits(result, self.server.kind.Result):
            raise other(result, self.server.kind.Result, "a goal")
        super().finish(event, result)


class ActionServer(server_.ActionServer):
    """Made by ``Node.action_server``; see ``muros.rclc.action_server.ActionServer``."""

    def make(self, identity: bytes, request: Any, entry: Any) -> Goal:
        """A goal."""
        return Goal(self, identity, request, entry)

    def take_goal(self, request: Any) -> Any:
        """Answers a request to take a goal."""
        before = self.refused
        response = super().take_goal(request)
        if self.refused > before == 0 and self.context.middleware.on_problem is None:
            reasons.say(actions.full_text(self))
        return response


class ActionClient(client_.ActionClient):
    """Made by ``Node.action_client``; see ``muros.rclc.action_client.ActionClient``."""

    context: Context

    def send_goal(
        self,
        goal: Any,
        on_response: Callback = None,
        on_feedback: Callback = None,
        on_result: Callback = None,
        timeout: float = client_._TIMEOUT,
        result_timeout: float | None = None,
    ) -> client_.SentGoal | None:
        """Sends a goal; see ``muros.rclc.action_client.ActionClient.send_goal``. Raises TypeError for another type."""
        if not fits(goal, self.kind.Goal):
            raise other(goal, self.kind.Goal, "send_goal")
        for callback, name in (
            (on_response, "on_response"),
            (on_feedback, "on_feedback"),
            (on_result, "on_result"),
        ):
            if callback is not None:
                be_callable(callback, name)
        return super().send_goal(goal, on_response, on_feedback, on_result, timeout, result_timeout)

    def cancel(
        self,
        identity: bytes | None = None,
        stamp: tuple[int, int] | None = None,
        on_answer: Callback = None,
        timeout: float = client_._TIMEOUT,
    ) -> bool:
        """Asks the server to cancel goals; see ``muros.rclc.action_client.ActionClient.cancel``.

        Raises TypeError for what is no id or no stamp.
        """
        if identity is not None and not (isinstance(identity, bytes) and len(identity) == 16):
            raise WrongTypeError(f"the id of a goal is 16 bytes, as of goal.id, not {identity!r}")
        if stamp is not None and not (isinstance(stamp, tuple) and [type(n) for n in stamp] == [int, int]):
            raise WrongTypeError(f"stamp is (seconds, nanoseconds), as of goal.stamp, not {stamp!r}")
        if on_answer is not None:
            be_callable(on_answer, "on_answer")
        return super().cancel(identity, stamp, on_answer, timeout)

    def call(
        self, goal: Any, timeout: float = client_._CALL, on_feedback: Callback = None
    ) -> client_.SentGoal | None:
        """Sends a goal and waits for its end; see ``muros.rclc.action_client.ActionClient.call``.

        Raises TypeError for another type, RclError when this very context serves the action.
        """
        if not fits(goal, self.kind.Goal):
            raise other(goal, self.kind.Goal, "call")
        service = self.context.services.get(self.parts[0].name) if self.parts else None
        if service is not None and hand_over(service) is None:
            raise RclError(
                f"action {self.name!r} is served by this very context, which does not run during call(). "
                "Use send_goal(goal, ...) and an executor."
            )
        if hand_over(self) is None:
            return super().call(goal, timeout, on_feedback)
        made: list[client_.SentGoal] = []

        def begin(done: Callable[[], object]) -> None:
            def answered(sent: client_.SentGoal, accepted: bool | None) -> None:
                if not accepted:
                    done()

            sent = self.send_goal(goal, answered, on_feedback, lambda sent, result: done(), timeout)
            if sent is None:
                done()
            else:
                made.append(sent)

        call_elsewhere(self, self.parts[0].entity.room, begin, timeout)
        return made[0] if made and made[0].accepted is not None else None


def make_server(
    node: Node,
    kind: Any,
    name: str,
    functions: tuple[Callback, Callback, Callback, Callback],
    limits: tuple[int, int, float],
    clock: Callable[[], tuple[int, int]] | None,
    memory: Rules | None = None,
) -> ActionServer:
    """A server; arguments as for ``muros.rclc.actions.make_server``."""
    _be_action(kind)
    words = ("on_execute", "on_goal", "on_cancel", "on_accepted")
    for function, word in zip(functions, words, strict=True):
        if function is not None:
            be_callable(function, word)
    if functions[0] is None and functions[3] is None:
        raise WrongTypeError(
            "an action server needs on_execute, which is called with each goal, or on_accepted"
        )
    for limit, word in ((limits[0], "goals"), (limits[1], "results")):
        if not isinstance(limit, int) or limit < 1:
            raise WrongValueError(f"{word} is {limit!r}: it must be a number of goals, at least 1")
    if not isinstance(limits[2], int | float) or not 0 <= limits[2] < math.inf:
        raise WrongValueError(f"result_timeout is {limits[2]!r}: it must be a number of seconds, at least 0")
    _be_name(node, name)
    made = ActionServer(node.context, name)
    actions.make_server(made, node, kind, functions, limits, clock or _wall_clock, _types(), memory)
    return made


def make_client(node: Node, kind: Any, name: str, capacity: int, memory: Rules | None = None) -> ActionClient:
    """A client; arguments as for ``muros.rclc.actions.make_client``."""
    _be_action(kind)
    if not isinstance(capacity, int) or capacity < 0:
        raise WrongValueError(
            f"goals is {capacity!r}: it must be how many may be on their way, or 0 for any number"
        )
    _be_name(node, name)
    made = ActionClient(node.context, name)
    actions.make_client(made, node, kind, capacity, _types(), memory)
    return made


def _types() -> tuple[Any, Any, Any]:
    interfaces = import_module("muros.interfaces")  # a room above this one
    return (
        interfaces.service("action_msgs/srv/CancelGoal"),
        interfaces.message("action_msgs/msg/GoalStatusArray"),
        interfaces.message("action_msgs/msg/GoalStatus"),
    )


def _wall_clock() -> tuple[int, int]:
    return divmod(time.time_ns(), 10**9)


def _be_name(node: Node, name: Any) -> None:
    if not isinstance(name, str):
        raise WrongTypeError(f"the name of an action is a str, not {name!r}")
    node._resolve(name)


def _be_action(kind: Any) -> None:
    if isinstance(kind, type) and hasattr(kind, "TYPE"):
        if hasattr(kind, "SendGoal") and hasattr(kind, "FeedbackMessage"):
            return
        raise WrongTypeError(f"{kind.TYPE} is no action such as example_interfaces/action/Fibonacci")
    raise no_class(kind, "an action class such as example_interfaces.action.Fibonacci")
