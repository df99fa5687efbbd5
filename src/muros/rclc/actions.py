"""What actions need now and then: making and destroying them, cancelling, and what is refused. Boards borrow this."""

from struct import pack

from muros.client.chance import draw
from muros.client.qos import Qos
from muros.compat import borrow, const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.action_client import ActionClient, SentGoal
    from muros.rclc.action_server import ActionServer
    from muros.rclc.context import Node
    from muros.rclc.goals import Goal
    from muros.rclc.memory import Rules

FULL = const(16)
"""The code with which a server tells ``on_problem`` that it has refused a goal, having as many as may be."""

_HANDLE_INVALID = const(2300)
_CANCEL = const(1)
_STATES_KEPT = const(10)  # upstream keeps 1; who comes while a goal changes its state would miss some
_REJECTED = const(1)
_UNKNOWN = const(2)
_TERMINATED = const(3)

_STATES = ("unknown", "accepted", "executing", "canceling", "succeeded", "canceled", "aborted")
_EVENTS = ("execute", "be canceling", "succeed", "abort", "be canceled")


def make_server(
    made: "ActionServer",
    node: "Node",
    kind: "Any",
    functions: "tuple[Any, Any, Any, Any]",
    limits: "tuple[int, int, float]",
    clock: "Callable[[], tuple[int, int]] | None",
    types: "Any" = None,
    memory: "Rules | None" = None,
) -> None:
    """Makes what a server needs.

    ``functions`` are on_execute, on_goal, on_cancel and on_accepted, ``limits`` goals, results and result_timeout,
    ``types`` CancelGoal, GoalStatusArray and GoalStatus, None for those of a board, ``memory`` rules for goals.
    """
    made.on_execute, made.on_goal, made.on_cancel, made.on_accepted = functions
    made.capacity, made.keep = limits[0], limits[1]
    made.expiry = int(limits[2] * 1000)
    made.clock = clock or (lambda: (made.context.clock() // 1000, 0))
    cancel_kind, array_kind, made.entry_kind = types or _types()
    made.kind, made.cancel_kind = kind, cancel_kind
    made.array = array_kind()
    made.message = kind.FeedbackMessage()
    before = len(node.entities)
    base = made.name + "/_action/"
    try:
        services = [
            node.service(kind.SendGoal, base + "send_goal", made.take_goal, memory=memory),
            node.service(cancel_kind, base + "cancel_goal", made.take_cancel),
            node.service(kind.GetResult, base + "get_result", made.take_result),
        ]
        made.feedback = node.publisher(kind.FeedbackMessage, base + "feedback")
        made.status = node.publisher(array_kind, base + "status", Qos(True, _STATES_KEPT, "transient_local"))
        for service in services:
            service.depth = max(service.depth, made.capacity)
        made.parts = services
    finally:
        _gather(made, node, before)


def make_client(
    made: "ActionClient",
    node: "Node",
    kind: "Any",
    capacity: int,
    types: "Any" = None,
    memory: "Rules | None" = None,
) -> None:
    """Makes what a client needs; ``types`` as for servers, ``memory`` rules for what servers say."""
    cancel_kind, array_kind, _ = types or _types()
    made.kind, made.cancel_kind, made.capacity = kind, cancel_kind, capacity
    takes = (cancel_kind.Response, kind.GetResult.Response, kind.FeedbackMessage, array_kind)
    before = len(node.entities)
    base = made.name + "/_action/"
    try:
        cancels, results, feedback, states = bounds(memory, "action client %r" % made.name, takes)
        made.parts = [
            node.client(kind.SendGoal, base + "send_goal"),
            node.client(cancel_kind, base + "cancel_goal", memory=cancels),
            node.client(kind.GetResult, base + "get_result", memory=results),
            node.subscription(kind.FeedbackMessage, base + "feedback", made.take_feedback, memory=feedback),
            node.subscription(
                array_kind,
                base + "status",
                made.take_states,
                Qos(True, _STATES_KEPT, "transient_local"),
                states,
            ),
        ]
    finally:
        _gather(made, node, before)


def bounds(memory: "Rules | None", what: str, kinds: "tuple[Any, ...]") -> "list[Rules | None]":
    """The rules for each of the types that ``what`` takes. RulesError for a rule that is for none of them."""
    if memory is None:
        return [None] * len(kinds)
    made: "list[Rules | None]" = borrow("muros.rclc.memory_plan").divide(memory, what, kinds)
    return made


def _gather(made: "Any", node: "Node", before: int) -> None:
    """Puts what a node has made since into one handle; takes it away if that is not all."""
    made.entities = node.entities[before:]
    del node.entities[before:]
    for entity in made.entities:
        if entity in made.context.handles:
            made.context.handles.remove(entity)
    if made.parts:
        node.entities.append(made)
    else:
        destroy(made)


def _types() -> "tuple[Any, Any, Any]":
    messages = __import__("action_msgs.msg", None, None, ("GoalStatusArray",))
    services = __import__("action_msgs.srv", None, None, ("CancelGoal",))
    return services.CancelGoal, messages.GoalStatusArray, messages.GoalStatus


def destroy(made: "Any") -> None:
    """Takes a server or client away; a second time does nothing."""
    handles = made.handles or made.context.handles
    if made in handles:
        handles.remove(made)
    made.parts = []
    for entity in made.entities:
        entity.destroy()
    made.entities = []
    made.goals.clear()
    for name in ("_running", "_starting"):
        if hasattr(made, name):
            for running in getattr(made, name):
                if isinstance(running, list):
                    running[1].close()
            getattr(made, name).clear()


def cancel(server: "ActionServer", request: "Any") -> "Any":
    """Answers a request to cancel: one goal, all up to a time, both, or all."""
    wanted = bytes(request.goal_info.goal_id.uuid)
    stamp = (request.goal_info.stamp.sec, request.goal_info.stamp.nanosec)
    named, timed = wanted != bytes(16), stamp != (0, 0)
    response = server.cancel_kind.Response()
    chosen = []
    if named and not timed:
        goal = server.find(wanted)
        if goal is None:
            response.return_code = _UNKNOWN
        elif _may_cancel(goal):
            chosen.append(goal)
        else:
            response.return_code = _TERMINATED
    else:
        for goal in server.goals:
            at = goal.entry.goal_info.stamp
            if _may_cancel(goal) and (not timed or (at.sec, at.nanosec) <= stamp or goal.id == wanted):
                chosen.append(goal)
    agreed = []
    failure = None
    for goal in chosen:
        try:
            if server.on_cancel is not None and server.on_cancel(goal) and _may_cancel(goal):
                goal.update(_CANCEL)
                agreed.append(goal.entry.goal_info)
        except Exception as error:
            failure = error
    response.goals_canceling = agreed
    if chosen and not agreed:
        response.return_code = _REJECTED
    if failure is not None:
        server.parts[1].reply(server.parts[1].identity, response)
        raise failure
    return response


def _may_cancel(goal: "Goal") -> bool:
    return goal.status in (1, 2)


def refuse(goal: "Goal", event: int) -> None:
    """Raises GoalError for an event that does not fit."""
    from muros.rclc.goal_error import GoalError

    raise GoalError(
        "goal %s of action %r is %s: it cannot %s"
        % (short(goal.id), goal.server.name, _STATES[goal.status], _EVENTS[event])
    )


def ended(goal: "Goal") -> None:
    """Raises GoalError for feedback that comes too late."""
    from muros.rclc.goal_error import GoalError

    error = GoalError(
        "goal %s of action %r has ended (%s): it gives no feedback any more"
        % (short(goal.id), goal.server.name, _STATES[goal.status])
    )
    error.code = _HANDLE_INVALID
    raise error


def full(client: "ActionClient") -> None:
    """Raises CapacityError."""
    from muros.rclc.errors import CapacityError

    raise CapacityError(
        "action client %r is full: %d goals of %d are on their way. Make it with goals=%d."
        % (client.name, client.capacity, client.capacity, client.capacity + 1)
    )


def tell_full(server: "ActionServer") -> None:
    """Tells the 1st, 2nd, 4th, 8th... time that a goal was refused because there are as many as may be."""
    if server.refused & (server.refused - 1) == 0:
        tell = server.context.middleware.on_problem
        if tell is not None:
            tell(FULL, full_text(server))


def full_text(server: "ActionServer") -> str:
    """Why a goal was refused."""
    return "action %r refused a goal: %d of %d are active. Make it with goals=%d." % (
        server.name,
        server.capacity,
        server.capacity,
        server.capacity + 1,
    )


def short(identity: bytes) -> str:
    """The beginning of an id, for people."""
    return "".join(["%02x" % byte for byte in identity[:4]])


def new_id(middleware: "Any" = None) -> bytes:
    """The id of a new goal: 16 random bytes, marked as a UUID of that kind (RFC 9562, 5.4).

    Where a board has no source of chance but its clock, the key of its session and the number of the request tell
    goals apart.
    """
    made = bytearray(pack("<4I", draw(), draw(), draw(), draw()))
    own = getattr(middleware, "notes", {}).get("key", b"") + bytes((getattr(middleware, "request", 0) & 255,))
    for i in range(len(own)):
        made[i] ^= own[i]
    made[6] = made[6] & 0x0F | 0x40
    made[8] = made[8] & 0x3F | 0x80
    return bytes(made)


def call(self: "ActionClient", goal: "Any", timeout: float, on_feedback: "Any") -> "SentGoal | None":
    """Sends a goal and waits for its end; arguments as for ``ActionClient.call``."""
    middleware = self.context.middleware
    end = ticks_add(self.context.clock(), int(timeout * 1000))
    over: "list[Any]" = []
    made: "SentGoal | None" = None
    while not over:
        now = self.context.clock()
        left = ticks_diff(end, now)
        if left <= 0:
            break
        middleware.spin_once(now)
        if made is None and self.parts[0].entity.room():
            made = self.send_goal(
                goal,
                lambda sent, accepted: None if accepted else over.append(sent),
                on_feedback,
                lambda sent, result: over.append(sent),
                timeout,
            )
        if self.ready(now):
            self.run(now)
        else:
            middleware.wait(min(left, self.left(now), middleware.deadline(now)))
    return None if made is None or made.accepted is None else made
