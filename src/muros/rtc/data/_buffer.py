"""A ring that several threads share, with writers and readers that wait as its policies say."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from muros.rtc.codes import BufferStatus
from muros.rtc.data._ring import EmptyPolicy, FullPolicy, Ring

__all__ = ["Buffer", "BufferOptions"]

T = TypeVar("T")

LENGTH: Final = 8
"""Values a buffer holds unless told otherwise."""

TIMEOUT: Final = 1.0
"""Seconds that a writer or reader waits unless told otherwise."""


@dataclass(frozen=True, slots=True)
class BufferOptions:
    """The `buffer.*` properties of one side of a connection."""

    length: int = LENGTH
    full_policy: FullPolicy = FullPolicy.OVERWRITE
    write_timeout: float = TIMEOUT
    """Seconds; 0 = for ever."""
    empty_policy: EmptyPolicy = EmptyPolicy.READBACK
    read_timeout: float = TIMEOUT
    """Seconds; 0 = for ever."""


class Buffer(Generic[T]):
    """One connector's values.

    `condition` may be shared by the buffers of one port: it is notified when a value comes, when room comes, and
    when a buffer is closed. Who waits in a closed buffer gets PRECONDITION_NOT_MET.
    """

    def __init__(
        self,
        options: BufferOptions,
        *,
        condition: threading.Condition | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.options: Final = options
        self.ring: Final[Ring[T]] = Ring(options.length, options.full_policy, options.empty_policy)
        self.condition: Final = condition or threading.Condition(threading.Lock())
        self.closed = False
        # What the lock has, without the steps between that cost as much as the rest of a write.
        self._acquire: Final = self.condition.acquire
        self._release: Final = self.condition.release
        self._blocks: Final = options.full_policy is FullPolicy.BLOCK
        self._clock = clock

    def write(self, value: T) -> tuple[BufferStatus, bool]:
        """Add `value`: OK, FULL, TIMEOUT, or PRECONDITION_NOT_MET of a closed one; and whether one was overwritten."""
        ring = self.ring
        self._acquire()
        try:
            if self._blocks and ring.full:
                status = self.wait(lambda: not ring.full, self.options.write_timeout)
                if status is not BufferStatus.OK:
                    return status, False
            if self.closed:
                return BufferStatus.PRECONDITION_NOT_MET, False
            before = ring.overwritten
            status = ring.put(value)
            if status is BufferStatus.OK and len(ring) == 1:  # nobody waits for one more
                self.condition.notify_all()
            return status, ring.overwritten != before
        finally:
            self._release()

    def read(self) -> tuple[BufferStatus, T | None]:
        """Take the oldest: OK, EMPTY, TIMEOUT, or PRECONDITION_NOT_MET of a closed one that has none."""
        with self.condition:
            ring = self.ring
            if not ring and self.options.empty_policy is EmptyPolicy.BLOCK:
                status = self.wait(lambda: len(ring) > 0, self.options.read_timeout)
                if status is not BufferStatus.OK:
                    return status, None
            was_full = ring.full
            taken = ring.take()
            if was_full:
                self.condition.notify_all()
            return taken

    def wait(self, ready: Callable[[], bool], timeout: float) -> BufferStatus:
        """With the condition held: wait until `ready`, for `timeout` seconds (0 or less = for ever)."""
        deadline = self._clock() + timeout if timeout > 0 else None
        while not ready():
            if self.closed:
                return BufferStatus.PRECONDITION_NOT_MET
            left = None if deadline is None else deadline - self._clock()
            if left is not None and left <= 0:
                return BufferStatus.TIMEOUT
            self.condition.wait(None if left is None else min(left, threading.TIMEOUT_MAX))
        return BufferStatus.OK

    def close(self) -> None:
        """Let nobody wait any longer. What is there can still be read."""
        with self.condition:
            self.closed = True
            self.condition.notify_all()
