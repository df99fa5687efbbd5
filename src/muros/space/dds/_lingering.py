"""Participants that have left and may come again: boards that begin a new session.

Peers know a participant by its prefix. One that leaves and comes again at once under the same prefix confuses them:
they hear its departure after its return, or not at all, and go on with what they knew of its former life. So one with
a key withdraws its endpoints and its node when it closes, which is reliable and in order, but stays as a participant
for a while. If its key comes again by then, the new life takes it over, and finds everybody met already.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from muros.rtps import LocalWriter, ParticipantCore
from muros.space._timers import Timer

if TYPE_CHECKING:
    from muros.space.dds._domain import DdsDomain
    from muros.space.dds._participant import DdsParticipant

__all__ = ["Former", "Lingering"]

LINGER: Final = 1_000_000_000
"""ns that a participant stays after it was closed."""


class Former(NamedTuple):
    """What is left of a participant that has closed."""

    rtps: ParticipantCore
    told: LocalWriter | None
    """Its writer of `ros_discovery_info`, if it was a node."""
    until: int


class Lingering:
    """The participants of a domain that may come again."""

    def __init__(self, home: DdsDomain) -> None:
        self._home = home
        self._former: dict[bytes, Former] = {}
        self._timer: Timer | None = None

    def keep(self, participant: DdsParticipant) -> None:
        """It has closed, and its endpoints are withdrawn."""
        participant.rtps.on_event = None
        until = self._home.core.timers.now() + LINGER
        self._former[participant.gid[:12]] = Former(participant.rtps, participant.told, until)
        if self._timer is None:
            self._timer = self._home.core.timers.at(until, self._look)

    def take(self, prefix: bytes) -> Former | None:
        """Its key has come again: what is left of it, if it is still there."""
        return self._former.pop(prefix, None)

    def close(self) -> None:
        """The space closes: they do not come again."""
        if self._timer is not None:
            self._home.core.timers.cancel(self._timer)
            self._timer = None
        self._former.clear()

    def _look(self) -> None:
        """Let those go that did not come again. They lie in the order in which they left."""
        self._timer = None
        home = self._home
        now = home.core.timers.now()
        for prefix, former in list(self._former.items()):
            if former.until > now:
                self._timer = home.core.timers.at(former.until, self._look)
                break
            del self._former[prefix]
            former.rtps.close(home.now())
        home.poke()
