"""The readers by which clients on hosts learn the whole graph, with what endpoints are.

No such reader is in the data space: it is answered here, with samples as `muros.rclc.host.agent_graph` describes them,
one at once and one after changes, several of them together.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from muros.agent._calls import Call
from muros.agent._proxies import Answered, ParticipantProxy, Reading
from muros.space import GraphEvent, Topic
from muros.xrce.representation import Entity

if TYPE_CHECKING:
    from muros.agent._core import AgentCore

__all__ = ["TOPIC", "GraphProxy", "gather"]

TOPIC: Final = "muros_graph"
DELAY: Final = 50
"""Milliseconds in which changes are gathered."""
PACE: Final = 1000
"""Bytes of the graph for which they are gathered a millisecond longer: large ones take their time."""


def gather(core: "AgentCore", said: bytes, tell: Callable[[], object]) -> Call:
    """Has changes told when those have been gathered that come together; ``said`` is the graph that was told last."""
    return core.call_at(core.now + DELAY + len(said) // PACE, tell)


class GraphProxy(Answered):
    """A datareader of the graph of its domain. It waits for `begin`."""

    __slots__ = ("_call", "_changed", "_core", "_end", "_said")

    def __init__(self, object_id: int, entity: Entity, parent: ParticipantProxy, topic: Topic) -> None:
        super().__init__(object_id, entity, parent, topic, "reads the graph")
        self._core: AgentCore | None = None
        self._changed = True
        self._said = b""
        self._call: Call | None = None

    def begin(self, core: "AgentCore") -> None:
        """It is among the objects of its client."""
        self._core = core
        self._end = core.space.graph.watch(self._watch)

    def start(self, reading: Reading) -> None:
        """Replaces what was being read by `reading`, which begins with what there is."""
        self._changed = True
        self._said = b""
        super().start(reading)

    def take(self) -> bytes | None:
        """The graph, if it has changed since it was told."""
        if not self._changed or self._core is None or self.parent is None:
            return None
        from muros.rclc.host.agent_graph import pack
        from muros.space.rclc._graph import endpoints_of, nodes_of

        self._changed = False
        graph, domain = self._core.space.graph, self.parent.domain
        said = pack(nodes_of(graph, domain), endpoints_of(graph, domain))
        if said == self._said:
            return None
        self._said = said
        return said

    def close(self) -> None:
        """Tells no more."""
        if self._core is not None:
            self._end()
            if self._call is not None:
                self._core.cancel(self._call)
                self._call = None
        super().close()

    def _watch(self, event: GraphEvent) -> None:
        if self._call is None and self._core is not None:
            self._call = gather(self._core, self._said, self._tell)

    def _tell(self) -> None:
        self._call = None
        self._changed = True
        self._on_data(None)
