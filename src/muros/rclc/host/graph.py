"""The graph on hosts: what a node sees of all others, as values, and waiting for them.

    node.graph.nodes()                                  # ["/greenhouse/thermometer", ...]
    node.graph.topics()                                 # {"/chatter": ["std_msgs/msg/String"], ...}
    node.graph.publishers("chatter")                    # [Endpoint(node="/talker", ...)]
    node.graph.wait_for_node("/talker", timeout=5.0)
    node.graph.on_change(lambda graph: print(graph.nodes()))

Straight in a data space the graph is the space's own. Through an agent it is what that tells: the agent of muros all of
it, see ``agent_graph``, that of micro-ROS what it publishes, see ``graph``, without QoS, hashes and gids; it is empty
where an agent tells nothing. Names given are relative to the node.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Final, Protocol

from muros.rclc import graph as topic
from muros.rclc import handles
from muros.rclc.executor import Handle
from muros.rclc.host import agent_graph
from muros.rclc.host.endpoints import CLIENT, KINDS, PUBLISHER, SERVER, SUBSCRIPTION, Endpoint
from muros.rclc.host.handles import tell_problem
from muros.rclc.host.waiting import spin_until

if TYPE_CHECKING:
    from muros.rclc.context import Context
    from muros.rclc.host.context import Node
    from muros.xrce._types import Buffer

__all__ = [
    "CLIENT",
    "KINDS",
    "PUBLISHER",
    "SERVER",
    "SUBSCRIPTION",
    "AgentGraph",
    "Endpoint",
    "Graph",
    "GraphSource",
    "GraphWatch",
]

NO_GRAPH: Final = 55
"""The code with which ``on_problem`` is told that a wait was in vain because an agent publishes no graph."""


class GraphSource(Protocol):
    """Where a graph comes from."""

    @property
    def changes(self) -> int:
        """Counts changes."""

    @property
    def known(self) -> bool:
        """Whether anything is known at all."""

    def read(self) -> tuple[list[str], list[Endpoint]]:
        """The full names of all nodes, and all that they made."""

    def close(self) -> None:
        """Watches no more."""


class Graph:
    """Made by ``Node.graph``; what others see of this node is in it too."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._watches: list[GraphWatch] = []
        self._read: tuple[list[str], list[Endpoint]] = ([], [])
        self._fresh = -1
        self._told = False
        sharing = node.context.sharing  # what comes is for no handle: whichever thread takes it
        middleware: Any = node.context.middleware if sharing is None else sharing.real
        self._source: GraphSource
        if hasattr(middleware, "graph_source"):
            self._source = middleware.graph_source(node.participant, self._changed)
        else:
            self._source = AgentGraph(middleware, node.participant, self._changed)
        node.entities.append(self)

    @property
    def known(self) -> bool:
        """Whether there is a graph to ask: through an agent, once it has told one."""
        return self._source.known

    @property
    def changes(self) -> int:
        """Counts the changes that were seen."""
        return self._source.changes

    def nodes(self) -> list[str]:
        """The full names of all nodes, sorted; a name that several have is there several times."""
        return sorted(self._nodes())

    def topics(self) -> dict[str, list[str]]:
        """All topics that somebody publishes or hears, by name, with their types."""
        return _types(self._of(PUBLISHER) + self._of(SUBSCRIPTION))

    def services(self) -> dict[str, list[str]]:
        """All services that somebody serves or calls, by name, with their types."""
        return _types(self._of(SERVER) + self._of(CLIENT))

    def publishers(self, name: str | None = None, *, node: str | None = None) -> list[Endpoint]:
        """The publishers of a topic, or of a node, or all."""
        return self._of(PUBLISHER, name and self._node.resolve_topic(name), node)

    def subscriptions(self, name: str | None = None, *, node: str | None = None) -> list[Endpoint]:
        """The subscriptions of a topic, or of a node, or all."""
        return self._of(SUBSCRIPTION, name and self._node.resolve_topic(name), node)

    def servers(self, name: str | None = None, *, node: str | None = None) -> list[Endpoint]:
        """Who serves a service, or all that a node serves, or all."""
        return self._of(SERVER, name and self._node.resolve_service(name), node)

    def clients(self, name: str | None = None, *, node: str | None = None) -> list[Endpoint]:
        """Who calls a service, or all that a node calls, or all."""
        return self._of(CLIENT, name and self._node.resolve_service(name), node)

    def wait(self, condition: Callable[[Graph], object], timeout: float | None = None) -> bool:
        """Waits until ``condition(graph)`` is true, at most ``timeout`` seconds (None: for ever); whether it is.

        The context takes messages meanwhile and no callback runs. Not for callbacks: those have ``on_change``.
        """
        seen = -1
        holds = False

        def look() -> bool:
            nonlocal seen, holds
            if seen != self.changes:
                seen = self.changes
                holds = bool(condition(self))
            return holds

        return self.spin_until(look, timeout)

    def spin_until(self, condition: Callable[[], object], timeout: float | None = None) -> bool:
        """Waits until ``condition()`` is true, which is asked whenever anything has come; else as ``wait``."""
        holds = spin_until(self._node.context, condition, timeout)
        if not holds and not self.known and not self._told and self._node.context.state == "CONNECTED":
            self._told = True
            tell_problem(
                self._node.context,
                NO_GRAPH,
                "the agent has told no graph, so nobody is seen: that of micro-ROS and that of muros do, a plain "
                "DDS-XRCE agent does not. Or the graph is longer than the session's largest: raise it",
            )
        return holds

    def wait_for_node(self, name: str, timeout: float | None = None) -> bool:
        """Waits until there is a node of that full name, or of that name in this node's namespace."""
        full = self._node_name(name)
        return self.wait(lambda graph: full in graph._nodes(), timeout)

    def wait_for_publishers(self, name: str, count: int = 1, timeout: float | None = None) -> bool:
        """Waits until a topic has so many publishers."""
        return self.wait(lambda graph: len(graph.publishers(name)) >= count, timeout)

    def wait_for_subscriptions(self, name: str, count: int = 1, timeout: float | None = None) -> bool:
        """Waits until a topic has so many subscriptions."""
        return self.wait(lambda graph: len(graph.subscriptions(name)) >= count, timeout)

    def wait_for_service(self, name: str, timeout: float | None = None) -> bool:
        """Waits until somebody serves a service. ``Client.wait_for_service`` waits until it can be called as well."""
        return self.wait(lambda graph: graph.servers(name), timeout)

    def on_change(self, callback: Callable[[Graph], object]) -> GraphWatch:
        """Has an executor call ``callback(graph)`` now and after changes, several of them at once perhaps.

        The handle that it returns ends that with ``destroy()``.
        """
        made = GraphWatch(self._node.context, self, callback)
        self._watches.append(made)
        return made

    def destroy(self) -> None:
        """Watches no more; done with the node."""
        for watch in list(self._watches):
            watch.destroy()
        self._source.close()

    def _changed(self) -> None:
        """The source has changed; any thread may say so."""
        for watch in self._watches:
            watch.changed = True

    def _look(self) -> tuple[list[str], list[Endpoint]]:
        changes = self._source.changes
        if self._fresh != changes:
            self._read = self._source.read()
            self._fresh = changes
        return self._read

    def _nodes(self) -> list[str]:
        return self._look()[0]

    def _of(self, kind: str, name: str | None = None, node: str | None = None) -> list[Endpoint]:
        full = node and self._node_name(node)
        return [
            endpoint
            for endpoint in self._look()[1]
            if endpoint.kind == kind
            and (name is None or endpoint.name == name)
            and (full is None or endpoint.node == full)
        ]

    def _node_name(self, name: str) -> str:
        return name if name.startswith("/") else f"{self._node.namespace.rstrip('/')}/{name}"


class GraphWatch(Handle):
    """Made by ``Graph.on_change``."""

    def __init__(self, context: Context, graph: Graph, callback: Callable[[Graph], object]) -> None:
        super().__init__(context)
        self.callback = callback
        self.changed = graph.known
        self._graph = graph

    def ready(self, now: int) -> bool:
        """Whether the graph has changed."""
        return self._graph.changes >= 0 and self.changed  # looking for changes is what finds them

    def run(self, now: int) -> None:
        """Calls the callback."""
        self.changed = False
        self.callback(self._graph)

    def destroy(self) -> None:
        """Watches no more."""
        if self in self._graph._watches:
            self._graph._watches.remove(self)
        handles.destroy(self)


class AgentGraph:
    """The graph that an agent tells, taken by a session: what is published for all, until more is told to us alone.

    It is known when our readers stand: who has waited for it may publish at once, their making fills no window then.
    """

    def __init__(self, session: Any, participant: Any, on_change: Callable[[], object]) -> None:
        self.malformed = 0
        self._on_change = on_change
        self._told: int | None = None  # with which creation of our reader all of it was told
        self._news: tuple[list[str], list[Endpoint]] | None = None
        self._graph: tuple[list[str], list[Endpoint]] = ([], [])
        self._changes = 0
        self._readers = [
            session.reader(participant, topic.TOPIC, topic.TYPE, topic.QOS, self._take),
            session.reader(participant, agent_graph.TOPIC, agent_graph.TYPE, "default", self._take_whole),
        ]

    @property
    def changes(self) -> int:
        """Counts changes."""
        if self._news is not None and not any(reader.todo and not reader.status for reader in self._readers):
            news, self._news = self._news, None
            if not self._changes or news != self._graph:
                self._graph = news
                self._changes += 1
                self._on_change()
        return self._changes

    @property
    def known(self) -> bool:
        """Whether anything was told."""
        return self.changes > 0

    def read(self) -> tuple[list[str], list[Endpoint]]:
        """What was told last."""
        return self._graph

    def close(self) -> None:
        """Listens no more."""
        for reader in self._readers:
            reader.destroy()

    def _take_whole(self, buf: Buffer, off: int, n: int) -> None:
        try:
            self._news = agent_graph.read_untrusted(bytes(memoryview(buf)[off : off + n]))
        except ValueError:
            self.malformed += 1
        else:
            self._told = self._readers[1].request

    def _take(self, buf: Buffer, off: int, n: int) -> None:
        if self._told == self._readers[1].request:
            return  # and not by an agent before this one, of another kind
        nodes: list[str] = []
        endpoints: list[Endpoint] = []

        def visit(node: str, kind: int, name: str, types: list[str]) -> None:
            if kind == topic.NODE:
                nodes.append(node)
            elif kind < len(KINDS):
                endpoints.extend(Endpoint(KINDS[kind], name, one, node) for one in types or [""])

        try:
            topic.read_untrusted(buf, off, n, visit)
        except ValueError:
            self.malformed += 1
        else:
            self._news = nodes, endpoints


def _types(endpoints: Iterable[Endpoint]) -> dict[str, list[str]]:
    """Types by name, both sorted."""
    found: dict[str, set[str]] = {}
    for endpoint in endpoints:
        found.setdefault(endpoint.name, set()).add(endpoint.type)
    return {name: sorted(found[name]) for name in sorted(found)}
