"""Says that a participant of ours is there (DDSI-RTPS 2.3, 8.5.3: the simple participant discovery protocol).

One participant of a process does so often in its first second, then with a steady period, to all addresses known in
advance; the others once, to groups. All do it to the participants that are known, where they listen, often enough for
the lease; and at once to each that is met, unless another one at the same place has just been told. Announcements have
no acknowledgement: what is lost is said again. To one just met it is said again soon, unless it talks to us meanwhile:
it may have begun to listen only after our answer.
"""

from collections.abc import Callable, Iterable
from itertools import islice
from typing import Final

from muros.rtps._agenda import Agenda, Timed
from muros.rtps._constants import ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER
from muros.rtps._discovery_data import ParticipantData, departure
from muros.rtps._domain_settings import DomainSettings
from muros.rtps._endpoint import MILLISECOND, NEVER, SECOND, Send
from muros.rtps._peer import Peer
from muros.rtps._reach import is_multicast
from muros.rtps._values import GuidPrefix, Locator
from muros.rtps._wire import data as data_submessage

__all__ = ["Announcer", "Welcome"]

SHARE: Final = 5
"""Announcements within a lease, at least: some may be lost."""

AGAIN: Final = (100 * MILLISECOND, 400 * MILLISECOND, SECOND)
"""When after it was met a participant that does not talk to us is told again that we are there."""

PAUSE: Final = 50 * MILLISECOND
"""Participants at one place hear each other's mail: so soon after it was told, it is not told again."""

NEIGHBOURS_MOST: Final = 8
"""Participants of another process that are asked whether they know of ours; else one more is told, which is no harm."""

PLACES_MOST: Final = 1024
"""Places remembered for that."""


class Announcer(Timed):
    """Announces one participant; put it on the agenda to make it begin.

    Of the participants of a process one leads: it announces itself again and again to those not known yet. Who hears
    it answers, is known by that, and is told of all the others.
    """

    __slots__ = (
        "_anew", "_burst", "_changed", "_content", "_data", "_leads", "_number", "_period", "_send", "_sequence",
        "_settings", "_told", "_told_at", "announce_to", "peers",
    )  # fmt: skip

    def __init__(
        self,
        data: ParticipantData,
        send: Send,
        settings: DomainSettings,
        announce_to: tuple[Locator, ...],
        peers: dict[bytes, Peer],
        number: Callable[[], int],
        now: int,
    ) -> None:
        """`peers`: those known, kept up to date by the owner. number: gives numbers above all that it gave before."""
        super().__init__()
        self._send = send
        self._settings = settings
        self.announce_to = announce_to
        self.peers = peers
        self._number = number
        self._sequence = 0
        self._leads = False
        self._anew = True
        self._changed = False
        self._told = -NEVER
        self._told_at: dict[Locator, int] = {}
        self._burst: list[int] = []
        self.change(data, now)
        self._changed = False

    @property
    def content(self) -> bytes:
        """The announcement's payload."""
        return self._content

    def change(self, data: ParticipantData, now: int) -> None:
        """The participant says something else of itself from now on: begin anew."""
        self._data = data
        self._content = data.payload()
        self._sequence = self._number()
        self._period = max(1, min(self._settings.announce_period, self._share()))
        self._changed = True
        self._told_at.clear()
        self._begin(now)

    def lead(self, now: int) -> None:
        """It leads from now on."""
        self._leads = True
        self._begin(now)

    def wake(self, now: int) -> int:
        places: dict[Locator, None] = {}
        if self._leads or self._anew:
            # The lead is heard by all that listen anywhere, and who answers it is told of the others.
            places.update(dict.fromkeys(at for at in self.announce_to if self._leads or is_multicast(at)))
        if now + self._period - self._told > self._share() or (self._changed and self._burst):
            self._told = now  # the next time would be too late
            places.update(self._peers())
        self._anew = False
        self._announce(places)
        while self._burst and self._burst[0] <= now:
            del self._burst[0]
        if self._burst:
            return self._burst[0]
        self._changed = False
        return now + (self._period if self._leads else self._share())

    def _begin(self, now: int) -> None:
        self._anew = True
        self._told = -NEVER
        offsets = self._settings.announce_burst
        self._burst = [now + offset for offset in offsets] if self._leads or self._changed else []

    def _share(self) -> int:
        """The longest time in which those known have to be told once."""
        return min(self._data.lease, self._settings.lease) // SHARE

    def tell(self, peer: Peer, now: int) -> None:
        """Announce it to one alone, unless it was just announced to somebody at the same place."""
        places = [place for place in peer.discovery if now - self._told_at.get(place, -NEVER) >= PAUSE]
        if len(self._told_at) > PLACES_MOST:
            self._told_at.clear()
        self._told_at.update(dict.fromkeys(places, now))
        self._announce(places)

    def leave(self, *, again: bool = False) -> None:
        """The participant goes. again: it has gone, and those known are told once more."""
        self._sequence = self._number()
        content = data_submessage(
            ENTITYID_SPDP_READER,
            ENTITYID_SPDP_WRITER,
            self._sequence,
            b"",
            inline_qos=departure(self._data.guid),
        )
        for place in self._peers() if again else self._peers() | dict.fromkeys(self.announce_to):
            self._send([content], None, place)

    def _peers(self) -> dict[Locator, None]:
        """Where others listen, each place once, in a fixed order."""
        return dict.fromkeys(place for peer in self.peers.values() for place in peer.discovery)

    def _announce(self, places: Iterable[Locator]) -> None:
        content = data_submessage(ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, self._sequence, self._content)
        for place in places:
            self._send([content], None, place)


class Welcome(Timed):
    """Tells those just met that a participant is there, until they seem to know.

    knows: whether the participant with a prefix has said something to ours. neighbours: those of its process, as far
    as it is of this kind.
    """

    __slots__ = ("_agenda", "_announcer", "_due", "_knows", "_neighbours")

    def __init__(
        self,
        announcer: Announcer,
        agenda: Agenda,
        knows: Callable[[GuidPrefix], bool],
        neighbours: Callable[[Peer], Iterable[Peer]],
    ) -> None:
        super().__init__()
        self._neighbours = neighbours
        self._announcer = announcer
        self._agenda = agenda
        self._knows = knows
        self._due: list[tuple[int, Peer]] = []

    def add(self, peer: Peer, now: int) -> None:
        """Somebody new is there."""
        if not self._is_known_at(peer):
            self._announcer.tell(peer, now)
        self._due += [(now + offset, peer) for offset in AGAIN]
        self._agenda.at(self, now + AGAIN[0])

    def wake(self, now: int) -> int:
        peers = self._announcer.peers
        self._due = [
            (at, peer)
            for at, peer in self._due
            if peers.get(peer.prefix) is peer and not self._knows(peer.prefix)
        ]
        for at, peer in self._due:
            if at <= now:
                self._announcer.tell(peer, now)
        self._due = [(at, peer) for at, peer in self._due if at > now]
        return min((at for at, _ in self._due), default=NEVER)

    def _is_known_at(self, peer: Peer) -> bool:
        """Whether another participant of the same process knows of ours: what one hears, all know."""
        longest_there = islice(self._neighbours(peer), NEIGHBOURS_MOST)
        return any(other is not peer and self._knows(other.prefix) for other in longest_there)
