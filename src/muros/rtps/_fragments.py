"""Samples larger than a datagram: cut into fragments, and put together again (DDSI-RTPS 2.3, 8.4.14).

All fragments of a sample but its last have the same size; they are numbered from 1. The receiving side holds what
has arrived, never what a peer only announces, so that a claim of 4 GB costs nothing.
"""

from typing import Final

from muros.rtps._wire import Data, DataFrag

__all__ = ["FRAGMENT_COST", "Assembly", "fragments_of"]

FRAGMENT_COST: Final = 100
"""Bytes of memory that one fragment takes besides its content (the bytes object and its place in a dictionary)."""


def fragments_of(size: int, fragment_size: int) -> int:
    """How many fragments a sample of `size` bytes has; at least 1."""
    return max(1, -(-size // fragment_size))


class Assembly:
    """A sample of which fragments have arrived. `total`: fragments it has; `cost`: bytes of memory it takes."""

    __slots__ = ("_first", "_lowest", "_parts", "cost", "since", "total")

    def __init__(self, first: DataFrag, now: int) -> None:
        """`first`: any of its fragments; it still has to be given to `add`."""
        self.total: Final = fragments_of(first.sample_size, first.fragment_size)
        self.since = now
        self.cost = 0
        self._first = first._replace(payload=b"")
        self._lowest = 1
        self._parts: dict[int, bytes] = {}

    def fits(self, fragment: DataFrag) -> bool:
        """Whether the fragment's description of the sample is that of the others."""
        first = self._first
        return fragment.sample_size == first.sample_size and fragment.fragment_size == first.fragment_size

    def add(self, fragment: DataFrag) -> int:
        """Keep what is new of it; returns how many bytes of memory that took (0: nothing was new)."""
        parts, payload, size = self._parts, fragment.payload, fragment.fragment_size
        number, before = fragment.first_fragment, self.cost
        if fragment.fragments_in == 1:
            if number not in parts:
                parts[number] = payload
                self.cost += len(payload) + FRAGMENT_COST
        else:
            for i in range(fragment.fragments_in):
                if number + i not in parts:
                    part = parts[number + i] = payload[i * size : (i + 1) * size]
                    self.cost += len(part) + FRAGMENT_COST
        if fragment.inline_qos is not None and self._first.inline_qos is None:
            self._first = self._first._replace(inline_qos=fragment.inline_qos)  # some send them in one only
        return self.cost - before

    def complete(self) -> bool:
        """Whether all fragments are there."""
        return len(self._parts) == self.total

    def missing(self, limit: int, last: int | None = None) -> list[int]:
        """Fragments not there up to `last` (None: all), all of them less than `limit` above the first."""
        parts, first = self._parts, self._lowest
        end = self.total if last is None else min(last, self.total)
        while first in parts:
            first += 1
        self._lowest = first
        return [number for number in range(first, min(end + 1, first + limit)) if number not in parts]

    def sample(self) -> Data:
        """The complete sample, as if it had come in one piece."""
        first, parts = self._first, self._parts
        return Data(
            first.source,
            first.destination,
            first.time,
            first.reader,
            first.writer,
            first.sequence,
            b"".join([parts[number] for number in range(1, self.total + 1)]),
            first.inline_qos,
            first.key,
        )
