"""Participants of the dds engine: one participant of RTPS each, with its node told to ROS 2."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from muros import rtps
from muros.rtps import split_guid
from muros.space._core import Core
from muros.space._graph import Appeared, Vanished
from muros.space._participant import Child, EngineParticipant, Makers
from muros.space._values import Topic
from muros.space.dds._endpoints import DdsEndpoint, DdsReader, DdsWriter
from muros.space.dds._services import DdsReplier, DdsRequester
from muros.space.dds._wire_qos import to_wire

if TYPE_CHECKING:
    from muros.space.dds._domain import DdsDomain

__all__ = ["DdsParticipant"]


class DdsParticipant(EngineParticipant[DdsWriter, DdsReader, DdsRequester, DdsReplier]):
    """Somebody in the space. See `muros.space.Participant`."""

    __slots__ = ("home", "keyed", "rtps", "told")

    makers = Makers(
        lambda participant, topic, qos, gid: DdsWriter(participant, _typed(topic), qos, gid),
        lambda participant, topic, qos, gid, on_data: DdsReader(
            participant, _typed(topic), qos, gid, on_data
        ),
        DdsRequester,
        DdsReplier,
    )

    def __init__(
        self,
        core: Core,
        home: DdsDomain,
        prefix: bytes,
        name: str,
        namespace: str,
        enclave: str,
        owner: str,
        keyed: bool,
    ) -> None:
        super().__init__(core, home.number, prefix, name, namespace, enclave, owner)
        self.home = home
        self.keyed = keyed
        """Whether its GIDs come again in another life."""
        self.told: rtps.LocalWriter | None = None
        """Tells others of the node."""
        user_data = f"enclave={enclave};".encode()
        on_event = partial(home.on_event, self)
        former = home.lingering.take(prefix)
        if former is None:
            self.rtps = home.carrier.core.participant(
                prefix,
                now=home.now(),
                name=self.owner,
                user_data=user_data,
                properties=home.properties,
                on_event=on_event,
            )
        else:
            self.rtps, self.told, _ = former
            self.rtps.on_event = on_event
            if self.rtps.data.user_data != user_data:
                self.rtps.set_user_data(user_data, home.now())

    def close(self) -> None:
        """Leave the space with everything made here, in one go."""
        if self.closed:
            return
        self.closed = True
        children, self._children = self._children, []
        home = self.home
        lingers = self.keyed and not home.closing
        for child in reversed(children):
            endpoints = self._forget(child)
            if lingers:
                _close(endpoints, home.now())
        home.leave(self, lingers=lingers)
        self.core.settle()

    def in_use(self, gid: bytes) -> bool:
        """Whether there is an endpoint with this gid."""
        return gid in self.home.endpoints

    def take_out(self, child: Child) -> None:
        """Close a child."""
        _close(self._forget(child), self.home.now())
        self.home.nodes.changed(self)
        self.home.poke()

    def open_child(self, child: Child, gids: list[bytes], *endpoints: DdsEndpoint) -> None:
        """Announce the endpoints of a new child, and then the node that has them."""
        home = self.home
        self._children.append(child)
        with home.making():
            for endpoint in endpoints:
                home.endpoints[endpoint.gid] = endpoint
                if self.core.watchers:
                    self.core.tell(Appeared(endpoint.info()))
                self._open(endpoint)
        home.nodes.changed(self)
        home.poke()
        self.core.settle()

    def _open(self, endpoint: DdsEndpoint) -> None:
        """Make its counterpart in RTPS, which tells others of it."""
        home, topic = self.home, endpoint.topic
        qos = to_wire(endpoint.qos, self.core.limits)
        entity = split_guid(endpoint.gid)[1]
        user_data = f"typehash={endpoint.type_hash};".encode() if endpoint.type_hash else b""
        if isinstance(endpoint, DdsWriter):
            endpoint.out = self.rtps.writer(
                topic.name,
                topic.type_name,
                qos,
                now=home.now(),
                entity=entity,
                user_data=user_data,
                last=home.recall(endpoint.gid),
                settings=home.writer_settings,
                on_room=endpoint.room,
            )
        else:
            endpoint.source = self.rtps.reader(
                topic.name,
                topic.type_name,
                qos,
                endpoint.came,
                now=home.now(),
                entity=entity,
                user_data=user_data,
            )

    def _forget(self, child: Child) -> tuple[DdsEndpoint, ...]:
        """Take a child out of the books; RTPS has its endpoints still."""
        endpoints = self.parts(child)
        for endpoint in endpoints:
            self.home.forget(endpoint)
            if self.core.watchers:
                self.core.tell(Vanished(endpoint.info()))
        child.detach()
        return endpoints


def _close(endpoints: tuple[DdsEndpoint, ...], now: int) -> None:
    """Withdraw them from all others."""
    for endpoint in endpoints:
        (endpoint.out if isinstance(endpoint, DdsWriter) else endpoint.source).close(now)


def _typed(topic: Topic) -> Topic:
    if not topic.type_name:
        raise ValueError(f"{topic.name} has no type; in the dds space every topic needs one")
    return topic
