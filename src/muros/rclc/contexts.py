"""The methods of contexts. Boards borrow this."""

from muros.compat import borrow, const, ticks_ms

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Context, Node

STATES = ("WAITING", "CONNECTING", "CONNECTED", "LOST")


def begin_with(self: "Context", way: "Any", client_key: "int | bytes | None", domain_id: int) -> None:
    """Sets up a context; arguments as for ``Context``."""
    if not hasattr(way, "spin_once"):
        from muros.client.session import Session

        way = Session(way, client_key)
    self.middleware = way
    self.domain_id = domain_id
    self.handles = []
    self.running = True
    self.clock = ticks_ms


def node(self: "Context", name: str, namespace: str = "") -> "Node":
    """A node. Raises InvalidNameError."""
    from muros.rclc.context import Node

    made = Node()
    borrow("muros.rclc.node").begin_in(made, self, name, namespace)
    return made


def on_state(self: "Context", callback: "Callable[[str], object]") -> None:
    """Calls ``callback(state)`` at each change."""
    self.middleware.on_state = lambda state: callback(STATES[state])


def on_problem(self: "Context", callback: "Callable[[int, str], object]") -> None:
    """Calls ``callback(code, text)`` when something was dropped or refused, or no agent is reached.

    Without it hosts print the text on standard error.
    """
    self.middleware.on_problem = callback


def ping(self: "Context", timeout: float = 1.0) -> bool:
    """Whether the agent answers within ``timeout`` seconds and knows us; messages wait meanwhile."""
    return self.middleware.ping(int(timeout * 1000), self.clock)


def close(self: "Context") -> None:
    """Takes leave of the graph; executors end."""
    self.running = False
    self.middleware.close()
