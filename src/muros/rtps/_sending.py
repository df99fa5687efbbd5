"""How samples become submessages, and how much of them leaves a writer at once: an allowance of bytes, a window of what
is on its way, and submessages that share a datagram."""

from collections.abc import Iterable, Iterator
from typing import Final

from muros.rtps._endpoint import Place, Send
from muros.rtps._history import Sample
from muros.rtps._reader_proxy import ReaderProxy
from muros.rtps._values import EntityId, GuidPrefix
from muros.rtps._wire import data_frag, data_pieces, gap, info_dst, split_numbers

__all__ = ["Allowance", "Packet", "Window", "data_of", "fragment_of", "gaps", "skips_of"]

OVERHEAD: Final = 768
"""Bytes that a sample counts for besides its own: receivers' buffers hold more than what is sent."""

WINDOW_LEAST: Final = 65536
"""However much is lost, so many bytes may be on their way."""

WINDOW_FIRST: Final = 192 * 1024
"""And so many to begin with."""

GROWTH: Final = 8
"""The window grows by this part of what arrives."""

SKIPS_MOST: Final = 24
"""GAPs to several readers at one place that share a datagram."""

CHECKPOINTS_MOST: Final = 64
"""Samples remembered that have asked for acknowledgement; of more the newest stands for those before it."""


class Allowance:
    """`burst` bytes may be sent at any time, and again after `pace` ns.

    What is sent while anything is left may overdraw it; the debt is paid before more is allowed.
    """

    __slots__ = ("_left", "_pace", "_since", "burst")

    def __init__(self, burst: int, pace: int) -> None:
        self.burst = burst
        """May be changed."""
        self._pace = pace
        self._left = burst
        self._since = 0

    def allows(self, now: int) -> bool:
        """Whether something may be sent."""
        if self._left <= 0:
            earned = (now - self._since) * self.burst // self._pace
            if earned > 0:
                self._left = min(self.burst, self._left + earned)
                self._since = now
        elif self._left == self.burst:
            self._since = now
        return self._left > 0

    def spend(self, size: int) -> None:
        """`size` bytes were sent."""
        self._left -= size


class Window:
    """How many bytes may be on their way to readers that acknowledge: more while they keep up, fewer when any get lost.

    So a writer is as quick as its slowest reader takes samples, and no receiver's buffer runs over for long.
    """

    __slots__ = ("_arrived", "_asked", "_cut", "_most", "_moved", "ask", "end", "out", "size")

    def __init__(self, most: int) -> None:
        self._most = most
        self.size = min(WINDOW_FIRST, most)
        """Bytes that may be on their way now."""
        self._moved = 0
        self._arrived = 0
        self._asked: list[tuple[int, int]] = []
        self._cut = 0
        self.out = 0
        """Bytes that have left, all in all; who sends adds to it."""
        self.end = self.size
        """Up to here they may leave without regard to anything else."""
        self.ask = self.size // 2
        """From here on acknowledgement is to be asked for."""

    @property
    def awaits(self) -> bool:
        """Whether acknowledgement was asked for that has not come."""
        return bool(self._asked)

    def asked(self, number: int, now: int) -> None:
        """The sample `number`, the last one that left, asks for acknowledgement."""
        if not self._asked:
            self._moved = now
        if len(self._asked) >= CHECKPOINTS_MOST:
            self._asked.pop()
        self._asked.append((number, self.out))
        self.ask = self.out + self.size // 2

    def waits(self, now: int, patience: int) -> int:
        """How long nothing more may leave, 0 = it may now. One that stays shut opens by itself after `patience`."""
        if self.out < self.end:
            return 0
        left = self._moved + patience - now
        if left > 0:
            return left
        self._moved = now
        self.end = self.out + self.size
        return 0

    def acknowledged(self, number: int, now: int) -> None:
        """All readers have everything up to the sample `number`."""
        arrived = self._arrived
        while self._asked and self._asked[0][0] <= number:
            arrived = self._asked.pop(0)[1]
        self._slide(arrived, arrived - self._arrived, now)

    def completed(self, now: int) -> None:
        """All readers have everything that has left."""
        self._asked.clear()
        self._slide(self.out, self.out - self._arrived, now)

    def reset(self, now: int) -> None:
        """There is nobody left who has not got everything."""
        self._asked.clear()
        self._slide(self.out, 0, now)

    def lost(self, now: int, pause: int) -> None:
        """Something got lost; what is lost within `pause` after that has the same cause."""
        if now - self._cut >= pause:
            self._cut = now
            self.size = max(min(WINDOW_LEAST, self._most), self.size // 2)
            self.end = self._arrived + self.size

    def _slide(self, arrived: int, grown: int, now: int) -> None:
        self.size = min(self._most, self.size + grown // GROWTH)
        self._arrived = arrived
        self._moved = now
        self.end = arrived + self.size
        self.ask = min(self.ask, self.out + self.size // 2)


class Packet:
    """Submessages for one participant, or for everybody, sent together as long as they fit a datagram."""

    __slots__ = ("_destination", "_filled", "_places", "_send", "_submessages", "size")

    def __init__(
        self, send: Send, destination: GuidPrefix | None, places: tuple[Place, ...], size: int
    ) -> None:
        self.size = size
        self._send = send
        self._destination = destination
        self._places = places
        self._submessages: list[bytes] = []
        self._filled = 0

    def add(self, *submessages: bytes) -> None:
        """These go into one datagram, the one begun or the next."""
        size = sum(map(len, submessages))
        if self._submessages and self._filled + size > self.size:
            self.flush()
        self._submessages += submessages
        self._filled += size

    def flush(self) -> None:
        """Send what was begun."""
        if self._submessages:
            for place in self._places:
                self._send(self._submessages, self._destination, place)
            self._submessages = []
            self._filled = 0


def gaps(reader: EntityId, writer: EntityId, gone: list[int]) -> list[bytes]:
    """GAPs for these rising numbers: as few as they fit (DDSI-RTPS 2.3, 8.3.7.4)."""
    submessages = []
    for base, numbers in split_numbers(gone):
        end = base + 1
        while end - base < len(numbers) and numbers[end - base] == end:
            end += 1
        submessages.append(gap(reader, writer, base, end, numbers[end - base :]))
    return submessages


def data_of(sample: Sample, reader: EntityId, writer: EntityId) -> tuple[bytes, ...]:
    """The DATA of a sample that fits one, in pieces: joined once, with all else that goes into the datagram."""
    return data_pieces(
        reader, writer, sample.sequence, sample.pieces, sample.size, sample.inline_qos, sample.key
    )


def fragment_of(sample: Sample, number: int, size: int, reader: EntityId, writer: EntityId) -> bytes:
    """The DATA_FRAG with one fragment of a sample, all of `size` bytes but the last; `number` counts from 1."""
    payload = sample.payload
    part = payload[(number - 1) * size : number * size]
    return data_frag(
        reader, writer, sample.sequence, number, 1, size, sample.size, part,
        inline_qos=sample.inline_qos, key=sample.key,
    )  # fmt: skip


def skips_of(
    sample: Sample, proxies: Iterable[ReaderProxy], writer: EntityId
) -> Iterator[tuple[Place, list[bytes]]]:
    """GAPs that tell all reliable readers but the one a sample is for not to wait for it: by place, a datagram each."""
    told: dict[Place, list[bytes]] = {}
    for proxy in proxies:
        if proxy.reliable and not sample.is_for(proxy.key):
            skip = gap(proxy.entity, writer, sample.sequence, sample.sequence + 1)
            for place in proxy.places:
                told.setdefault(place, []).append(info_dst(proxy.prefix) + skip)
    for place, skips in told.items():
        for start in range(0, len(skips), SKIPS_MOST):
            yield place, skips[start : start + SKIPS_MOST]
