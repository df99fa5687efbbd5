"""The graph for clients: published for those who ask for it, as the agent of micro-ROS publishes it.

A client that reads ``ros_to_microros_graph`` has the agent publish the graph of its domain there, whole, whenever it
changes: which nodes there are, what they publish and hear, serve and call, by their ROS names. A change is published a
little later, together with those that come with it. With the last reader that is gone.
"""

from typing import TYPE_CHECKING, Any, Final

from muros import interfaces
from muros.agent._calls import Call
from muros.agent._graph_proxy import GraphProxy, gather
from muros.agent._proxies import Proxy, ReaderProxy
from muros.space import Durability, GraphEvent, Qos, Reliability, Topic

if TYPE_CHECKING:
    from muros.agent._core import AgentCore

__all__ = ["GraphTopic"]

TOPIC: Final = Topic("ros_to_microros_graph", "micro_ros_msgs::msg::dds_::Graph_")
LONGEST_NAME: Final = 256
"""Characters that the type leaves for a name."""


class GraphTopic:
    """The publishers of graphs, one for each domain that somebody asks for."""

    def __init__(self, core: "AgentCore") -> None:
        self._core = core
        self._domains: dict[int, _Domain] = {}

    def made(self, proxy: Proxy) -> None:
        """A client has made something: it may be a reader of the graph."""
        if isinstance(proxy, GraphProxy):
            proxy.begin(self._core)
        if not isinstance(proxy, ReaderProxy) or proxy.topic != TOPIC:
            return
        assert proxy.parent is not None
        domain = proxy.parent.domain
        if domain not in self._domains:
            self._domains[domain] = _Domain(self._core, domain)
        self._domains[domain].readers.append(proxy)

    def gone(self, domain: int) -> None:
        """The last reader in a domain has gone."""
        del self._domains[domain]

    def close(self) -> None:
        """Publishes no more."""
        for domain in list(self._domains.values()):
            domain.close()


class _Domain:
    """Publishes the graph of a domain for as long as somebody reads it."""

    def __init__(self, core: "AgentCore", domain: int) -> None:
        self.readers: list[ReaderProxy] = []
        self._core = core
        self._domain = domain
        self._participant = core.space.participant("", domain=domain, owner="the graph topic")
        qos = Qos(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, depth=1)
        self._writer = self._participant.writer(TOPIC, qos)
        self._said = b""
        self._call: Call | None = core.call_at(core.now, self._publish)
        self._end = core.space.graph.watch(self._changed)

    def close(self) -> None:
        """Publishes no more."""
        self._end()
        if self._call is not None:
            self._core.cancel(self._call)
        self._participant.close()
        self._core.graph.gone(self._domain)

    def _changed(self, event: GraphEvent) -> None:
        if self._call is None:
            self._call = gather(self._core, self._said, self._publish)

    def _publish(self) -> None:
        self._call = None
        self.readers = [proxy for proxy in self.readers if not proxy.reader.closed]
        if not self.readers:
            self.close()
            return
        graph = self._graph()
        if graph == self._said:
            return
        if self._writer.write(graph):
            self._said = graph
        else:
            self._call = gather(self._core, self._said, self._publish)  # a reader has no room: try again

    def _graph(self) -> bytes:
        """The graph as it is now, serialised."""
        from muros.rclc.host.graph import KINDS
        from muros.space.rclc._graph import endpoints_of, nodes_of

        graph = self._core.space.graph
        entities: dict[str, dict[tuple[int, str], set[str]]] = {}
        for end in endpoints_of(graph, self._domain):
            if _fits(end.name, end.type):
                key = (KINDS.index(end.kind), end.name)
                entities.setdefault(end.node, {}).setdefault(key, set()).add(end.type)
        made: Any = interfaces.message("micro_ros_msgs/msg/Graph")()
        make_node = interfaces.message("micro_ros_msgs/msg/Node")
        make_entity = interfaces.message("micro_ros_msgs/msg/Entity")
        for name in nodes_of(graph, self._domain):
            if not _fits(name):
                continue
            node: Any = make_node()
            namespace, _, node.node_name = name.rpartition("/")
            node.node_namespace = namespace or "/"
            for (kind, entity), types in entities.get(name, {}).items():
                node.entities.append(make_entity(entity_type=kind, name=entity, types=sorted(types)))
            made.nodes.append(node)
        data: bytes = made.serialize()
        return data


def _fits(*names: str) -> bool:
    """Whether names are of the kind that ROS has: what others announce may be anything."""
    return all(name.isascii() and len(name) <= LONGEST_NAME for name in names)
