"""A participant of ours that has gone says so more than once, and does not come back while it does.

Farewells get lost, and some peers hear multicast and unicast in threads of their own, and so a new announcement before
an old farewell. They would go on with the old life of a GUID that has come back, whose state is not that of the new
one: what is said to them is old news, what they say makes no sense, and each announcement renews the lease.
"""

from collections.abc import Callable
from typing import Final

from muros.rtps._agenda import Timed
from muros.rtps._endpoint import MILLISECOND, NEVER

__all__ = ["Farewell"]

AGAIN: Final = (30 * MILLISECOND, 60 * MILLISECOND)
"""When after the first farewell it is said again."""

OVER: Final = 100 * MILLISECOND
"""When the participant may come back."""


class Farewell(Timed):
    """say: tells those known, once more. on_end: called when it is over."""

    __slots__ = ("_on_end", "_say", "_times")

    def __init__(self, say: Callable[[], object], on_end: Callable[[int], object], now: int) -> None:
        super().__init__()
        self._say = say
        self._on_end = on_end
        self._times = [*(now + offset for offset in AGAIN), now + OVER]

    @property
    def begin(self) -> int:
        """When it is to be woken first."""
        return self._times[0]

    def wake(self, now: int) -> int:
        while self._times and self._times[0] <= now:
            del self._times[0]
        if self._times:
            self._say()
            return self._times[0]
        self._on_end(now)
        return NEVER
