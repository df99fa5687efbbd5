"""The graph of a local space, read from its books when asked for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from muros.space._endpoint import EngineEndpoint
from muros.space._graph import (
    Endpoint,
    Incompatible,
    ParticipantInfo,
    Role,
    ServiceInfo,
    TopicInfo,
)
from muros.space._view import EngineGraph
from muros.space.local._matching import TopicRecord, reasons_against
from muros.space.local._participant import Domain

__all__ = ["LocalGraph"]


class LocalGraph(EngineGraph[Domain]):
    """See `muros.space.Graph`."""

    @property
    def participants(self) -> tuple[ParticipantInfo, ...]:
        """All participants."""
        return tuple(p.info() for domain in self._domains.values() for p in domain.participants.values())

    @property
    def writers(self) -> tuple[Endpoint, ...]:
        """All writers."""
        return tuple(e.info() for e in self._endpoints() if e.role is Role.WRITER)

    @property
    def readers(self) -> tuple[Endpoint, ...]:
        """All readers."""
        return tuple(e.info() for e in self._endpoints() if e.role is Role.READER)

    @property
    def topics(self) -> tuple[TopicInfo, ...]:
        """All topics."""
        return tuple(
            _topic_info(record, domain.number)
            for domain in self._domains.values()
            for record in domain.topics.values()
        )

    @property
    def services(self) -> tuple[ServiceInfo, ...]:
        """All services."""
        return tuple(
            info for domain in self._domains.values() for info in _services(domain.endpoints.values(), domain)
        )

    def topic(self, name: str, domain: int | None = None) -> TopicInfo | None:
        """One topic."""
        home = self._home(domain)
        record = None if home is None else home.topics.get(name)
        return None if home is None or record is None else _topic_info(record, home.number)

    def service(self, name: str, domain: int | None = None) -> ServiceInfo | None:
        """One service."""
        home = self._home(domain)
        if home is None:
            return None
        return next(_services((e for e in home.endpoints.values() if e.service == name), home), None)

    def endpoint(self, gid: bytes) -> Endpoint | None:
        """The writer or reader with this gid."""
        for domain in self._domains.values():
            if (endpoint := domain.endpoints.get(gid)) is not None:
                return endpoint.info()
        return None

    def _endpoints(self) -> Iterator[EngineEndpoint]:
        for domain in self._domains.values():
            yield from domain.endpoints.values()


def _topic_info(record: TopicRecord, domain: int) -> TopicInfo:
    writers, readers = record.writers, record.readers
    matches, incompatible = [], []
    for writer in writers:
        for reader in readers:
            if writer.reaches(reader):
                matches.append((writer.gid, reader.gid))
            else:
                reasons = tuple(str(reason) for reason in reasons_against(writer, reader))
                incompatible.append(Incompatible(writer.info(), reader.info(), reasons))
    return TopicInfo(
        name=record.name,
        domain=domain,
        types=tuple(dict.fromkeys(e.topic.type_name for e in (*writers, *readers))),
        writers=tuple(writer.info() for writer in writers),
        readers=tuple(reader.info() for reader in readers),
        matches=tuple(matches),
        incompatible=tuple(incompatible),
    )


def _services(endpoints: Iterable[EngineEndpoint], domain: Domain) -> Iterator[ServiceInfo]:
    """Services by name. The request side tells: its readers are the servers, its writers the clients."""
    servers: dict[str, list[Endpoint]] = {}
    clients: dict[str, list[Endpoint]] = {}
    for endpoint in endpoints:
        if endpoint.service and endpoint.carries_requests:
            side = servers if endpoint.role is Role.READER else clients
            side.setdefault(endpoint.service, []).append(endpoint.info())
    for name in dict.fromkeys((*servers, *clients)):
        yield ServiceInfo(name, domain.number, tuple(servers.get(name, ())), tuple(clients.get(name, ())))
