"""Who is alive: of others' writers, by what is heard of them; of our own, by saying so (DDSI-RTPS 2.3, 8.4.13, 8.7.2).

A writer has a lease and a kind of liveliness. AUTOMATIC: its participant says it is alive, all by itself, and so does
anything else that comes from it. MANUAL_BY_PARTICIPANT: the user of any such writer says so for all of the
participant. MANUAL_BY_TOPIC: for this one, by a sample or a HEARTBEAT with a flag. The first two travel as samples
of the participant message topic (`Assertion`). A lease without end needs nothing of this.
"""

from collections.abc import Callable, Iterable
from typing import Final

from muros.rtps._agenda import Agenda, Timed
from muros.rtps._endpoint import NEVER
from muros.rtps._peer import Peer
from muros.rtps._qos import Liveliness
from muros.rtps._values import INFINITE, Guid

__all__ = ["Assertions", "OwnLease", "WriterLease"]

SHARE: Final = 3
"""Liveliness is said this often within a lease, so that one message may be lost."""


class WriterLease(Timed):
    """Whether a writer of somebody else is alive, as the readers of one participant of ours want to know."""

    __slots__ = ("_agenda", "_on_change", "_peer", "alive", "guid", "kind", "lease", "readers", "seen")

    def __init__(
        self,
        guid: Guid,
        kind: Liveliness,
        lease: int,
        peer: Peer,
        agenda: Agenda,
        on_change: Callable[["WriterLease"], object],
        now: int,
    ) -> None:
        super().__init__()
        self.guid: Final = guid
        self.kind = kind
        self.lease = lease
        self.seen = now
        self.alive = True
        self.readers: dict[Guid, None] = {}
        """Ours that are matched with it."""
        self._peer = peer
        self._agenda = agenda
        self._on_change = on_change
        agenda.at(self, now + lease)

    def touch(self, now: int) -> None:
        """It was heard of."""
        self.seen = now
        if not self.alive:
            self.alive = True
            self._agenda.at(self, now + self.lease)
            self._on_change(self)

    def wake(self, now: int) -> int:
        if self.kind == Liveliness.AUTOMATIC:
            self.seen = max(self.seen, self._peer.seen)
        if not self.readers or not self.alive:
            return NEVER
        if now - self.seen < self.lease:
            return self.seen + self.lease
        self.alive = False
        self._on_change(self)
        return NEVER


class OwnLease(Timed):
    """Whether a writer of ours with manual liveliness says in time that it is alive."""

    __slots__ = ("_agenda", "_lease", "_on_change", "alive", "seen", "total")

    def __init__(
        self, lease: int, agenda: Agenda, on_change: Callable[[bool, int], object], now: int
    ) -> None:
        """`on_change` is told whether it is alive, and how often it was not."""
        super().__init__()
        self._lease = lease
        self._agenda = agenda
        self._on_change = on_change
        self.seen = now
        self.alive = True
        self.total = 0
        agenda.at(self, now + lease)

    def touch(self, now: int) -> None:
        """It was asserted."""
        self.seen = now
        if not self.alive:
            self.alive = True
            self._agenda.at(self, now + self._lease)
            self._on_change(True, self.total)

    def wake(self, now: int) -> int:
        if now - self.seen < self._lease:
            return self.seen + self._lease
        self.alive = False
        self.total += 1
        self._on_change(False, self.total)
        return NEVER


class Assertions(Timed):
    """Says for a participant of ours that its writers of one kind are alive.

    manual: only when `asserted`, at most as often as needed; else all the time. say: sends the message.
    """

    __slots__ = ("_agenda", "_asserted", "_leases", "_manual", "_said", "_say")

    def __init__(self, manual: bool, agenda: Agenda, say: Callable[[bool, int], object]) -> None:
        super().__init__()
        self._manual = manual
        self._agenda = agenda
        self._say = say
        self._leases: tuple[int, ...] = ()
        self._asserted = False
        self._said = -NEVER

    @property
    def _period(self) -> int:
        return min(self._leases) // SHARE

    def watch(self, leases: Iterable[int], now: int) -> None:
        """The leases of the writers of this kind; those without end do not count."""
        self._leases = tuple(lease for lease in leases if lease < INFINITE)
        if self._leases and not self._manual:
            self._agenda.at(self, max(now, self._said + self._period))

    def asserted(self, now: int) -> None:
        """Somebody says that the participant is alive."""
        if not self._leases or self._asserted:
            return
        self._asserted = True
        at = self._said + self._period
        if at <= now:
            self.wake(now)
        else:
            self._agenda.at(self, at)

    def wake(self, now: int) -> int:
        if not self._leases or not (self._asserted or not self._manual):
            return NEVER
        self._asserted = False
        self._said = now
        self._say(self._manual, now)
        return NEVER if self._manual else now + self._period
