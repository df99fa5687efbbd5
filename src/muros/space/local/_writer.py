"""Writers of the local space: delivery happens in the writer's call.

`write` is the hot path of the whole space. It appends to the readers' caches and wakes those that were empty;
what only some writers need (back-pressure, history, lifespan, deadline, replies to one client) is behind the one
flag `special`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

from muros.findings import Severity
from muros.space._door import ClosedError
from muros.space._endpoint import EngineEndpoint, without
from muros.space._graph import Role
from muros.space._qos import Durability, Qos
from muros.space._values import CDR_LE, GID_SIZE, IDENTITY_SIZE, Sample, Topic

if TYPE_CHECKING:
    from muros.space.local._participant import LocalParticipant
    from muros.space.local._reader import LocalReader

__all__ = ["LocalWriter"]


class LocalWriter(EngineEndpoint):
    """Writes samples of one topic. See `muros.space.Writer`."""

    __slots__ = (
        "clients", "history", "may_block", "on_room", "readers", "refused", "refused_since", "sequence", "special",
        "waiting",
    )  # fmt: skip

    role = Role.WRITER
    participant: LocalParticipant

    def __init__(
        self, participant: LocalParticipant, topic: Topic, qos: Qos, gid: bytes, service: str = ""
    ) -> None:
        super().__init__(participant, topic, qos, gid, service)
        self.readers: tuple[LocalReader, ...] = ()
        """Replaced, never changed: a delivery that goes on keeps the ones it began with."""
        self.clients: dict[bytes, LocalReader] | None = None
        """Readers of replies, by the gid of the client they belong to."""
        self.sequence = 0
        self.history: deque[Sample] | None = None
        self.may_block = False
        self.refused = 0
        self.refused_since: int | None = None
        self.waiting = False
        self.on_room: Callable[[], object] | None = None
        self.special = False
        self._classify()

    @property
    def matched(self) -> tuple[bytes, ...]:
        """Gids of the readers it writes to."""
        return tuple(reader.gid for reader in self.all_readers())

    @property
    def acknowledged(self) -> bool:
        """What was written is there at once."""
        return True

    def write(
        self,
        data: bytes,
        *,
        source_time: int | None = None,
        related: bytes | None = None,
        representation: int = CDR_LE,
    ) -> bool:
        """Give `data` to all matched readers; False = refused, try again after `on_room`."""
        if self.special:
            if not self.admits():
                return False
            self.deliver(self.sample(data, source_time, related, representation))
            return True
        core = self.core
        self.sequence = sequence = self.sequence + 1
        sample = Sample(
            data,
            core.clock() if source_time is None else source_time,
            self.gid,
            sequence,
            related,
            representation,
        )
        queue = core.queue
        for reader in self.readers:
            cache = reader.cache
            if len(cache) >= reader.room:
                reader.arrive(sample)
            elif cache:
                cache.append(sample)
            else:
                cache.append(sample)
                if not reader.queued:
                    reader.queued = True
                    queue.append(reader)
        if queue and not core.draining:
            core.drain()
        return True

    def sample(
        self, data: bytes, source_time: int | None, related: bytes | None, representation: int
    ) -> Sample:
        """The next sample, not delivered yet."""
        if self.closed:
            raise ClosedError(f"the writer of {self.topic.name} is closed; make a new one")
        self.sequence += 1
        expires = self.core.timers.now() + self.qos.lifespan if self.qos.lifespan else 0
        time = self.core.clock() if source_time is None else source_time
        return Sample(data, time, self.gid, self.sequence, related, representation, expires)

    def admits(self) -> bool:
        """Whether a sample may be written now; if not, the writer is in line. ClosedError if closed."""
        if self.closed:
            raise ClosedError(f"the writer of {self.topic.name} is closed; make a new one")
        if self.may_block:
            for reader in self.readers:
                if reader.pressure is not None and reader.pressure.refuses(self):
                    self.refused += 1
                    return False
            self.refused_since = None
        return True

    def deliver(self, sample: Sample) -> bool:
        """Give a sample to everybody it is for. False: it is for one client only, and that is not there."""
        found = True
        if self.deadline is not None:
            self.deadline.touch()
        if self.qos.durability != Durability.VOLATILE:
            self._remember(sample)
        for reader in self.readers:
            reader.arrive(sample)
        if sample.related is not None and (self.clients is not None or self.service):
            client = self._client(sample.related)
            found = client is not None
            if client is not None:
                client.arrive(sample)
        if self.core.queue:
            self.core.drain()
        return found

    def run(self) -> None:
        """Tell the user that a refused write is worth trying again."""
        if self.on_room is not None and not self.closed:
            self.core.call(self.owner, self.on_room)

    def connect(self, reader: LocalReader) -> None:
        """`reader` matches: it gets the history now and live samples from now on."""
        client = reader.client_gid
        if client:
            self.clients = {**(self.clients or {}), client: reader}
        else:
            self.readers += (reader,)
        self.may_block = self.may_block or reader.pressure is not None
        self._classify()
        if self.history and reader.qos.durability:
            now = self.core.timers.now()
            reader.catch_up([s for s in self.history if not s.expires or s.expires > now])

    def disconnect(self, reader: LocalReader) -> None:
        """It and `reader` part."""
        if reader.pressure is not None:
            reader.pressure.leave(self)
        client = reader.client_gid
        if client:
            self.clients = {k: r for k, r in (self.clients or {}).items() if r is not reader} or None
        else:
            self.readers = without(self.readers, reader)
        if reader.pressure is not None:
            self.may_block = any(r.pressure is not None for r in self.readers)
        self._classify()

    def reaches(self, reader: LocalReader) -> bool:
        """Whether it writes to `reader`."""
        client = reader.client_gid
        if client:
            return self.clients is not None and self.clients.get(client) is reader
        return reader in self.readers

    def all_readers(self) -> tuple[LocalReader, ...]:
        """The readers of all its samples, and the clients that get their own."""
        return self.readers if self.clients is None else (*self.readers, *self.clients.values())

    def close(self) -> None:
        """Take it out of the space."""
        self.participant.close_child(self)

    def detach(self) -> None:
        """Let go of everything held."""
        super().detach()
        self.readers = ()
        self.clients = None
        self.history = None
        self.on_room = None
        self.special = True

    def _client(self, identity: bytes) -> LocalReader | None:
        """The reader of replies that a reply to `identity` is for."""
        if self.clients is None or len(identity) != IDENTITY_SIZE:
            return None
        return self.clients.get(bytes(identity[:GID_SIZE]))

    def _classify(self) -> None:
        """Recompute which path `write` takes."""
        qos = self.qos
        self.special = bool(
            self.closed
            or self.may_block
            or self.clients is not None
            or qos.deadline
            or qos.lifespan
            or qos.durability != Durability.VOLATILE
        )

    def _remember(self, sample: Sample) -> None:
        """Keep a sample for readers that come later."""
        history = self.history
        if history is None:
            history = self.history = deque(maxlen=self.limit)
        if self.qos.keeps_all and len(history) == history.maxlen:
            self.core.count("history-full", self.owner, self.topic.name, self._tell_history_full)
        history.append(sample)

    def _tell_history_full(self, n: int) -> None:
        self.core.report(
            "history-full",
            who=self.owner,
            subject=self.topic.name,
            what=f"{{n}} sample{{s}} of {self.topic.name} no longer kept for late readers by {self.owner}",
            why=f"a history holds at most {self.limit}",
            remedy="Keep only the last ones, or give the space a greater resource_limit",
            severity=Severity.INFO,
            n=n,
        )
