"""Readers of the local space: caches that writers fill."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from muros.space._cache import CachingReader
from muros.space._qos import Qos
from muros.space._values import Sample, Topic
from muros.space.local._pressure import Pressure

if TYPE_CHECKING:
    from muros.space.local._participant import LocalParticipant
    from muros.space.local._writer import LocalWriter

__all__ = ["LocalReader"]


class LocalReader(CachingReader):
    """Keeps the samples of one topic until they are taken. See `muros.space.Reader`."""

    __slots__ = ("pressure",)

    participant: LocalParticipant

    def __init__(
        self,
        participant: LocalParticipant,
        topic: Topic,
        qos: Qos,
        gid: bytes,
        on_data: Callable[[Any], object] | None = None,
        service: str = "",
    ) -> None:
        super().__init__(participant, topic, qos, gid, on_data, service)
        self.pressure = Pressure(self) if self.refuses else None

    @property
    def matched(self) -> tuple[bytes, ...]:
        """Gids of the writers it reads from."""
        return tuple(writer.gid for writer in self.writers)

    @property
    def writers(self) -> list[LocalWriter]:
        """The writers it reads from (kept by them, not here: reading this is rare, endpoints are many)."""
        if self.closed:
            return []
        return [w for w in self.participant.record(self.topic).writers if w.reaches(self)]

    @property
    def client_gid(self) -> bytes:
        """For a reader of replies, the gid its requests are written with; empty for all others."""
        return b""

    @property
    def carries_requests(self) -> bool:
        """Whether it is a server's."""
        return bool(self.service) and not self.client_gid

    def catch_up(self, samples: Sequence[Sample]) -> None:
        """Take in a writer's history: the newest that fit."""
        for sample in samples[-self.limit :]:
            if self.full and not self.qos.keeps_all:
                self.cache.popleft()
            self.arrive(sample)

    def relieved(self) -> None:
        """A sample has left the cache: writers may try again."""
        if self.pressure is not None:
            self.pressure.relieve()

    def close(self) -> None:
        """Take it out of the space."""
        self.participant.close_child(self)

    def detach(self) -> None:
        """Let go of everything held."""
        super().detach()
        if self.pressure is not None:
            self.pressure.release()
