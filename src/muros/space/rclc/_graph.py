"""The graph of a space, in the words of rclc."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from muros.interfaces import InterfaceError, ros_topic, ros_type_name
from muros.rclc.host.graph import CLIENT, PUBLISHER, SERVER, SUBSCRIPTION, Endpoint
from muros.space import _graph

if TYPE_CHECKING:
    from muros.space.rclc._middleware import SpaceMiddleware

__all__ = ["SpaceGraph", "endpoints_of", "nodes_of"]


class SpaceGraph:
    """What a node sees of its domain; see `muros.rclc.host.graph.GraphSource`."""

    known = True

    def __init__(self, context: SpaceMiddleware, domain: int, on_change: Callable[[], object]) -> None:
        self.changes = 0
        self._context = context
        self._domain = domain
        self._on_change = on_change
        self._lock = context.ground.lock
        with self._lock:
            self._end = context.ground.space.graph.watch(self._changed)

    def read(self) -> tuple[list[str], list[Endpoint]]:
        """The full names of all nodes, and all that they made."""
        with self._lock:
            graph = self._context.ground.space.graph
            return nodes_of(graph, self._domain), endpoints_of(graph, self._domain)

    def close(self) -> None:
        """Watches no more."""
        with self._lock:
            self._end()

    def _changed(self, event: _graph.GraphEvent) -> None:
        """Something has changed; called with the lock held."""
        self.changes += 1
        self._on_change()
        self._context.stir()


def nodes_of(graph: _graph.Graph, domain: int) -> list[str]:
    """The full names of the nodes of a domain, in order of appearance."""
    return [node.full_name for node in graph.nodes if node.domain == domain]


def endpoints_of(graph: _graph.Graph, domain: int) -> list[Endpoint]:
    """What all of a domain have made: publishers, subscriptions, servers, clients. What ROS cannot name is left out."""
    found: list[Endpoint] = []
    for kind, ends in ((PUBLISHER, graph.writers), (SUBSCRIPTION, graph.readers)):
        for end in _in_domain(ends, domain):
            name = None if end.service else ros_topic(end.topic)
            if name is not None:
                found.append(_endpoint(kind, name, _type(end.type_name), end))
    for service in graph.services:
        if service.domain == domain:
            for kind, ends in ((SERVER, service.servers), (CLIENT, service.clients)):
                for end in ends:
                    found.append(
                        _endpoint(kind, service.name, _type(end.type_name).removesuffix("_Request"), end)
                    )
    return found


def _in_domain(ends: Iterable[_graph.Endpoint], domain: int) -> Iterable[_graph.Endpoint]:
    return (end for end in ends if end.participant.domain == domain)


def _endpoint(kind: str, name: str, type_name: str, end: _graph.Endpoint) -> Endpoint:
    node = end.participant.full_name if end.participant.name else ""
    return Endpoint(kind, name, type_name, node, end.gid, end.qos, end.type_hash)


def _type(dds_name: str) -> str:
    """The type as ROS calls it, if it does."""
    try:
        return ros_type_name(dds_name)
    except InterfaceError:
        return dds_name
