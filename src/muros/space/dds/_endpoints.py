"""Writers and readers of the dds engine: between the door, which passes bodies, and RTPS, which passes payloads."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from muros import rtps
from muros.findings import Severity
from muros.rtps import InvalidParameters, Problem, Received
from muros.space._cache import CachingReader
from muros.space._door import ClosedError
from muros.space._endpoint import EngineEndpoint
from muros.space._graph import Role
from muros.space._qos import Qos
from muros.space._values import CDR_LE, IDENTITY_SIZE, Sample, Topic

if TYPE_CHECKING:
    from muros.space.dds._participant import DdsParticipant

__all__ = ["DdsEndpoint", "DdsReader", "DdsWriter", "encapsulated"]

_HEADS: Final = tuple(CDR_LE.to_bytes(2, "big") + bytes((0, pad)) for pad in range(4))
"""Encapsulation of little-endian CDR; the last two bits count the bytes that fill up to a multiple of 4."""


TIME_END: Final = 0xFFFFFFFF * 10**9
"""ns since 1970 from which on a time does not fit RTPS; boards may say anything."""


LARGE: Final = 4096
"""Bytes from which on it is cheaper not to copy data than to carry them in pieces."""


def encapsulated(data: bytes, representation: int = CDR_LE) -> bytes:
    """`data` as a serialized payload."""
    pad = -len(data) & 3
    head = _HEADS[pad] if representation == CDR_LE else representation.to_bytes(2, "big") + bytes((0, pad))
    return head + data + bytes(pad) if pad else head + data


def pieces(data: bytes, representation: int) -> tuple[bytes, ...]:
    """The same in pieces: large data are copied only where they leave."""
    pad = -len(data) & 3
    head = _HEADS[pad] if representation == CDR_LE else representation.to_bytes(2, "big") + bytes((0, pad))
    return head, data, bytes(pad)


class DdsWriter(EngineEndpoint):
    """Writes samples of one topic. See `muros.space.Writer`."""

    __slots__ = ("on_room", "out", "refused")

    role = Role.WRITER
    participant: DdsParticipant

    def __init__(
        self, participant: DdsParticipant, topic: Topic, qos: Qos, gid: bytes, service: str = ""
    ) -> None:
        super().__init__(participant, topic, qos, gid, service)
        self.type_hash = participant.home.type_hash(topic.type_name)
        self.on_room: Callable[[], object] | None = None
        self.refused = 0
        self.out: rtps.LocalWriter

    @property
    def matched(self) -> tuple[bytes, ...]:
        """Gids of the readers it writes to."""
        return () if self.closed else self.out.matched

    @property
    def acknowledged(self) -> bool:
        """Whether all that was written has reached every matched reader that is reliable."""
        return self.closed or self.out.acknowledged

    def write(
        self,
        data: bytes,
        *,
        source_time: int | None = None,
        related: bytes | None = None,
        representation: int = CDR_LE,
    ) -> bool:
        """Give `data` to all matched readers; False = refused, try again after `on_room`."""
        inline_qos = b""
        if related is not None and len(related) == IDENTITY_SIZE:
            inline_qos = rtps.inline_qos(related=related)
        payload = (pieces if len(data) >= LARGE else encapsulated)(data, representation)
        return self.put(payload, source_time, inline_qos) != 0

    def put(
        self,
        payload: bytes | tuple[bytes, ...],
        source_time: int | None,
        inline_qos: bytes = b"",
        to: bytes | None = None,
    ) -> int:
        """Write a payload, to all matched readers or one of them; its sequence number, 0 = refused."""
        if self.closed:
            raise ClosedError(f"the writer of {self.topic.name} is closed; make a new one")
        home = self.participant.home
        if source_time is None or not 0 <= source_time < TIME_END:
            source_time = self.core.clock()
        if to is not None and to not in self.out.matched:
            return 0  # it has gone meanwhile
        if self.deadline is not None:
            self.deadline.touch()
        sequence = self.out.write(
            payload,
            home.now(),
            source_time=source_time,
            inline_qos=inline_qos,
            to=to,
        )
        if not sequence:
            self.refused += 1
        home.poke()
        return sequence

    def room(self) -> None:
        """RTPS has room again."""
        self.core.post(self)

    def run(self) -> None:
        """Tell the user that a refused write is worth trying again."""
        if self.on_room is not None and not self.closed:
            self.core.call(self.owner, self.on_room)

    def connected(self, remote: bytes) -> None:
        """A reader matches."""

    def disconnected(self, remote: bytes) -> None:
        """A reader matches no more."""

    def trouble(self, problem: Problem, remote: bytes, number: int) -> None:
        """Something went wrong between it and a reader."""
        if problem is Problem.READER_STALLED:
            self.core.report(
                "reader-stalled",
                who=self.owner,
                subject=self.topic.name,
                what=f"{{n}} time{{s}} a reader of {self.topic.name} was left behind by {self.owner}",
                why=f"{self.participant.home.name_of(remote)} acknowledges nothing, and the writer is full",
                remedy="Look at that reader: it keeps all samples but takes none, or cannot be reached",
            )

    def close(self) -> None:
        """Take it out of the space."""
        self.participant.close_child(self)

    def detach(self) -> None:
        """Let go of everything held."""
        super().detach()
        self.on_room = None


class DdsReader(CachingReader):
    """Keeps the samples of one topic until they are taken. See `muros.space.Reader`."""

    __slots__ = ("held", "source")

    participant: DdsParticipant

    def __init__(
        self,
        participant: DdsParticipant,
        topic: Topic,
        qos: Qos,
        gid: bytes,
        on_data: Callable[[Any], object] | None = None,
        service: str = "",
    ) -> None:
        super().__init__(participant, topic, qos, gid, on_data, service)
        self.type_hash = participant.home.type_hash(topic.type_name)
        self.held = False
        """Whether RTPS holds samples back because the cache is full."""
        self.source: rtps.LocalReader

    @property
    def matched(self) -> tuple[bytes, ...]:
        """Gids of the writers it reads from."""
        return () if self.closed else self.source.matched

    def came(self, received: Received) -> bool:
        """RTPS has a sample. False: no room, and what comes behind it waits too."""
        if self.closed or received.status:
            return True
        payload = received.payload
        if len(payload) < 4:
            self.unreadable("it has no encapsulation")
            return True
        sample = self.sample(received, payload)
        if sample is None:
            return True
        cache = self.cache
        if len(cache) < self.room:
            cache.append(sample)
            if not self.queued and len(cache) == 1:
                self.queued = True
                self.core.queue.append(self)
        elif self.refuses and self.full and not self._makes_room():
            self.held = True
            return False
        else:
            self.arrive(sample)
        core = self.core
        if core.queue and not core.draining:
            core.drain()
        return True

    def sample(self, received: Received, payload: bytes) -> Sample | None:
        """A sample as users take it; None when it is not for them."""
        pad = payload[3] & 3
        core = self.core
        expires = received.expires
        related = None if received.inline_qos is None else self.relation(received)
        return Sample(
            payload[4 : len(payload) - pad] if pad and len(payload) >= 4 + pad else payload[4:],
            core.clock() if received.source_time is None else received.source_time,
            received.writer,
            received.sequence,
            related,
            payload[0] << 8 | payload[1],
            0 if expires is None else core.timers.now() + expires - self.participant.home.now(),
        )

    def relieved(self) -> None:
        """A sample has left the cache: what RTPS holds back may come."""
        if self.held:
            self.held = False
            self.participant.home.resume(self)

    def connected(self, remote: bytes) -> None:
        """A writer matches."""

    def disconnected(self, remote: bytes) -> None:
        """A writer matches no more."""
        if self.deadline is not None and not self.matched:
            self.deadline.stop()

    def trouble(self, problem: Problem, remote: bytes, number: int) -> None:
        """Something went wrong between it and a writer."""
        if problem in _LOSSES:
            why, remedy, lost = _LOSSES[problem]
            if lost:
                self.lost += number
            name = self.participant.home.name_of(remote)
            self.core.report(
                "samples-lost",
                who=self.owner,
                subject=self.topic.name,
                what=f"{{n}} sample{{s}} of {self.topic.name} did not reach {self.owner}",
                why=why.format(name=name, number=number),
                remedy=remedy,
                n=number if lost else 1,
                severity=Severity.WARNING if self.source.qos.reliable else Severity.INFO,
            )

    def unreadable(self, why: str) -> None:
        """A sample is not what it should be."""
        tell = partial(self._tell_unreadable, why)
        self.core.count("sample-unreadable", self.owner, self.topic.name, tell)
        self.core.poke()

    def close(self) -> None:
        """Take it out of the space."""
        self.participant.close_child(self)

    def detach(self) -> None:
        """Let go of everything held."""
        super().detach()
        self.held = False

    def _makes_room(self) -> bool:
        self.purge()
        return not self.full

    def relation(self, received: Received) -> bytes | None:
        """What users are told that a sample is related to."""
        return self.related(received)

    def related(self, received: Received) -> bytes | None:
        """The identity that a sample says it is related to; None without a readable one."""
        try:
            return rtps.related_identity(received.inline_qos)
        except InvalidParameters:
            return None

    def _tell_unreadable(self, why: str, n: int) -> None:
        self.core.report(
            "sample-unreadable",
            who=self.owner,
            subject=self.topic.name,
            what=f"{{n}} sample{{s}} of {self.topic.name} could not be given to {self.owner}",
            why=why,
            remedy=f"Look at who writes {self.topic.name}",
            n=n,
        )


DdsEndpoint = DdsWriter | DdsReader

_LOSSES: Final = {
    Problem.SAMPLES_LOST: (
        "{name} no longer had them when they were asked for again",
        "Give the writer a greater depth, or let it write less often",
        True,
    ),
    Problem.SAMPLE_TOO_LARGE: (
        "{name} writes samples of {number} bytes, more than may be put together here",
        "Write smaller samples",
        False,
    ),
    Problem.INCOMPLETE: (
        "parts of large samples of {name} were lost on the way, and best effort asks for nothing again",
        "Make both sides reliable, or samples smaller",
        True,
    ),
}
"""Why samples did not come, what to do, and whether the number counts them."""
