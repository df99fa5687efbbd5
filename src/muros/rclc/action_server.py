"""Servers of actions: three services and two topics, run as one handle.

What an action is made of lies in plain services and publishers, which are made and destroyed in ``actions``. A server
takes their requests, keeps goals as long as somebody may ask for them, advances those whose ``on_execute`` is a
generator, and publishes the states of all goals whenever one changes, and again when the link has come back.
"""

from muros.compat import borrow, const, ticks_add, ticks_diff
from muros.rclc.executor import Handle
from muros.rclc.goals import Goal

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc._types import Publisher
    from muros.rclc.context import Context

_NEVER = const(1000000)
_AGAIN = const(20)  # ms until what was not taken is sent again
_CONNECTED = const(2)
_ACCEPTED = const(1)
_ABORT = const(3)
_SUCCEED = const(2)
_CANCELED = const(4)
_SUCCEEDED = const(4)
_ASKERS = const(8)  # requests for one result that wait


class ActionServer(Handle):
    """Made by ``Node.action_server``. ``goals`` are those that it knows: active ones, and ended ones that wait to be
    forgotten.

    ``lost`` counts results that were forgotten before their time because too many goals have ended, and feedback that
    was not taken; ``refused`` goals that came while as many were active as may be.
    """

    capacity = 0  # goals that may be active
    keep = 0  # ended goals that are known
    expiry = 0  # ms for which an ended goal is known
    lost = 0
    refused = 0

    if TYPE_CHECKING:
        kind: "Any"
        cancel_kind: "Any"
        entry_kind: "Any"
        on_goal: "Callable[[Any], object] | None"
        on_execute: "Callable[[Goal], Any] | None"
        on_cancel: "Callable[[Goal], object] | None"
        on_accepted: "Callable[[Goal], object] | None"
        clock: "Callable[[], tuple[int, int]]"
        feedback: "Publisher"
        status: "Publisher"
        array: "Any"
        message: "Any"

    def __init__(self, context: "Context", name: str) -> None:
        super().__init__(context)
        self.name = name
        self.goals: "list[Goal]" = []
        self.parts: "list[Any]" = []  # the services: goals, cancelling, results
        self.entities: "list[Any]" = []  # these, and the topics
        self._running: "list[list[Any]]" = []  # goal, generator, tick of its next step
        self._starting: "list[Goal]" = []
        self._stale = False  # the states must be published
        self._retry = 0
        self._state = 0  # of the middleware

    def find(self, identity: bytes) -> "Goal | None":
        """The goal of that id, None if it is not known."""
        for goal in self.goals:
            if goal.id == identity:
                return goal
        return None

    def take_goal(self, request: "Any") -> "Any":
        """Answers a request to take a goal."""
        response = self.kind.SendGoal.Response()
        identity = bytes(request.goal_id.uuid)
        if self.find(identity) is not None:
            return response
        active = 0
        for goal in self.goals:
            active += goal.active
        if active >= self.capacity:
            self.refused += 1
            borrow("muros.rclc.actions").tell_full(self)
            return response
        if self.on_goal is not None:
            try:
                if not self.on_goal(request.goal):
                    return response
            except Exception:
                self.parts[0].reply(self.parts[0].identity, response)
                raise
        entry = self.entry_kind()
        info = entry.goal_info
        info.goal_id.uuid = identity
        info.stamp.sec, info.stamp.nanosec = self.clock()
        entry.status = _ACCEPTED
        made = self.make(identity, request.goal, entry)
        self.goals.append(made)
        self._starting.append(made)
        self.changed()
        response.accepted = True
        response.stamp.sec, response.stamp.nanosec = info.stamp.sec, info.stamp.nanosec
        return response

    def make(self, identity: bytes, request: "Any", entry: "Any") -> Goal:
        """A goal."""
        return Goal(self, identity, request, entry)

    def take_cancel(self, request: "Any") -> "Any":
        """Answers a request to cancel goals."""
        return borrow("muros.rclc.actions").cancel(self, request)

    def take_result(self, request: "Any") -> "Any":
        """Answers a request for a result, later if the goal goes on."""
        goal = self.find(bytes(request.goal_id.uuid))
        if goal is None or not goal.active:
            return self._outcome(goal)
        if len(goal.askers) >= _ASKERS:
            goal.askers.pop(0)
        goal.askers.append(self.parts[2].identity)
        return None

    def start(self, goal: Goal) -> None:
        """Calls ``on_execute`` of a goal that executes now."""
        if self.on_execute is None:
            return
        try:
            steps = self.on_execute(goal)
        except Exception:
            self._fail(goal)
            raise
        if hasattr(steps, "send"):
            self._running.append([goal, steps, self.context.clock()])
        elif steps is not None:
            self._conclude(goal, steps)

    def send_feedback(self, goal: Goal, feedback: "Any") -> bool:
        """Publishes feedback of a goal."""
        message = self.message
        message.goal_id.uuid = goal.id
        message.feedback = feedback
        taken = len(self.parts) > 0 and self.feedback.publish(message)
        if not taken:
            self.lost += 1
        return taken

    def changed(self) -> None:
        """A goal has another state."""
        self._stale = True
        self._retry = self.context.clock()

    def ended(self, goal: Goal) -> None:
        """A goal is about to end: it is known for a while."""
        goal.expires = ticks_add(self.context.clock(), self.expiry)
        ended = 1
        oldest = goal
        for other in self.goals:
            if not other.active:
                ended += 1
                if oldest.active or ticks_diff(other.expires, oldest.expires) < 0:
                    oldest = other
        if ended > self.keep and oldest is not goal:
            self.goals.remove(oldest)
            self.lost += 1

    def ready(self, now: int) -> bool:
        """Whether there is a request to take, a goal to advance or to forget, or something to send."""
        for part in self.parts:
            if part.ready(now):
                return True
        return self.left(now) == 0

    def run(self, now: int) -> None:
        """Does all of it, once."""
        for part in self.parts:
            if part.ready(now):
                part.run(now)
        while self._starting:
            goal = self._starting.pop(0)
            if self.on_accepted is not None:
                self.on_accepted(goal)
            elif goal.status == _ACCEPTED:
                goal.execute()
        for running in self._running[:]:
            if ticks_diff(running[2], now) <= 0:
                self._step(running, now)
        for goal in self.goals[:]:
            if not goal.active:
                self._answer(goal)
                if not goal.askers and ticks_diff(goal.expires, now) <= 0:
                    self.goals.remove(goal)
                    self.changed()
        self._publish(now)

    def left(self, now: int) -> int:
        """Milliseconds until something is due."""
        state = self.context.middleware.state
        if state != self._state:
            self._state = state
            if self.goals:
                self.changed()
        if self._starting:
            return 0
        left = _NEVER
        if self._stale and state == _CONNECTED:
            left = max(ticks_diff(self._retry, now), 0)
        for running in self._running:
            left = min(left, max(ticks_diff(running[2], now), 0))
        for goal in self.goals:
            if goal.active:
                continue
            if goal.askers:
                if self.parts[2].entity.room():
                    return 0
            else:
                left = min(left, max(ticks_diff(goal.expires, now), 0))
        return left

    def destroy(self) -> None:
        """Takes it away; goals that have not ended never will."""
        borrow("muros.rclc.actions").destroy(self)

    def _step(self, running: "list[Any]", now: int) -> None:
        """Advances the generator of a goal; it yields seconds, or None for the next pass."""
        goal = running[0]
        try:
            pause = next(running[1])
        except StopIteration as end:
            self._running.remove(running)
            self._conclude(goal, end.value)
        except Exception:
            self._running.remove(running)
            self._fail(goal)
            raise
        else:
            running[2] = ticks_add(now, int((pause or 0) * 1000))

    def _conclude(self, goal: Goal, result: "Any") -> None:
        """What ``on_execute`` returned ends a goal that it has not ended itself."""
        if not goal.active:
            return
        if result is None:
            goal.abort()
        elif goal.canceling:
            goal.canceled(result)
        else:
            goal.succeed(result)

    def _fail(self, goal: Goal) -> None:
        if goal.active:
            goal.abort()

    def _answer(self, goal: Goal) -> None:
        """Sends the result of a goal to those who asked."""
        service = self.parts[2]
        while goal.askers and service.entity.room():
            service.reply(goal.askers.pop(0), self._outcome(goal))

    def _outcome(self, goal: "Goal | None") -> "Any":
        response = self.kind.GetResult.Response()
        if goal is not None:
            response.status = goal.status
            if goal.result is not None:
                response.result = goal.result
        return response

    def _publish(self, now: int) -> None:
        """Publishes the states of all goals, if one has changed."""
        if not self._stale or self.context.middleware.state != _CONNECTED or ticks_diff(self._retry, now) > 0:
            return
        self.array.status_list = [goal.entry for goal in self.goals]
        if self.parts[2].entity.room() and self.status.publish(self.array):
            self._stale = False
        else:
            self._retry = ticks_add(now, _AGAIN)
