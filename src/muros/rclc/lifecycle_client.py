"""Moving other managed nodes.

camera = LifecycleClient(node, "/lab/camera")
camera.change("configure", timeout=2.0)        # True, False where it was refused or failed, None without an answer
camera.change("activate", on_done=print)       # in an executor
"""

from muros.compat import borrow, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.client import Client
    from muros.rclc.context import Node
    from muros.rclc.subscription import Subscription

    OnDone = Callable[[Any], object]

_M = "muros.rclc.lifecycle_states"
_TIMEOUT = const(10)  # seconds
_CHANGE = const(0)
_STATE = const(1)
_STATES = const(2)
_TRANSITIONS = const(3)
_GRAPH = const(4)


class LifecycleClient:
    """Asks the managed node ``name`` (relative to the namespace of ``node``) what it can do, and has it do that.

    Each question waits for its answer, None when it does not come within ``timeout`` seconds; with ``on_done`` it
    returns whether the request was taken, and an executor calls ``on_done(answer)``. As with ``Client.call``, who
    waits must be neither in a callback nor in the context of the node that is asked.
    """

    def __init__(self, node: "Node", name: str) -> None:
        self.node = node
        self.name = name
        self._clients: "dict[int, Client]" = {}

    def change(
        self, transition: "int | str", timeout: float = _TIMEOUT, on_done: "OnDone | None" = None
    ) -> "Any":
        """Goes through a transition, by its label or number; whether it succeeded."""
        request = borrow(_M).find("srv", "ChangeState").Request()
        if not isinstance(transition, str):
            request.transition.id = transition
        elif transition != "shutdown":
            request.transition.label = transition
            request.transition.id = borrow(_M).number(transition)
        else:  # which has a number for each state, and there are nodes that know no labels
            request.transition.label = transition
            if on_done is None:
                state = self._ask(_STATE, None, timeout, None, _current)
                if state is None:
                    return None
                request.transition.id = borrow(_M).number(transition, state[0])
            else:
                done = on_done

                def then(state: "Any") -> None:
                    if state is not None:
                        request.transition.id = borrow(_M).number(transition, state[0])
                    if state is None or not self._ask(_CHANGE, request, timeout, done, _success):
                        done(None)

                return self._ask(_STATE, None, timeout, then, _current)
        return self._ask(_CHANGE, request, timeout, on_done, _success)

    def state(self, timeout: float = _TIMEOUT, on_done: "OnDone | None" = None) -> "Any":
        """The label of its state."""
        return self._ask(_STATE, None, timeout, on_done, _state)

    def states(self, timeout: float = _TIMEOUT, on_done: "OnDone | None" = None) -> "Any":
        """All states that it has: their numbers and labels."""
        return self._ask(_STATES, None, timeout, on_done, _states)

    def transitions(
        self, timeout: float = _TIMEOUT, on_done: "OnDone | None" = None, everything: bool = False
    ) -> "Any":
        """The transitions that its state has, or with ``everything`` all: (number, label, start, goal)."""
        return self._ask(_GRAPH if everything else _TRANSITIONS, None, timeout, on_done, _transitions)

    def on_event(self, callback: "Callable[[str, str], object]") -> "Subscription":
        """Has an executor call ``callback(start, goal)`` with the labels of the states, at each step."""
        return self.node.subscription(
            borrow(_M).find("msg", "TransitionEvent"),
            self.name + "/transition_event",
            lambda event: callback(event.start_state.label, event.goal_state.label),
        )

    def destroy(self) -> None:
        """Takes its clients away."""
        for which in self._clients:
            self.node.entities.remove(self._clients[which])
            self._clients[which].destroy()
        self._clients = {}

    def _ask(
        self, which: int, request: "Any", timeout: float, on_done: "OnDone | None", pick: "OnDone"
    ) -> "Any":
        """Asks a service, and picks the answer out of the response."""
        name, kind = borrow(_M).SERVICES[which]
        found = borrow(_M).find("srv", kind)
        client = self._clients.get(which)
        if client is None:
            client = self._clients[which] = self.node.client(found, self.name + "/" + name)
        if request is None:
            request = found.Request()
        if on_done is None:
            response = client.call(request, timeout)
            return None if response is None else pick(response)
        done = on_done
        return client.send(
            request, lambda response: done(None if response is None else pick(response)), timeout
        )


def _success(response: "Any") -> "Any":
    return response.success


def _current(response: "Any") -> "Any":
    return (response.current_state.id, response.current_state.label)


def _state(response: "Any") -> "Any":
    return response.current_state.label


def _states(response: "Any") -> "Any":
    return [(state.id, state.label) for state in response.available_states]


def _transitions(response: "Any") -> "Any":
    return [
        (found.transition.id, found.transition.label, found.start_state.label, found.goal_state.label)
        for found in response.available_transitions
    ]
