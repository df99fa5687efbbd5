"""What a board is sent, in which order and how fast: what is urgent first, then its topics in turn.

A line whose rate is known is written at most `lead` milliseconds ahead, so that what is urgent never waits behind
a backlog. Others are written while the system takes it at once. What a line has no room for stays where it is,
messages in their readers; when it has had none for long, newer ones replace older ones.
"""

from collections import deque
from collections.abc import Callable, Hashable
from typing import Any, Protocol

__all__ = ["Link", "Output", "Source"]

_STALL = 100
"""A line that does not keep up for so long is too slow for what waits: of each topic the newest stay, in ms."""
_POLL = 20
"""When to look again at a line that takes nothing now, in ms; the link says it earlier if it can."""
_SLACK = 1.005
"""How much slower than its rate a line is written, as clocks of lines differ: what is too fast would pile up."""
_BATCH = 2048
"""Bytes that are handed over at once, so that many small frames cost one call of the system."""


class Link(Protocol):
    """What the server needs of a link."""

    @property
    def name(self) -> str:
        """The link in words."""

    def send(self, message: bytes, address: Any) -> bool:
        """Sends bytes to a peer."""

    def backlog(self, address: Any) -> int:
        """Bytes that wait for a peer in this program."""


class Source(Protocol):
    """A topic that a board reads."""

    def next(self, now: int) -> bytes | None:
        """The next frame for the board, None if there is none now."""

    def hurry(self) -> None:
        """Lets what is old go."""


class Output:
    """The way to one board. ``byte_us``: microseconds that a byte takes on the line, 0 if unknown; ``lead`` in ms.

    Counters: ``frames`` and ``bytes`` sent, ``dropped`` frames that found no room.
    """

    def __init__(self, link: Link, address: Hashable, byte_us: float, lead: int, room: int) -> None:
        self.link = link
        self.address = address
        self.byte_us = byte_us
        self.frames = 0
        self.bytes = 0
        self.dropped = 0
        self.holds = True
        """Whether topics have to wait: the board is not in sync."""
        self._lead_us = 1000 * lead
        self._room = room
        self._urgent: deque[bytes | Callable[[int], bytes]] = deque()
        self._ready: deque[Source] = deque()
        self._free_us = 0.0
        self._full_since: int | None = None
        self._ended = False

    def post(self, frame: bytes | Callable[[int], bytes]) -> bool:
        """Has a frame sent before all topics, one made by ``frame(now)`` when its turn has come; False if many wait."""
        if self._ended or len(self._urgent) >= self._room:
            self.dropped += 1
            return False
        self._urgent.append(frame)
        return True

    def add(self, source: Source) -> None:
        """A topic has something; it is asked for it until it has nothing."""
        self._ready.append(source)

    def remove(self, source: Source) -> None:
        """A topic is gone."""
        if source in self._ready:
            self._ready.remove(source)

    def clear(self) -> None:
        """Forgets what is urgent: the line is gone, or new."""
        self._urgent.clear()
        self._free_us = 0.0
        self._full_since = None
        self._ended = False

    def end(self, frame: bytes) -> None:
        """Hands over a last frame, whatever is on the line; nothing goes after it until `clear`."""
        self._urgent.clear()
        self._ended = True
        self._hand_over([frame], len(frame))

    def pump(self, now: int) -> int | None:
        """Sends what can be sent at ``now``; returns when to call again if something is left."""
        urgent, ready = self._urgent, self._ready
        now_us = 1000 * now
        while urgent or (ready and not (self.holds or self._ended)):
            if self._free_us > now_us + self._lead_us:
                return now + max(1, int(self._free_us - now_us - self._lead_us) // 1000)
            if self.link.backlog(self.address):
                if self._full_since is None:
                    self._full_since = now
                return now + _POLL
            if self._full_since is not None and now - self._full_since >= _STALL:
                for source in tuple(ready):
                    source.hurry()
            batch, n = self._batch(now, now_us)
            if not batch:
                break
            self._free_us = max(self._free_us, now_us) + n * self.byte_us * _SLACK
            self._hand_over(batch, n)
        self._full_since = None
        return None

    def _hand_over(self, batch: list[bytes], n: int) -> None:
        if self.link.send(batch[0] if len(batch) == 1 else b"".join(batch), self.address):
            self.frames += len(batch)
            self.bytes += n
        else:
            self.dropped += len(batch)

    def _batch(self, now: int, now_us: int) -> tuple[list[bytes], int]:
        """The next frames to send, and their bytes: as many as are worth one call, and the line is free for."""
        urgent, ready = self._urgent, self._ready
        batch: list[bytes] = []
        n = 0
        free_us = max(self._free_us, now_us)
        while n < _BATCH and free_us + n * self.byte_us <= now_us + self._lead_us:
            frame: bytes | None
            if urgent:
                first = urgent.popleft()
                frame = first if isinstance(first, bytes) else first(now)
            elif ready and not (self.holds or self._ended):
                source = ready.popleft()
                frame = source.next(now)
                if frame is None:
                    continue
                ready.append(source)
            else:
                break
            assert frame is not None
            batch.append(frame)
            n += len(frame)
        return batch, n
