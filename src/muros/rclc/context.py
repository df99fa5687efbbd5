"""The context: one way into the ROS graph, and the nodes on it."""

from muros.compat import const, ticks_ms

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc._types import Middleware
    from muros.rclc.executor import Handle
    from muros.rclc.node import Node

STATES = ("WAITING", "CONNECTING", "CONNECTED", "LOST")


class Context:
    """A way into the ROS graph: a transport to an agent, or a session of your own making.

    ``Context(Udp("192.168.1.10"))``, ``Context(Session(Udp("192.168.1.10"), queue=8))``. ``client_key`` is for a
    session that is made here; a random one if it is None. On hosts ``muros.rclc.Context`` is a subclass, see ``hosts``.
    """

    def __init__(self, way: "Any", client_key: "int | bytes | None" = None, domain_id: int = 0) -> None:
        if not hasattr(way, "participant"):
            from muros.client.session import Session

            way = Session(way, client_key)
        self.middleware: "Middleware" = way
        self.domain_id = domain_id
        self.handles: "list[Handle]" = []  # what no executor has claimed, in the order of making
        self.running = True
        self.clock: "Callable[[], int]" = ticks_ms  # what timers and executors go by

    def node(self, name: str, namespace: str = "") -> "Node":
        """A node. Raises InvalidNameError."""
        from muros.rclc.node import Node

        return Node(self, name, namespace)

    @property
    def state(self) -> str:
        """WAITING, CONNECTING, CONNECTED or LOST."""
        return STATES[self.middleware.state]

    def on_state(self, callback: "Callable[[str], object]") -> None:
        """Calls ``callback(state)`` at each change."""
        self.middleware.on_state = lambda state: callback(STATES[state])

    def on_problem(self, callback: "Callable[[int, str], object]") -> None:
        """Calls ``callback(code, text)`` when something was dropped or refused, or no agent is reached.

        Without it hosts print the text on standard error.
        """
        self.middleware.on_problem = callback

    def ping(self, timeout: float = 1.0) -> bool:
        """Whether the agent answers within ``timeout`` seconds and knows us; messages wait meanwhile."""
        return self.middleware.ping(int(timeout * 1000), self.clock)

    def close(self) -> None:
        """Takes leave of the graph; executors end."""
        self.running = False
        self.middleware.close()
