"""A ring of values with the policies of OpenRTM-aist's buffers: pure, never waits, knows no thread.

Values are numbered as they come: who sends the oldest one without holding a lock meanwhile drops it by its number
afterwards, and drops nothing that came in its place.
"""

from __future__ import annotations

from collections import deque
from enum import Enum
from typing import Final, Generic, TypeVar

from muros.rtc.codes import BufferStatus

__all__ = ["EmptyPolicy", "FullPolicy", "Ring"]

T = TypeVar("T")


class FullPolicy(Enum):
    """What a full ring does with one more value: `buffer.write.full_policy`."""

    OVERWRITE = "overwrite"
    """Drops the oldest."""
    DO_NOTHING = "do_nothing"
    """Refuses it."""
    BLOCK = "block"
    """Lets the writer wait for room."""


class EmptyPolicy(Enum):
    """What an empty ring gives: `buffer.read.empty_policy`."""

    READBACK = "readback"
    """The value that was taken last, again."""
    DO_NOTHING = "do_nothing"
    """None."""
    BLOCK = "block"
    """Lets the reader wait for one."""


class Ring(Generic[T]):
    """At most `length` values, oldest first."""

    def __init__(
        self,
        length: int,
        full_policy: FullPolicy = FullPolicy.OVERWRITE,
        empty_policy: EmptyPolicy = EmptyPolicy.READBACK,
    ) -> None:
        if length < 1:
            raise ValueError(f"a ring holds at least 1 value, not {length}")
        self.length: Final = length
        self.full_policy: Final = full_policy
        self.empty_policy: Final = empty_policy
        self.overwritten = 0
        """Values that had to make room."""
        self._values: deque[T] = deque()
        self._first = 0
        self._last: T | None = None

    def __len__(self) -> int:
        return len(self._values)

    @property
    def full(self) -> bool:
        return len(self._values) >= self.length

    @property
    def last(self) -> T | None:
        """The value that was taken last."""
        return self._last

    def put(self, value: T) -> BufferStatus:
        """Add `value`. FULL: it was not taken, and the writer waits or gives up, as the policy says."""
        if len(self._values) >= self.length:
            if self.full_policy is not FullPolicy.OVERWRITE:
                return BufferStatus.FULL
            self._values.popleft()
            self._first += 1
            self.overwritten += 1
        self._values.append(value)
        return BufferStatus.OK

    def take(self) -> tuple[BufferStatus, T | None]:
        """The oldest value, removed. An empty ring that reads back gives the last one with OK, any other EMPTY."""
        if self._values:
            self._first += 1
            self._last = value = self._values.popleft()
            return BufferStatus.OK, value
        if self.empty_policy is EmptyPolicy.READBACK and self._last is not None:
            return BufferStatus.OK, self._last
        return BufferStatus.EMPTY, None

    def peek(self) -> tuple[int, T] | None:
        """The oldest value with its number; it stays. None: there is none."""
        return (self._first, self._values[0]) if self._values else None

    def drop(self, count: int) -> None:
        """Remove the `count` oldest values."""
        for _ in range(min(count, len(self._values))):
            self._values.popleft()
            self._first += 1

    def drop_through(self, number: int) -> None:
        """Remove what is as old as the value of this number, or older. It becomes the last one where it still stood."""
        if number >= self._first and self._values:
            self.drop(number - self._first)
            if self._values:
                self.take()

    def forget_last(self) -> None:
        """Read back nothing until another value was taken."""
        self._last = None

    def clear(self) -> None:
        """Remove all, the last one too."""
        self._first += len(self._values)
        self._values.clear()
        self._last = None
