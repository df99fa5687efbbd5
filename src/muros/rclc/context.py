"""The context and its nodes: one way into the ROS graph, and what is made on it.

Their methods are called when a program begins and ends: boards borrow them, from ``contexts`` and ``node``.
"""

from muros.compat import borrow, const, lending

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc import compositions, contexts, node
    from muros.rclc._types import Entity, Middleware
    from muros.rclc.executor import Handle


class Context:
    """A way into the ROS graph: a transport to an agent, or a session of your own making.

    ``Context(Udp("192.168.1.10"))``, ``Context(Session(Udp("192.168.1.10"), queue=8))``. ``client_key`` is for a
    session that is made here; a random one if it is None. On hosts ``muros.rclc.Context`` is a subclass, see
    ``host.context``.
    """

    if TYPE_CHECKING:
        middleware: "Middleware"
        domain_id: int
        handles: "list[Handle]"  # what no executor has claimed, in the order of making
        running: bool
        clock: "Callable[[], int]"  # what timers and executors go by

        begin_with = contexts.begin_with
        node = contexts.node
        on_state = contexts.on_state
        on_problem = contexts.on_problem
        ping = contexts.ping
        close = contexts.close
    else:
        lends = "muros.rclc.contexts"
        __getattr__ = lending

    def __init__(self, way: "Any", client_key: "int | bytes | None" = None, domain_id: int = 0) -> None:
        self.begin_with(way, client_key, domain_id)

    @property
    def state(self) -> str:
        """WAITING, CONNECTING, CONNECTED or LOST."""
        name: str = borrow("muros.rclc.contexts").STATES[self.middleware.state]
        return name


class Node:
    """A node of a context. Topics and services are named relative to ``namespace`` unless they begin with a slash.

    Message types are generated classes, ``Int32`` or ``AddTwoInts``. ``qos`` is a profile's name or a ``Qos``.
    What is made here raises InvalidNameError for names that ROS does not take, ValueError for those too long.
    """

    if TYPE_CHECKING:
        context: Context
        name: str
        namespace: str
        entities: "list[Entity]"
        participant: "Any"

        publisher = node.publisher
        subscription = node.subscription
        timer = node.timer
        service = node.service
        client = node.client
        action_server = compositions.action_server
        action_client = compositions.action_client
        parameters = compositions.parameters
        lifecycle = compositions.lifecycle
        logger = compositions.logger
        destroy = node.destroy
        _topic = node._topic
        _resolve = node._resolve
    else:
        lends = "muros.rclc.node"
        __getattr__ = lending
