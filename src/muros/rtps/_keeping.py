"""What a writer keeps of its samples, and when it has no room for one more.

A writer that keeps all holds samples until everybody has acknowledged them, and refuses new ones when its limits are
reached (DDS 1.4, 2.2.3.19: RESOURCE_LIMITS). One that keeps the last ones pushes out old ones instead, and refuses
only an instance for which no room is left. A reader that acknowledges nothing for `patience` while samples are refused
is set aside: it holds nobody any more. A writer with late readers to serve keeps what it has, acknowledged or not,
until room is needed.
"""

from collections.abc import Callable
from typing import Final

from muros.rtps._endpoint import NEVER, Problem
from muros.rtps._history import History, Sample
from muros.rtps._reader_proxy import ReaderProxy
from muros.rtps._settings import WriterSettings

__all__ = ["Keeper"]


class Keeper:
    """Keeps the samples of one writer in `history`.

    lagging: the reliable readers that have not acknowledged everything, kept up to date by the writer. retains: late
    readers get what is kept. lifespan: samples are forgotten when older (ns); 0 = none. tell: takes problems with
    readers. on_room: called when samples are accepted again after one was refused.
    """

    __slots__ = (
        "_is_limited", "_lagging", "_on_room", "_refused", "_refused_at", "_settings", "_tell", "history", "lifespan",
        "retains",
    )  # fmt: skip

    def __init__(
        self,
        depth: int | None,
        lagging: dict[ReaderProxy, None],
        settings: WriterSettings,
        *,
        retains: bool,
        lifespan: int,
        tell: Callable[[Problem, ReaderProxy, int], None],
        on_room: Callable[[], object] | None,
    ) -> None:
        self.history: Final = History(depth)
        self.retains: Final = retains
        self.lifespan: Final = lifespan
        self._lagging = lagging
        self._settings = settings
        self._tell = tell
        self._on_room = on_room
        self._is_limited = settings.limit_of_one > 0  # beside the limit of all
        self._refused: bytes | None = None  # the instance a sample of which was refused, ...
        self._refused_at = 0  # ... and when

    def acknowledged(self, sent: int) -> int:
        """All readers that are not set aside have everything up to this one; `sent`: the last one that has left."""
        return min((proxy.acked for proxy in self._lagging if not proxy.aside), default=sent)

    def lowest(self, sent: int) -> int:
        """The first sample that can be had: one kept, or the next to be written."""
        first = self.history.first()
        return sent + 1 if first is None else min(first, sent + 1)

    def add(self, sample: Sample, sent: int, now: int) -> bool:
        """Keep a sample; False = there is no room, and `on_room` will be called when there is."""
        if self.lifespan:
            sample.expires = now + self.lifespan
            self.history.expire(now)
        history = self.history
        if (self._is_limited or len(history) >= self._settings.limit) and not self._admits(sample, sent, now):
            return False
        history.add(sample)
        return True

    def release(self, sent: int, now: int) -> None:
        """Readers have acknowledged or gone: forget what is no longer needed, and say that there is room."""
        if self.retains:
            if self.history.ends:
                self.history.end_to(self.acknowledged(sent))
        else:
            self.history.drop_to(self.acknowledged(sent))
        self.retry(sent, now)

    def retry(self, sent: int, now: int) -> None:
        """Say that there is room, if a sample was refused and would not be now."""
        if self._refused is not None and self._make_room(self._refused, sent, now):
            self._refused = None
            if self._on_room is not None:
                self._on_room()

    def expire(self, now: int) -> int:
        """Forget what has outlived its lifespan; when to look again."""
        return self.history.expire(now) if self.lifespan else NEVER

    def patience_ends(self) -> int:
        """When the next reader may be set aside, `NEVER` while nothing is refused."""
        if self._refused is None:
            return NEVER
        return min((self._tolerated(proxy) for proxy in self._lagging if not proxy.aside), default=NEVER)

    # --- Helpers -----------------------------------------------------------------------------------------

    def _admits(self, sample: Sample, sent: int, now: int) -> bool:
        """Whether there is room, after looking closely."""
        instance = sample.instance
        # What ends an instance makes room sooner or later.
        if not self._is_full(instance) or (sample.key and self.history.depth is not None):
            return True
        if self._make_room(instance, sent, now):
            return True
        if self._refused is None:
            self._refused = instance
            self._refused_at = now
        return False

    def _is_full(self, instance: bytes) -> bool:
        settings, history = self._settings, self.history
        if history.depth is None:
            return len(history) >= settings.limit or self._is_one_full(instance)
        # A sample of an instance that has as many as are kept of each pushes one out.
        return settings.strict and len(history) >= settings.limit and history.count(instance) < history.depth

    def _is_one_full(self, instance: bytes) -> bool:
        limit = self._settings.limit_of_one
        return limit > 0 and self.history.count(instance) >= limit

    def _make_room(self, instance: bytes, sent: int, now: int) -> bool:
        """Whether one more sample can be kept, after forgetting what need not be kept."""
        if not self._is_full(instance):
            return True
        self._drop_acknowledged(instance, sent)
        if self._is_full(instance):
            for proxy in self._lagging:
                if self._refused is not None and not proxy.aside and now >= self._tolerated(proxy):
                    proxy.aside = True
                    self._tell(Problem.READER_STALLED, proxy, sent - proxy.acked)
            self._drop_acknowledged(instance, sent)
        return not self._is_full(instance)

    def _drop_acknowledged(self, instance: bytes, sent: int) -> None:
        """Forget samples everybody has: all of them, or one when they are kept for late readers."""
        history, acknowledged = self.history, self.acknowledged(sent)
        if not self.retains:
            history.drop_to(acknowledged)
        elif history.depth is None:
            if self._is_one_full(instance):
                history.drop_one(instance, acknowledged)
            elif (first := history.first()) is not None and first <= acknowledged:
                history.drop_to(first)

    def _tolerated(self, proxy: ReaderProxy) -> int:
        """Until when a reader may hold the writer: it is given time from the first sample that was refused."""
        return max(proxy.since, self._refused_at) + self._settings.patience
