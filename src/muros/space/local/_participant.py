"""Participants of the local space and the domains they live in."""

from __future__ import annotations

from muros.space._core import Core
from muros.space._endpoint import EngineEndpoint
from muros.space._graph import Appeared, Vanished
from muros.space._participant import Child, EngineParticipant, Makers
from muros.space._values import Topic
from muros.space.local._matching import TopicRecord
from muros.space.local._reader import LocalReader
from muros.space.local._services import LocalReplier, LocalRequester
from muros.space.local._writer import LocalWriter

__all__ = ["Domain", "LocalParticipant"]


class Domain:
    """One world: its topics, endpoints by gid, participants by gid prefix."""

    __slots__ = ("endpoints", "number", "participants", "topics")

    def __init__(self, number: int) -> None:
        self.number = number
        self.topics: dict[str, TopicRecord] = {}
        self.endpoints: dict[bytes, EngineEndpoint] = {}
        self.participants: dict[bytes, LocalParticipant] = {}


class LocalParticipant(EngineParticipant[LocalWriter, LocalReader, LocalRequester, LocalReplier]):
    """Somebody in the space. See `muros.space.Participant`."""

    __slots__ = ("home",)

    makers = Makers(LocalWriter, LocalReader, LocalRequester, LocalReplier)

    def __init__(
        self, core: Core, home: Domain, prefix: bytes, name: str, namespace: str, enclave: str, owner: str
    ) -> None:
        super().__init__(core, home.number, prefix, name, namespace, enclave, owner)
        self.home = home
        home.participants[prefix] = self
        if core.watchers:
            core.tell(Appeared(self.info()))
            core.settle()

    def close(self) -> None:
        """Leave the space with everything made here, in one go."""
        if self.closed:
            return
        self.closed = True
        children, self._children = self._children, []
        for child in reversed(children):
            self.take_out(child)
        del self.home.participants[self.gid[:12]]
        if self.core.watchers:
            self.core.tell(Vanished(self.info()))
        self.core.settle()

    def in_use(self, gid: bytes) -> bool:
        """Whether there is an endpoint with this gid."""
        return gid in self.home.endpoints

    def record(self, topic: Topic) -> TopicRecord:
        """Who is on a topic."""
        name = topic.name
        record = self.home.topics.get(name)
        if record is None:
            record = self.home.topics[name] = TopicRecord(name)
        return record

    def open_child(self, child: Child, gids: list[bytes], *endpoints: LocalWriter | LocalReader) -> None:
        """Join the topics of a new child."""
        self._children.append(child)
        for endpoint in endpoints:
            self.home.endpoints[endpoint.gid] = endpoint
            if self.core.watchers:
                self.core.tell(Appeared(endpoint.info()))
            self.record(endpoint.topic).join(endpoint)
        self.core.settle()
        self.core.poke()

    def take_out(self, child: Child) -> None:
        """One of the children leaves the topics it is on."""
        for endpoint in self.parts(child):
            record = self.record(endpoint.topic)
            record.leave(endpoint)
            if record.empty:
                del self.home.topics[record.name]
            del self.home.endpoints[endpoint.gid]
            if self.core.watchers:
                self.core.tell(Vanished(endpoint.info()))
        child.detach()
