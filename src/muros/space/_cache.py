"""The reader of all engines: a cache that the engine fills and the user empties.

An engine may append to `cache` itself as long as it holds fewer than `room` samples; everything else goes through
`arrive`. `room` stays 0 until the first sample has come (the cache is made then: an idle reader stays small) and
for readers that have to look at each sample.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, Final

from muros.findings import Severity
from muros.space._endpoint import EngineEndpoint, Home
from muros.space._graph import Role
from muros.space._qos import Qos, Reliability
from muros.space._values import Sample, Topic

__all__ = ["CachingReader"]

EMPTY: Final[deque[Sample]] = deque(maxlen=0)
"""The cache of all readers nothing has come to; it cannot be filled."""


class CachingReader(EngineEndpoint):
    """Keeps the samples of one topic until they are taken. See `muros.space.Reader`."""

    __slots__ = ("cache", "expired", "lost", "on_data", "queued", "room")

    role = Role.READER

    def __init__(
        self,
        participant: Home,
        topic: Topic,
        qos: Qos,
        gid: bytes,
        on_data: Callable[[Any], object] | None = None,
        service: str = "",
    ) -> None:
        super().__init__(participant, topic, qos, gid, service)
        self.cache = EMPTY
        self.room = 0
        self.on_data = on_data
        self.queued = on_data is None
        """Whether it need not be put into the queue: it is there already, or nobody wants to be told."""
        self.lost = 0
        self.expired = 0

    @property
    def refuses(self) -> bool:
        """Whether its writers wait when it is full: it is reliable and keeps all."""
        return self.qos.reliability == Reliability.RELIABLE and self.qos.keeps_all

    @property
    def pending(self) -> int:
        """Samples that can be taken now."""
        self.purge()
        return len(self.cache)

    def take(self) -> Sample | None:
        """The oldest sample, None if there is none."""
        cache = self.cache
        while cache:
            sample = cache.popleft()
            self.relieved()
            if sample.expires and sample.expires <= self.core.timers.now():
                self._count_expired(1)
                continue
            return sample
        return None

    def arrive(self, sample: Sample) -> None:
        """Put a sample into the cache, whatever has to be looked at first."""
        cache = self.cache
        if cache is EMPTY:
            cache = self.cache = deque()
            if self.deadline is None:
                self.room = self.limit
        if self.deadline is not None:
            self.deadline.touch()
        if self.full:
            self.purge()
        idle = not cache
        if self.full:
            self._count_lost()
            if self.qos.keeps_all:
                return
            cache.popleft()
        cache.append(sample)
        if idle and not self.queued:
            self.queued = True
            self.core.queue.append(self)

    def relieved(self) -> None:
        """A sample has left the cache: there may be room for those that wait."""

    @property
    def full(self) -> bool:
        """Whether no further sample fits."""
        return len(self.cache) >= self.limit

    def purge(self) -> None:
        """Drop the samples at the front whose lifespan is over."""
        cache, n = self.cache, 0
        while cache and cache[0].expires and cache[0].expires <= self.core.timers.now():
            cache.popleft()
            n += 1
        if n:
            self._count_expired(n)
            self.relieved()

    def run(self) -> None:
        """Tell the user that there is something to take."""
        self.queued = False
        if self.cache and self.on_data is not None:
            try:
                self.on_data(self)
            except Exception as error:
                self.core.failed(self.owner, self.on_data, error)

    def detach(self) -> None:
        """Let go of everything held."""
        super().detach()
        self.cache = EMPTY
        self.room = 0
        self.queued = True
        self.on_data = None

    def _count_expired(self, n: int) -> None:
        self.expired += n
        self.core.count("sample-expired", self.owner, self.topic.name, self._tell_expired, n)
        self.core.poke()

    def _tell_expired(self, n: int) -> None:
        self.core.report(
            "sample-expired",
            who=self.owner,
            subject=self.topic.name,
            what=f"{{n}} sample{{s}} of {self.topic.name} not given to {self.owner}",
            why="older than the lifespan set by the writer",
            remedy="Take them faster, or give the writer a longer lifespan",
            n=n,
        )

    def _count_lost(self) -> None:
        self.lost += 1
        code = "reader-full" if self.qos.keeps_all else "reader-too-slow"
        self.core.count(code, self.owner, self.topic.name, self._tell_lost)

    def _tell_lost(self, n: int) -> None:
        topic, reliable = self.topic.name, self.qos.reliability == Reliability.RELIABLE
        if self.qos.keeps_all:
            code = "reader-full"
            why = f"{self.limit} are waiting to be taken already"
            remedy = "Take them, or keep only the last ones"
        else:
            code = "reader-too-slow"
            kept = "the last one" if self.limit == 1 else f"the last {self.limit}"
            why = f"they come faster than they are taken, and only {kept} can wait"
            remedy = "Take them faster, write less often, or give the reader a greater depth"
        self.core.report(
            code,
            who=self.owner,
            subject=topic,
            what=f"{{n}} sample{{s}} of {topic} lost by the reader of {self.owner}",
            why=why,
            remedy=remedy,
            severity=Severity.WARNING if reliable else Severity.INFO,
            n=n,
        )
