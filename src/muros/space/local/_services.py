"""Services of the local space, made of ordinary writers and readers of the request and reply topics.

A request's identity is its writer's gid and its sequence number. A reply names it (`related`); reply writers
keep the readers of replies by the client's gid and give each reply to the one it names.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from muros.space import _reports
from muros.space._qos import Qos
from muros.space._services import EngineReplier, EngineRequester
from muros.space._values import Sample, Service, Topic, split_identity
from muros.space.local._reader import LocalReader
from muros.space.local._writer import LocalWriter

if TYPE_CHECKING:
    from muros.space.local._participant import LocalParticipant

__all__ = ["LocalReplier", "LocalRequester"]


class LocalRequester(EngineRequester):
    """The client's side of a service. See `muros.space.Requester`."""

    __slots__ = ("reader", "writer")

    def __init__(
        self,
        participant: LocalParticipant,
        service: Service,
        qos: Qos,
        writer_gid: bytes,
        reader_gid: bytes,
        on_reply: Callable[[int, bytes], object] | None,
        on_data: Callable[[Any], object] | None,
    ) -> None:
        super().__init__(participant, service, qos, on_reply, on_data)
        topic = Topic(service.reply_topic, service.reply_type)
        self.reader: LocalReader = _ReplyReader(
            participant, topic, qos, reader_gid, self.announce, service.name, writer_gid
        )
        topic = Topic(service.request_topic, service.request_type)
        self.writer: LocalWriter = _RequestWriter(participant, topic, qos, writer_gid, self)
        self.writer.on_room = self.flush

    @property
    def servers(self) -> int:
        """Servers present."""
        return sum(1 for reader in self.writer.readers if reader.service)

    def sample(self, data: bytes, source_time: int | None, representation: int) -> Sample:
        """A request, not sent yet."""
        return self.writer.sample(data, source_time, None, representation)

    def admits(self) -> bool:
        """Whether the servers have room for it."""
        return self.writer.admits()

    def deliver(self, request: Sample) -> bool:
        """Give it to the servers."""
        return self.writer.deliver(request)

    def number_of(self, reply: Sample) -> int | None:
        """Number of the request that is answered."""
        return None if reply.related is None else split_identity(reply.related)[1]


class LocalReplier(EngineReplier):
    """The server's side of a service. See `muros.space.Replier`."""

    __slots__ = ("reader", "writer")

    def __init__(
        self,
        participant: LocalParticipant,
        service: Service,
        qos: Qos,
        writer_gid: bytes,
        reader_gid: bytes,
        on_request: Callable[[bytes, bytes], object] | None,
        on_data: Callable[[Any], object] | None,
    ) -> None:
        super().__init__(participant, service, qos, on_request, on_data)
        topic = Topic(service.reply_topic, service.reply_type)
        self.writer: LocalWriter = LocalWriter(participant, topic, qos, writer_gid, service.name)
        topic = Topic(service.request_topic, service.request_type)
        self.reader: LocalReader = LocalReader(
            participant, topic, qos, reader_gid, self.announce, service.name
        )

    @property
    def clients(self) -> int:
        """Clients present."""
        return len(self.writer.clients or ())

    def deliver(self, identity: bytes, data: bytes, source_time: int | None, representation: int) -> bool:
        """Give a reply to its client."""
        return self.writer.deliver(self.writer.sample(data, source_time, identity, representation))


class _ReplyReader(LocalReader):
    """Reads the replies to one client."""

    __slots__ = ("_client_gid",)

    def __init__(
        self,
        participant: LocalParticipant,
        topic: Topic,
        qos: Qos,
        gid: bytes,
        on_data: Callable[[Any], object] | None,
        service: str,
        client_gid: bytes,
    ) -> None:
        super().__init__(participant, topic, qos, gid, on_data, service)
        self._client_gid = client_gid

    @property
    def client_gid(self) -> bytes:
        """The gid its requests are written with."""
        return self._client_gid


class _RequestWriter(LocalWriter):
    """Writes the requests of one client; hands over what waits when a server comes."""

    __slots__ = ("_requester",)

    def __init__(
        self, participant: LocalParticipant, topic: Topic, qos: Qos, gid: bytes, requester: LocalRequester
    ) -> None:
        super().__init__(participant, topic, qos, gid, requester.service.name)
        self._requester = requester

    @property
    def carries_requests(self) -> bool:
        """Whether it is a client's."""
        return True

    def connect(self, reader: LocalReader) -> None:
        """A reader of requests has come."""
        super().connect(reader)
        if not reader.service:
            return
        requester = self._requester
        if requester.servers == 2:
            self.core.notices.append(self._report_several)
        if requester.waiting:
            self.core.post(self)

    def _report_several(self) -> None:
        _reports.several_servers(self.core, self.owner, self.service, self._requester.servers)
