"""The graph of a dds space: our own books and what discovery has told, read when asked for."""

from __future__ import annotations

from collections.abc import Iterator

from muros.space._graph import (
    Endpoint,
    Incompatible,
    ParticipantInfo,
    Role,
    ServiceInfo,
    TopicInfo,
)
from muros.space._qos import mismatches
from muros.space._reports import types_differ
from muros.space._view import EngineGraph
from muros.space.dds._discovery_info import INFO_TOPIC
from muros.space.dds._domain import DdsDomain

__all__ = ["DdsGraph"]


class DdsGraph(EngineGraph[DdsDomain]):
    """See `muros.space.Graph`."""

    @property
    def participants(self) -> tuple[ParticipantInfo, ...]:
        """All participants, those of others by their nodes."""
        found: list[ParticipantInfo] = []
        for domain in self._domains.values():
            found += (participant.info() for participant in domain.participants.values())
            for remote in domain.remotes.values():
                found += remote.infos
        return tuple(found)

    @property
    def writers(self) -> tuple[Endpoint, ...]:
        """All writers."""
        return tuple(e for domain in self._domains.values() for e in _all(domain) if e.role is Role.WRITER)

    @property
    def readers(self) -> tuple[Endpoint, ...]:
        """All readers."""
        return tuple(e for domain in self._domains.values() for e in _all(domain) if e.role is Role.READER)

    @property
    def topics(self) -> tuple[TopicInfo, ...]:
        """All topics."""
        found = []
        for domain in self._domains.values():
            topics: dict[str, list[Endpoint]] = {}
            for endpoint in _all(domain):
                topics.setdefault(endpoint.topic, []).append(endpoint)
            found += [_topic(domain, name, endpoints) for name, endpoints in topics.items()]
        return tuple(found)

    @property
    def services(self) -> tuple[ServiceInfo, ...]:
        """All services."""
        found = []
        for domain in self._domains.values():
            services: dict[str, list[Endpoint]] = {}
            for endpoint in _all(domain):
                if endpoint.service:
                    services.setdefault(endpoint.service, []).append(endpoint)
            found += [_service(domain, name, endpoints) for name, endpoints in services.items()]
        return tuple(info for info in found if info.servers or info.clients)

    def topic(self, name: str, domain: int | None = None) -> TopicInfo | None:
        """One topic."""
        home = self._home(domain)
        if home is None:
            return None
        endpoints = [endpoint for endpoint in _all(home, name) if endpoint.topic == name]
        return _topic(home, name, endpoints) if endpoints else None

    def service(self, name: str, domain: int | None = None) -> ServiceInfo | None:
        """One service."""
        home = self._home(domain)
        if home is None:
            return None
        info = _service(home, name, [endpoint for endpoint in _all(home) if endpoint.service == name])
        return info if info.servers or info.clients else None

    def endpoint(self, gid: bytes) -> Endpoint | None:
        """The writer or reader with this gid."""
        for domain in self._domains.values():
            if (found := domain.endpoint_shown(gid)) is not None:
                return found
        return None


def _all(domain: DdsDomain, topic: str | None = None) -> Iterator[Endpoint]:
    """The endpoints of a domain, or of one topic of it; those that tell of nodes are left out."""
    for endpoint in domain.endpoints.values():
        if topic is None or endpoint.topic.name == topic:
            yield endpoint.info()
    for data in domain.remote_endpoints():
        if data.topic != INFO_TOPIC.name and (topic is None or data.topic == topic):
            yield domain.shown(data)


def _topic(domain: DdsDomain, name: str, endpoints: list[Endpoint]) -> TopicInfo:
    writers = tuple(endpoint for endpoint in endpoints if endpoint.role is Role.WRITER)
    readers = tuple(endpoint for endpoint in endpoints if endpoint.role is Role.READER)
    matches, incompatible = [], []
    for writer in writers:
        for reader in readers:
            pair = (writer.gid, reader.gid)
            reasons = () if pair in domain.pairs else _reasons(writer, reader)
            if reasons:
                incompatible.append(Incompatible(writer, reader, reasons))
            elif pair in domain.pairs or not domain.concerns(pair):
                matches.append(pair)
    return TopicInfo(
        name=name,
        domain=domain.number,
        types=tuple(dict.fromkeys(endpoint.type_name for endpoint in endpoints)),
        writers=writers,
        readers=readers,
        matches=tuple(matches),
        incompatible=tuple(incompatible),
    )


def _reasons(writer: Endpoint, reader: Endpoint) -> tuple[str, ...]:
    """Why two do not fit, as far as it can be told from outside."""
    if writer.type_name != reader.type_name:
        return (str(types_differ(writer.type_name, reader.type_name)),)
    return tuple(str(mismatch) for mismatch in mismatches(writer.qos, reader.qos))


def _service(domain: DdsDomain, name: str, endpoints: list[Endpoint]) -> ServiceInfo:
    """The request side tells: its readers are the servers, its writers the clients.

    Others' endpoints count when their participant has the other side too; else they merely listen.
    """
    replying = {(each.gid[:12], each.role) for each in endpoints if each.topic.startswith("rr/")}
    opposite = {Role.READER: Role.WRITER, Role.WRITER: Role.READER}
    requests = [
        each
        for each in endpoints
        if (
            domain.endpoints[each.gid].carries_requests
            if each.gid in domain.endpoints
            else each.topic.startswith("rq/") and (each.gid[:12], opposite[each.role]) in replying
        )
    ]
    return ServiceInfo(
        name,
        domain.number,
        tuple(endpoint for endpoint in requests if endpoint.role is Role.READER),
        tuple(endpoint for endpoint in requests if endpoint.role is Role.WRITER),
    )
