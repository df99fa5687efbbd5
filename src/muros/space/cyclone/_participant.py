"""Participants of the cyclonedds engine: one DDS participant each, with its node told to ROS 2."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from muros.space._core import Core
from muros.space._door import SpaceError
from muros.space._graph import Appeared, Vanished
from muros.space._participant import Child, EngineParticipant, Makers
from muros.space._values import Topic
from muros.space.cyclone._endpoints import CycloneReader, CycloneWriter
from muros.space.cyclone._opaque import opaque_type, unannounced
from muros.space.cyclone._policies import to_policies
from muros.space.cyclone._services import CycloneReplier, CycloneRequester

if TYPE_CHECKING:
    from muros.space.cyclone._domain import CycloneDomain

__all__ = ["CycloneParticipant", "delete"]


class CycloneParticipant(EngineParticipant[CycloneWriter, CycloneReader, CycloneRequester, CycloneReplier]):
    """Somebody in the space. See `muros.space.Participant`.

    Keys say which numbers are in use, but Cyclone chooses the gids.
    """

    __slots__ = ("_claims", "_topics", "entity", "home", "key", "told")

    makers = Makers(
        lambda participant, topic, qos, _: CycloneWriter(participant, topic, qos),
        lambda participant, topic, qos, _, on_data: CycloneReader(participant, topic, qos, on_data),
        lambda participant, service, qos, *gids_and_callbacks: CycloneRequester(
            participant, service, qos, *gids_and_callbacks[2:]
        ),
        lambda participant, service, qos, *gids_and_callbacks: CycloneReplier(
            participant, service, qos, *gids_and_callbacks[2:]
        ),
    )

    def __init__(
        self,
        core: Core,
        home: CycloneDomain,
        name: str,
        namespace: str,
        enclave: str,
        owner: str,
        key: bytes | None,
    ) -> None:
        self.entity = home.make_participant(enclave, owner or name)
        super().__init__(core, home.number, self.entity.guid.bytes[:12], name, namespace, enclave, owner)
        self.home = home
        self.key = key
        self.told: Any = None
        """Tells others of the node."""
        self._claims: dict[bytes, Child] = {}
        self._topics: dict[Topic, Any] = {}

    def close(self) -> None:
        """Leave the space with everything made here, in one go."""
        if self.closed:
            return
        self.closed = True
        children, self._children = self._children, []
        for child in reversed(children):
            self.take_out(child)
        self.home.leave(self)
        for topic in self._topics.values():
            delete(topic)
        self._topics.clear()
        if self.told is not None:
            delete(self.told)
        delete(self.entity)
        if self.core.watchers:
            self.core.tell(Vanished(self.info()))
        self.home.fetch()
        self.core.settle()

    def in_use(self, gid: bytes) -> bool:
        """Whether a number is in use, written as the gid it would have."""
        return gid in self._claims

    def take_out(self, child: Child) -> None:
        """Take a child out of the space."""
        self._claims = {claim: other for claim, other in self._claims.items() if other is not child}
        for endpoint in self.parts(child):
            self.home.forget(endpoint)
            if self.core.watchers:
                self.core.tell(Vanished(endpoint.info()))
            delete(endpoint.entity)
        child.detach()
        self.home.changed(self)
        self.home.fetch()

    def open_child(self, child: Child, gids: list[bytes], *endpoints: CycloneReader | CycloneWriter) -> None:
        """Have Cyclone make the endpoints of a new child, and tell of the node that has them."""
        home = self.home
        with self.core.hushed():
            for endpoint in endpoints:
                self._open(endpoint)
                home.endpoints[endpoint.gid] = endpoint
                if self.core.watchers:
                    self.core.tell(Appeared(endpoint.info()))
                home.compare(endpoint)
            self._children.append(child)
            self._claims.update(dict.fromkeys(gids, child))
            home.fetch()
        home.changed(self)
        self.core.settle()

    def _open(self, endpoint: CycloneReader | CycloneWriter) -> None:
        """Make its counterpart in Cyclone, which tells others of it."""
        from cyclonedds.core import DDSException
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader

        home, writes = self.home, isinstance(endpoint, CycloneWriter)
        hashed = f"typehash={endpoint.type_hash};".encode() if endpoint.type_hash else b""
        policies = to_policies(endpoint.qos, self.core.limits, writes=writes, user_data=hashed)
        try:
            topic = self._topic(endpoint.topic)
            with unannounced(topic):
                kind = DataWriter if writes else DataReader
                endpoint.entity = kind(self.entity, topic, policies)
        except DDSException as error:
            raise SpaceError(f"Cyclone DDS refuses {endpoint.topic.name}: {error}") from None
        endpoint.gid = endpoint.entity.guid.bytes
        home.watch(endpoint)

    def _topic(self, topic: Topic) -> Any:
        from cyclonedds.topic import Topic as CycloneTopic

        if not topic.type_name:
            raise ValueError(f"{topic.name} has no type; in the cyclonedds space every topic needs one")
        known = self._topics.get(topic)
        if known is None:
            known = self._topics[topic] = CycloneTopic(self.entity, topic.name, opaque_type(topic.type_name))
        return known


def delete(entity: Any) -> None:
    """Have Cyclone delete an entity now; it would otherwise when nobody holds it any more."""
    entity.__del__()
