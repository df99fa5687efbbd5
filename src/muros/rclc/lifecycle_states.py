"""What a managed node's states and transitions are, and how its services tell them. Boards borrow this."""

from muros.compat import MPY, borrow, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.rclc.lifecycle import Lifecycle

STATES = (
    (0, "unknown"),
    (1, "unconfigured"),
    (2, "inactive"),
    (3, "active"),
    (4, "finalized"),
    (10, "configuring"),
    (11, "cleaningup"),
    (12, "shuttingdown"),
    (13, "activating"),
    (14, "deactivating"),
    (15, "errorprocessing"),
)
"""Numbers and labels, in the order in which ROS 2 tells them."""

TRANSITIONS = (
    (1, "configure", 1, 10),
    (10, "transition_success", 10, 2),
    (11, "transition_failure", 10, 1),
    (12, "transition_error", 10, 15),
    (2, "cleanup", 2, 11),
    (20, "transition_success", 11, 1),
    (21, "transition_failure", 11, 2),
    (22, "transition_error", 11, 15),
    (3, "activate", 2, 13),
    (30, "transition_success", 13, 3),
    (31, "transition_failure", 13, 2),
    (32, "transition_error", 13, 15),
    (4, "deactivate", 3, 14),
    (40, "transition_success", 14, 2),
    (41, "transition_failure", 14, 3),
    (42, "transition_error", 14, 15),
    (5, "shutdown", 1, 12),
    (6, "shutdown", 2, 12),
    (7, "shutdown", 3, 12),
    (50, "transition_success", 12, 4),
    (51, "transition_failure", 12, 4),
    (52, "transition_error", 12, 15),
    (60, "transition_success", 15, 1),
    (61, "transition_failure", 15, 4),
    (62, "transition_error", 15, 4),
)
"""Number, label, start and goal."""

SERVICES = (
    ("change_state", "ChangeState"),
    ("get_state", "GetState"),
    ("get_available_states", "GetAvailableStates"),
    ("get_available_transitions", "GetAvailableTransitions"),
    ("get_transition_graph", "GetAvailableTransitions"),
)

_PRIMARY = const(4)  # the last of the primary states


def find(kind: str, name: str) -> "Any":
    """A class of lifecycle_msgs: that of muros, also where a ROS installation has another."""
    if MPY:
        module = "lifecycle_msgs." + kind
        return getattr(__import__(module, None, None, (name,)), name)
    types = borrow("muros.interfaces")
    full = "lifecycle_msgs/%s/%s" % (kind, name)
    return types.message(full) if kind == "msg" else types.service(full)


def label(state: int) -> str:
    """What a state is called."""
    for number, name in STATES:
        if number == state:
            return name
    return STATES[0][1]


def number(transition: str, state: int = -1) -> int:
    """The number of the transition of that label, from that state if several have it; 0 if there is none."""
    for row in TRANSITIONS:
        if row[1] == transition and (state < 0 or row[2] == state):
            return row[0]
    return 0


def legal(state: int, transition: "int | str") -> "tuple[int, str, int, int] | None":
    """The transition of that label or number that leads from a primary state."""
    if state <= _PRIMARY:
        for row in TRANSITIONS:
            if row[2] == state and (row[1] == transition or row[0] == transition):
                return row
    return None


def answer(self: "Lifecycle", which: int, request: "Any") -> "Any":
    """The answer to a request of the service of that place in ``SERVICES``."""
    response = find("srv", SERVICES[which][1]).Response()
    if which == 0:
        # Whoever names a label does not know the number; one who names none means the number.
        wanted = request.transition.label or request.transition.id
        response.success = borrow("muros.rclc.lifecycles").obey(self, wanted)
    elif which == 1:
        response.current_state.id = self.id
        response.current_state.label = label(self.id)
    elif which == 2:
        kind = find("msg", "State")
        response.available_states = [kind(id=number, label=name) for number, name in STATES]
    else:
        response.available_transitions = [
            _described(row) for row in TRANSITIONS if which == 4 or row[2] == self.id
        ]
    return response


def fill(state: "Any", number: int) -> None:
    """Makes a message tell a state."""
    state.id = number
    state.label = label(number)


def _described(row: "tuple[int, str, int, int]") -> "Any":
    """A transition as the services tell it."""
    made = find("msg", "TransitionDescription")()
    made.transition.id = row[0]
    made.transition.label = row[1]
    fill(made.start_state, row[2])
    fill(made.goal_state, row[3])
    return made
