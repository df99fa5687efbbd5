"""Writers and readers of the cyclonedds engine.

Everything is fetched from Cyclone on the event loop (`CycloneDomain.fetch`). A reader is emptied into the cache that
all engines have, at once, so Cyclone never holds much; only one that keeps all and is full leaves its samples there,
which makes Cyclone hold up the writers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from muros.findings import Severity
from muros.space._cache import CachingReader
from muros.space._door import ClosedError, SpaceError
from muros.space._endpoint import EngineEndpoint
from muros.space._graph import Role
from muros.space._qos import Qos
from muros.space._timers import Timer
from muros.space._values import CDR_LE, GID_SIZE, Sample, Topic

if TYPE_CHECKING:
    from muros.space.cyclone._participant import CycloneParticipant

__all__ = ["CycloneReader", "CycloneWriter", "encapsulated"]

ANY_STATE: Final = 0x7F
"""Samples in whatever state, in the words of Cyclone."""

AT_ONCE: Final = 256
"""Samples fetched in one call."""

TIMED_OUT: Final = -10
"""DDS_RETCODE_TIMEOUT: a writer has no room, and is not to wait for it."""

RETRY: Final = 2_000_000
"""ns after which a refused write is worth trying again: Cyclone does not tell when there is room."""


def encapsulated(data: bytes, representation: int = CDR_LE) -> bytes:
    """`data` as a serialized payload, a multiple of 4 bytes long."""
    pad = -len(data) & 3
    return representation.to_bytes(2, "big") + bytes((0, pad)) + data + bytes(pad)


class CycloneWriter(EngineEndpoint):
    """Writes samples of one topic. See `muros.space.Writer`."""

    __slots__ = (
        "_timer", "entity", "matched", "number", "on_room", "refused", "refused_since", "sequence",
    )  # fmt: skip

    role = Role.WRITER
    participant: CycloneParticipant

    def __init__(self, participant: CycloneParticipant, topic: Topic, qos: Qos, service: str = "") -> None:
        super().__init__(participant, topic, qos, bytes(GID_SIZE), service)
        self.type_hash = participant.home.type_hash(topic.type_name)
        self.entity: Any = None
        self.number = 0
        self.matched: tuple[bytes, ...] = ()
        self.on_room: Callable[[], object] | None = None
        self.refused = 0
        self.refused_since: int | None = None
        self.sequence = 0
        self._timer: Timer | None = None

    @property
    def acknowledged(self) -> bool:
        """Whether all reliable readers have got everything."""
        return self.closed or self.entity._wait_for_acks(self.entity._ref, 0) == 0

    def write(
        self,
        data: bytes,
        *,
        source_time: int | None = None,
        related: bytes | None = None,
        representation: int = CDR_LE,
    ) -> bool:
        """Give `data` to all matched readers; False = refused, try again after `on_room`."""
        if related is not None and not self.closed:
            self.core.count("related-not-carried", self.owner, self.topic.name, self._tell_related)
        return self.put(data, source_time, representation)

    def put(self, data: bytes, source_time: int | None, representation: int) -> bool:
        """Write a body."""
        core = self.core
        if not self.admits():
            return False
        if not representation & 1:
            raise SpaceError(
                f"the engine cyclonedds cannot carry big-endian samples (representation 0x{representation:04x}); "
                "write them little-endian, or use dds:"
            )
        if source_time is None:
            source_time = core.clock()
        if self.qos.lifespan:
            # Cyclone counts a lifespan from the source time, and the clocks of boards may be wrong.
            source_time = self.participant.home.wall()
        if self.deadline is not None:
            self.deadline.touch()
        from cyclonedds._clayer import ddspy_write_ts

        result = ddspy_write_ts(self.entity._ref, encapsulated(data, representation), max(0, source_time))
        if result == TIMED_OUT:
            self._refuse(core.timers.now() + RETRY)
            return False
        if result != 0:
            raise SpaceError(f"Cyclone DDS could not write {self.topic.name} (code {result})")
        self.sequence += 1
        self.refused_since = None
        self.participant.home.fetch()
        if core.queue:
            core.drain()
        return True

    def admits(self) -> bool:
        """Whether the readers of this process have room; if not, it is refused, for a while. ClosedError."""
        if self.closed:
            raise ClosedError(f"the writer of {self.topic.name} is closed; make a new one")
        full = [reader for reader in self._stuck() if reader.full]
        if not full:
            self.refused_since = None
            return True
        now, patience = self.core.timers.now(), self.core.limits.max_blocking_time
        if self.refused_since is None:
            self.refused_since = now
        if now - self.refused_since >= patience:
            self.refused_since = None
            for reader in full:
                reader.patient = False
                self.participant.home.resume(reader)
                if self in reader.waiting:
                    reader.waiting.remove(self)
            return True
        for reader in full:
            if self not in reader.waiting:
                reader.waiting.append(self)
        self._refuse(self.refused_since + patience)
        return False

    def room(self) -> None:
        """A write may be tried again."""
        if self._timer is not None:
            self.core.timers.cancel(self._timer)
            self._timer = None
        self.core.post(self)

    def run(self) -> None:
        """Tell the user that a refused write is worth trying again."""
        if self.on_room is not None and not self.closed:
            self.core.call(self.owner, self.on_room)

    def connected(self, gid: bytes) -> None:
        """A reader matches."""

    def disconnected(self, gid: bytes) -> None:
        """A reader matches no more."""

    def close(self) -> None:
        """Take it out of the space."""
        self.participant.close_child(self)

    def detach(self) -> None:
        """Let go of everything held."""
        super().detach()
        self.matched = ()
        self.on_room = None
        if self._timer is not None:
            self.core.timers.cancel(self._timer)
            self._timer = None

    def _stuck(self) -> list[CycloneReader]:
        """Readers of this process that make writers wait."""
        endpoints = self.participant.home.endpoints
        if not self.qos.reliability:
            return []
        readers = (endpoints.get(gid) for gid in self.matched)
        return [r for r in readers if isinstance(r, CycloneReader) and r.refuses and r.patient]

    def _refuse(self, until: int) -> None:
        self.refused += 1
        if self._timer is None:
            self._timer = self.core.timers.at(until, self.room)

    def _tell_related(self, n: int) -> None:
        self.core.report(
            "related-not-carried",
            who=self.owner,
            subject=self.topic.name,
            what=f"{{n}} sample{{s}} of {self.topic.name} did not say which request they answer",
            why="Cyclone DDS sends no inline QoS",
            remedy="Use a replier, or dds: instead of cyclonedds:",
            severity=Severity.INFO,
            n=n,
        )


class CycloneReader(CachingReader):
    """Keeps the samples of one topic until they are taken. See `muros.space.Reader`."""

    __slots__ = ("entity", "matched", "number", "numbers", "patient", "waiting")

    role = Role.READER
    participant: CycloneParticipant

    def __init__(
        self,
        participant: CycloneParticipant,
        topic: Topic,
        qos: Qos,
        on_data: Callable[[Any], object] | None = None,
        service: str = "",
    ) -> None:
        super().__init__(participant, topic, qos, bytes(GID_SIZE), on_data, service)
        self.type_hash = participant.home.type_hash(topic.type_name)
        self.entity: Any = None
        self.number = 0
        self.matched: tuple[bytes, ...] = ()
        self.numbers: dict[bytes, int] = {}
        """Samples that have come, by writer: Cyclone does not tell the numbers they have."""
        self.patient = True
        """Whether writers of this process wait for it."""
        self.waiting: deque[CycloneWriter] = deque()

    def fetch(self) -> None:
        """Take over what Cyclone has for it."""
        from cyclonedds._clayer import ddspy_take

        home = self.participant.home
        while not self.closed:
            n = AT_ONCE
            if self.refuses and self.patient:
                n = min(n, self.limit - len(self.cache))
                if n <= 0:
                    home.hold(self)
                    return
            got = ddspy_take(self.entity._ref, ANY_STATE, n)
            if isinstance(got, int) or not got:
                return
            for raw, info in got:
                if info.valid_data and len(raw) >= 4:
                    gid = home.gid_of(self, info.publication_handle) or bytes(GID_SIZE)
                    self.came(raw, gid, info.source_timestamp)
            if len(got) < n:
                return

    def came(self, payload: bytes, gid: bytes, source_time: int) -> None:
        """A sample, with its encapsulation."""
        number = self.numbers[gid] = self.numbers.get(gid, 0) + 1
        pad = payload[3] & 3
        body = payload[4 : len(payload) - pad] if pad else payload[4:]
        lifespan = self.participant.home.lifespan_of(gid)
        expires = self.core.timers.now() + lifespan if lifespan else 0
        representation = payload[0] << 8 | payload[1]
        sample = self.sample(Sample(body, source_time, gid, number, None, representation, expires))
        if sample is not None:
            self.arrive(sample)

    def sample(self, sample: Sample) -> Sample | None:
        """What to keep of a sample; None = nothing."""
        return sample

    def relieved(self) -> None:
        """There is room: fetch what was left behind, have writers try again."""
        if not self.refuses:
            return
        self.patient = True
        self.participant.home.resume(self)
        waiting, self.waiting = self.waiting, deque()
        for writer in waiting:
            writer.room()

    def connected(self, gid: bytes) -> None:
        """A writer matches."""

    def disconnected(self, gid: bytes) -> None:
        """A writer matches no more."""
        self.numbers.pop(gid, None)
        if not self.matched and self.deadline is not None:
            self.deadline.stop()

    def close(self) -> None:
        """Take it out of the space."""
        self.participant.close_child(self)

    def detach(self) -> None:
        """Let go of everything held."""
        super().detach()
        self.matched = ()
        self.numbers = {}
        waiting, self.waiting = self.waiting, deque()
        for writer in waiting:
            writer.room()
