"""The state machine of managed nodes, and its services. Boards borrow this; see ``lifecycle``.

Theory of operation. A transition leads from a primary state into one that is passed through (configuring,
activating, ...). There a callback is run, whose result picks the next transition: success, failure or error. An error
leads to errorprocessing, where ``on_error`` says whether the node is unconfigured again (success) or finalized. Each
step is an event on ``~/transition_event``. So the whole machine is one table, and walking it one function.
"""

from muros.compat import MPY, borrow, const
from muros.rclc.lifecycle_states import SERVICES, TRANSITIONS, fill, find, label, legal

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client.qos import Qos
    from muros.rclc.context import Node
    from muros.rclc.lifecycle import Callback, Lifecycle, ManagedPublisher

INACTIVE = const(13)
ILLEGAL = const(14)
RAISED = const(15)
"""The codes with which a managed node tells ``on_problem`` of messages held back, requests refused, and callbacks that
raised."""

_CALLBACKS = ("configure", "activate", "deactivate", "cleanup", "shutdown", "error")
_PLACES = {10: 0, 13: 1, 14: 2, 11: 3, 12: 4, 15: 5}  # of the callback that each passing state runs
_PRIMARY = const(4)  # the last of the primary states
_ERRORPROCESSING = const(15)
_SUCCESS = const(97)  # what callbacks may return, as in ROS 2
_FAILURE = const(98)
_ERROR = const(99)


def begin(
    self: "Node",
    callbacks: "tuple[Callback | None, ...]",
    services: bool,
    time: "Callable[[], tuple[int, int]] | None",
) -> "Lifecycle":
    """``Node.lifecycle``, with its callbacks in their order."""
    from muros.rclc.lifecycle import Lifecycle

    for entity in self.entities:
        if isinstance(entity, Lifecycle):
            from muros.rclc.errors import RclError

            raise RclError("node %s has a lifecycle already" % self.name)
    made = Lifecycle(self, callbacks, time)
    self.entities.append(made)
    try:
        made.events = self.publisher(find("msg", "TransitionEvent"), "~/transition_event")
        for which in range(len(SERVICES) if services else 0):
            name, kind = SERVICES[which]
            made.services.append(self.service(find("srv", kind), "~/" + name, made.asked(which)))
    except Exception:
        while self.entities[-1] is not made:
            self.entities.pop().destroy()
        self.entities.pop()
        raise
    return made


def change(self: "Lifecycle", transition: "int | str") -> bool:
    """Goes through a transition of the present state, given by its label or number.

    Returns whether the callback succeeded; where it did not, ``state`` tells what became of the node. Raises
    TransitionError where the state has no such transition, also while another one goes on.
    """
    row = legal(self.id, transition)
    if row is None:
        from muros.rclc.illegal import TransitionError

        raise TransitionError(_refusal(self, transition))
    _step(self, row)
    first = 0
    while self.id > _PRIMARY:
        result = _run(self)
        first = first or result
        # the three ways out of a state stand in the order of results
        _step(self, [row for row in TRANSITIONS if row[2] == self.id][result - _SUCCESS])
    return first == _SUCCESS


def obey(self: "Lifecycle", transition: "int | str") -> bool:
    """``change`` for those who ask by service: what is refused is told as a problem."""
    if legal(self.id, transition) is None:
        _tell(self, ILLEGAL, _refusal(self, transition))
        return False
    return change(self, transition)


def configure(self: "Lifecycle") -> bool:
    """From unconfigured to inactive. See ``change``."""
    return change(self, "configure")


def activate(self: "Lifecycle") -> bool:
    """From inactive to active."""
    return change(self, "activate")


def deactivate(self: "Lifecycle") -> bool:
    """From active to inactive."""
    return change(self, "deactivate")


def cleanup(self: "Lifecycle") -> bool:
    """From inactive to unconfigured."""
    return change(self, "cleanup")


def shutdown(self: "Lifecycle") -> bool:
    """From wherever the node is to finalized, for good."""
    return change(self, "shutdown")


def publisher(self: "Lifecycle", kind: "Any", topic: str, qos: "str | Qos" = "default") -> "ManagedPublisher":
    """A publisher that publishes only while the node is active; arguments as for ``Node.publisher``."""
    from muros.rclc.lifecycle import ManagedPublisher

    made = ManagedPublisher(self, self.node.publisher(kind, topic, qos), topic)
    self.publishers.append(made)
    return made


def tell_held(held: "ManagedPublisher") -> None:
    """Tells that a message is held back."""
    self = held.lifecycle
    _tell(
        self,
        INACTIVE,
        "a message on %s was not published: node %s is %s, not active"
        % (held.topic, self.node.name, label(self.id)),
    )


def _refusal(self: "Lifecycle", transition: "int | str") -> str:
    names = ", ".join([row[1] for row in TRANSITIONS if row[2] == self.id and self.id <= _PRIMARY])
    return "node %s is %s: there is no transition %r from here, %s" % (
        self.node.name,
        label(self.id),
        transition,
        "only " + names if names else "none at all",
    )


def _run(self: "Lifecycle") -> int:
    """Runs the callback of the transition that goes on: _SUCCESS, _FAILURE or _ERROR."""
    place = _PLACES[self.id]
    callback = self.callbacks[place]
    if callback is None:
        return _FAILURE if self.id == _ERRORPROCESSING else _SUCCESS
    try:
        result = callback()
    except Exception as error:
        self.error = error
        why = str(error)
        _tell(
            self,
            RAISED,
            "on_%s of node %s raised %s%s"
            % (_CALLBACKS[place], self.node.name, type(error).__name__, ": " + why if why else ""),
        )
        return _ERROR
    if result is False or result == _FAILURE:
        return _FAILURE
    return _ERROR if result == _ERROR else _SUCCESS


def _step(self: "Lifecycle", row: "tuple[int, str, int, int]") -> None:
    """Goes along a transition, and tells others."""
    self.id = row[3]
    for managed in self.publishers:
        managed.told = False
    event = find("msg", "TransitionEvent")()
    seconds, nanoseconds = self.time() if self.time is not None else (0, 0)
    if hasattr(event, "stamp"):
        event.stamp.sec = seconds
        event.stamp.nanosec = nanoseconds
    else:
        event.timestamp = seconds * 1000000000 + nanoseconds
    event.transition.id = row[0]
    event.transition.label = row[1]
    fill(event.start_state, row[2])
    fill(event.goal_state, row[3])
    if not self.events.publish(event):
        self.lost += 1


def _tell(self: "Lifecycle", code: int, said: str) -> None:
    """Tells a problem: to the program, or on hosts on standard error."""
    tell = self.node.context.middleware.on_problem
    if tell is not None:
        tell(code, said)
    elif not MPY:
        borrow("muros.client.reasons").say(said)
