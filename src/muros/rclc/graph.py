"""The graph as agents tell it to their clients: who is there, what they publish, hear, serve and call.

An agent publishes the whole graph on the topic ``ros_to_microros_graph`` whenever it changes, as the agent of micro-ROS
does: reliable, the last sample kept for those who come later. A sample is a micro_ros_msgs/msg/Graph: for each node its
namespace, its name and its entities; for each entity what it is, its name and its types. Boards load this when they
use it; hosts have more, see ``host.graph``.
"""

from muros.cdr_texts import count, part, text
from muros.compat import const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.client import Client
    from muros.xrce._types import Buffer

TOPIC = "ros_to_microros_graph"
TYPE = "micro_ros_msgs/msg/Graph"
QOS = "status"  # reliable, transient local, keep last 1

# What an entity is; a node is told of before its entities, as none of them
NODE = const(-1)
PUBLISHER = const(0)
SUBSCRIPTION = const(1)
SERVER = const(2)
CLIENT = const(3)

_SERVER = const(2)
_NODE = const(-1)
_TIMEOUT = const(10)  # seconds
_LEAST_NODE = const(12)  # bytes
_LEAST_ENTITY = const(9)


def read_untrusted(
    buf: "Buffer", off: int, n: int, visit: "Callable[[str, int, str, list[str]], object]"
) -> None:
    """Calls ``visit(node, kind, name, types)`` for each node and each of its entities. ValueError for no Graph.

    ``node`` is a full name. What stands before the fault of a malformed sample is visited.
    """
    at: "list[Any]" = [buf, off, off + n, off]
    for _ in range(count(at, _LEAST_NODE)):
        node = text(at)
        node += ("" if node[-1:] == "/" else "/") + text(at)
        visit(node, _NODE, "", [])
        for _ in range(count(at, _LEAST_ENTITY)):
            kind = buf[part(at, 1, 1)]
            name = text(at)
            visit(node, kind, name, [text(at) for _ in range(count(at, 4))])


def wait_for_service(client: "Client", timeout: float = _TIMEOUT) -> bool:
    """Waits until somebody serves what ``client`` asks, at most ``timeout`` seconds; whether somebody does.

    An agent that does not publish the graph lets it wait in vain, and so does a graph that is larger than the session's
    ``largest``.
    """
    context = client.context
    session = context.middleware
    found: "list[str]" = []

    def visit(node: str, kind: int, name: str, types: "list[str]") -> None:
        if kind == _SERVER and name == client.entity.name:
            found.append(node)

    def look(buf: "Buffer", off: int, n: int) -> None:
        found.clear()
        try:
            read_untrusted(buf, off, n, visit)
        except ValueError:
            pass  # no graph

    reader = session.reader(_Participant(client.entity.above), TOPIC, TYPE, QOS, look)
    end = ticks_add(context.clock(), int(timeout * 1000))
    while not found:
        now = context.clock()
        left = ticks_diff(end, now)
        if left <= 0 or not context.running:
            break
        session.spin_once(now)
        if not found:
            session.wait(min(left, session.deadline(now)))
    reader.destroy()
    return len(found) > 0


class _Participant:
    """Stands for the node of a client, of which only the index is known."""

    def __init__(self, index: int) -> None:
        self.id = index << 4 | 1
