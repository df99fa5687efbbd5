"""Clients of actions: three clients of services and two subscriptions, run as one handle.

A goal that a server has accepted is asked for its result at once, and again when the server says that it has ended but
the result has not come. What an action is made of is made and destroyed in ``actions``.
"""

from muros.compat import borrow, const, ticks_add, ticks_diff
from muros.rclc.executor import Handle

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Context

_NEVER = const(1000000)
_TIMEOUT = const(10)  # seconds
_CALL = const(30)  # seconds
_LONG = const(500000)  # seconds: longer than boards can count
_AGAIN = const(2000)  # ms from the end of a goal until its result is asked for again
_ACCEPTED = const(1)
_CANCELING = const(3)
_SUCCEEDED = const(4)


class SentGoal:
    """A goal that was sent. ``id`` are its 16 bytes.

    ``accepted`` is None until the server has answered; ``status`` is a STATUS of action_msgs/msg/GoalStatus as far as
    it is known, ``result`` a message of the action's ``Result`` once it has come; ``stamp`` (s, ns) when the server
    has accepted it.
    """

    def __init__(
        self,
        client: "ActionClient",
        identity: bytes,
        on_response: "Callable[[SentGoal, bool | None], object] | None",
        on_feedback: "Callable[[SentGoal, Any], object] | None",
        on_result: "Callable[[SentGoal, Any], object] | None",
    ) -> None:
        self.client = client
        self.id = identity
        self.on_response = on_response
        self.on_feedback = on_feedback
        self.on_result = on_result
        self.accepted: "bool | None" = None
        self.status = 0
        self.result: "Any" = None
        self.stamp = (0, 0)
        self.done = False
        self.due: "int | None" = None  # the tick at which to ask for the result
        self.end: "int | None" = None  # the tick after which nobody waits for it

    def cancel(
        self, on_answer: "Callable[[SentGoal, bool | None], object] | None" = None, timeout: float = _TIMEOUT
    ) -> bool:
        """Asks the server to cancel it; an executor calls ``on_answer(goal, canceling)``, with None after ``timeout``.

        False when the request was not taken.
        """

        def answer(code: "int | None", canceling: "list[bytes]") -> None:
            if on_answer is not None:
                on_answer(self, None if code is None else self.id in canceling)

        return self.client.cancel(self.id, None, answer, timeout)


class ActionClient(Handle):
    """Made by ``Node.action_client``. ``goals`` are those that have neither ended nor been given up."""

    capacity = 0  # goals at once; 0: any number

    if TYPE_CHECKING:
        kind: "Any"
        cancel_kind: "Any"

    def __init__(self, context: "Context", name: str) -> None:
        super().__init__(context)
        self.name = name
        self.goals: "list[SentGoal]" = []
        self.parts: "list[Any]" = []  # clients for goals, cancelling and results; feedback, states
        self.entities: "list[Any]" = []

    def send_goal(
        self,
        goal: "Any",
        on_response: "Callable[[SentGoal, bool | None], object] | None" = None,
        on_feedback: "Callable[[SentGoal, Any], object] | None" = None,
        on_result: "Callable[[SentGoal, Any], object] | None" = None,
        timeout: float = _TIMEOUT,
        result_timeout: "float | None" = None,
    ) -> "SentGoal | None":
        """Sends a goal, a message of the action's ``Goal``; None when it was not taken.

        An executor calls ``on_response(goal, accepted)``, with None when nobody has answered within ``timeout``
        seconds; ``on_feedback(goal, feedback)``; and when the goal has ended ``on_result(goal, result)``, with None
        when the server does not know the goal any more or ``result_timeout`` seconds have passed since the response.
        Raises CapacityError when as many goals are on their way as may be.
        """
        if self.capacity and len(self.goals) >= self.capacity:
            borrow("muros.rclc.actions").full(self)
        identity = borrow("muros.rclc.actions").new_id(self.context.middleware)
        made = SentGoal(self, identity, on_response, on_feedback, on_result)
        request = self.kind.SendGoal.Request()
        request.goal_id.uuid = made.id
        request.goal = goal
        if not self.parts[0].send(
            request, lambda reply: self._accepted(made, reply, result_timeout), timeout
        ):
            return None
        self.goals.append(made)
        return made

    def call(
        self,
        goal: "Any",
        timeout: float = _CALL,
        on_feedback: "Callable[[SentGoal, Any], object] | None" = None,
    ) -> "SentGoal | None":
        """Sends a goal and waits for its end, at most ``timeout`` seconds; ``result`` of what it returns is None if it
        has not ended. None when nobody has answered.

        Not for callbacks: those run in an executor, where ``send_goal`` belongs.
        """
        made: "SentGoal | None" = borrow("muros.rclc.actions").call(self, goal, timeout, on_feedback)
        return made

    def cancel(
        self,
        identity: "bytes | None" = None,
        stamp: "tuple[int, int] | None" = None,
        on_answer: "Callable[[int | None, list[bytes]], object] | None" = None,
        timeout: float = _TIMEOUT,
    ) -> bool:
        """Asks the server to cancel the goal of an id, all accepted up to ``stamp`` (s, ns), both, or else all.

        An executor calls ``on_answer(code, ids)`` with a return code of action_msgs/srv/CancelGoal and the ids of
        goals that are being cancelled; the code is None after ``timeout`` seconds. False when the request was not
        taken.
        """
        request = self.cancel_kind.Request()
        info = request.goal_info
        if identity is not None:
            info.goal_id.uuid = identity
        if stamp is not None:
            info.stamp.sec, info.stamp.nanosec = stamp

        def answer(reply: "Any") -> None:
            ids = [] if reply is None else [bytes(goal.goal_id.uuid) for goal in reply.goals_canceling]
            for goal in self.goals:
                if goal.id in ids:
                    goal.status = max(goal.status, _CANCELING)
            if on_answer is not None:
                on_answer(None if reply is None else reply.return_code, ids)

        sent: bool = self.parts[1].send(request, answer, timeout)
        return sent

    def take_feedback(self, message: "Any") -> None:
        """Hands on feedback of a goal of ours."""
        identity = bytes(message.goal_id.uuid)
        for goal in self.goals:
            if goal.id == identity and goal.on_feedback is not None:
                goal.on_feedback(goal, message.feedback)

    def take_states(self, message: "Any") -> None:
        """Learns the states of our goals."""
        for entry in message.status_list:
            identity = bytes(entry.goal_info.goal_id.uuid)
            for goal in self.goals:
                if goal.id == identity:
                    if entry.status > goal.status:
                        goal.status = entry.status
                    if goal.status >= _SUCCEEDED and goal.accepted and goal.due is None:
                        goal.due = ticks_add(self.context.clock(), _AGAIN)

    def ready(self, now: int) -> bool:
        """Whether something has come, or is to be asked."""
        for part in self.parts:
            if part.ready(now):
                return True
        return self._asks(now) is not None

    def run(self, now: int) -> None:
        """Hands on what has come: an answer to a goal, all feedback, an answer to cancelling, all states, a result."""
        for i in (0, 3, 1, 4, 2):
            while i < len(self.parts) and self.parts[i].ready(now):
                self.parts[i].run(now)
                if i < 3:
                    break
        goal = self._asks(now)
        if goal is not None:
            self._ask(goal, now)

    def left(self, now: int) -> int:
        """Milliseconds until something is due."""
        left = _NEVER
        for part in self.parts:
            left = min(left, part.left(now))
        for goal in self.goals:
            if goal.due is not None and self.parts[2].entity.room():
                left = min(left, max(ticks_diff(goal.due, now), 0))
            if goal.end is not None:
                left = min(left, max(ticks_diff(goal.end, now), 0))
        return left

    def destroy(self) -> None:
        """Takes it away; its goals go on without it."""
        borrow("muros.rclc.actions").destroy(self)

    def _accepted(self, goal: SentGoal, reply: "Any", timeout: "float | None") -> None:
        """Takes the answer to a goal."""
        goal.accepted = None if reply is None else bool(reply.accepted)
        if goal.accepted:
            now = self.context.clock()
            goal.stamp = (reply.stamp.sec, reply.stamp.nanosec)
            goal.status = max(goal.status, _ACCEPTED)
            goal.due = now
            if timeout is not None:
                goal.end = ticks_add(now, int(timeout * 1000))
            if self.parts[2].entity.room():
                self._ask(goal, now)
        else:
            self._forget(goal)
        if goal.on_response is not None:
            goal.on_response(goal, goal.accepted)

    def _asks(self, now: int) -> "SentGoal | None":
        """A goal whose result is to be asked for, or given up."""
        for goal in self.goals:
            if goal.end is not None and ticks_diff(goal.end, now) <= 0:
                return goal
            if goal.due is not None and ticks_diff(goal.due, now) <= 0 and self.parts[2].entity.room():
                return goal
        return None

    def _ask(self, goal: SentGoal, now: int) -> None:
        """Asks for the result of a goal, unless the time is over."""
        if goal.end is not None and ticks_diff(goal.end, now) <= 0:
            self._finish(goal, None)
            return
        request = self.kind.GetResult.Request()
        request.goal_id.uuid = goal.id
        sent = self.parts[2].send(request, lambda reply: self._resulted(goal, reply), _LONG)
        goal.due = None if sent and goal.status < _SUCCEEDED else ticks_add(now, _AGAIN)

    def _resulted(self, goal: SentGoal, reply: "Any") -> None:
        """Takes an answer to the question for a result."""
        if reply is None or goal.done:
            return
        if reply.status:
            goal.status = reply.status
            goal.result = reply.result
        else:
            goal.status = 0  # the server does not know it
        self._finish(goal, goal.result)

    def _finish(self, goal: SentGoal, result: "Any") -> None:
        goal.done = True
        self._forget(goal)
        if goal.on_result is not None:
            goal.on_result(goal, result)

    def _forget(self, goal: SentGoal) -> None:
        goal.due = goal.end = None
        if goal in self.goals:
            self.goals.remove(goal)
