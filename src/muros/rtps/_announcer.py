"""Says that a participant of ours is there (DDSI-RTPS 2.3, 8.5.3: the simple participant discovery protocol).

Often in its first second, then with a steady period, to all addresses known in advance; to the participants
that are known, where they listen, often enough for the lease; and at once to each that is met. Announcements have no
acknowledgement: what is lost is said again. To one just met it is said again soon, unless it talks to us meanwhile:
it may have begun to listen only after our answer.
"""

from collections.abc import Callable, Iterable
from typing import Final

from muros.rtps._agenda import Agenda, Timed
from muros.rtps._constants import ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER
from muros.rtps._discovery_data import ParticipantData, departure
from muros.rtps._domain_settings import DomainSettings
from muros.rtps._endpoint import MILLISECOND, NEVER, SECOND, Send
from muros.rtps._peer import Peer
from muros.rtps._values import INFINITE, GuidPrefix, Locator
from muros.rtps._wire import data as data_submessage

__all__ = ["Announcer", "Welcome"]

SHARE: Final = 3
"""Announcements within a lease, at least."""

AGAIN: Final = (100 * MILLISECOND, 400 * MILLISECOND, SECOND)
"""When after it was met a participant that does not talk to us is told again that we are there."""


class Announcer(Timed):
    """Announces one participant; put it on the agenda to make it begin."""

    __slots__ = (
        "_burst", "_content", "_data", "_number", "_period", "_send", "_sequence", "_settings", "_told",
        "announce_to", "peers",
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
        self._told = -NEVER
        self.change(data, now)

    @property
    def content(self) -> bytes:
        """The announcement's payload."""
        return self._content

    def change(self, data: ParticipantData, now: int) -> None:
        """The participant says something else of itself from now on: begin anew."""
        self._data = data
        self._content = data.payload()
        self._sequence = self._number()
        self._burst = [now + offset for offset in self._settings.announce_burst]
        self._period = self._settings.announce_period
        if data.lease < INFINITE:
            self._period = max(1, min(self._period, data.lease // SHARE))
        self._told = -NEVER

    def wake(self, now: int) -> int:
        places = dict.fromkeys(self.announce_to)
        share = min(self._data.lease, self._settings.lease) // SHARE
        if now + self._period - self._told > share:  # the next time would be too late
            self._told = now
            places.update(self._peers())
        self._announce(places)
        while self._burst and self._burst[0] <= now:
            del self._burst[0]
        return self._burst[0] if self._burst else now + self._period

    def tell(self, peer: Peer) -> None:
        """Announce it to one alone."""
        self._announce(peer.discovery)

    def leave(self) -> None:
        """The participant goes."""
        self._sequence = self._number()
        content = data_submessage(
            ENTITYID_SPDP_READER,
            ENTITYID_SPDP_WRITER,
            self._sequence,
            b"",
            inline_qos=departure(self._data.guid),
        )
        for place in self._peers() | dict.fromkeys(self.announce_to):
            self._send([content], None, place)

    def _peers(self) -> dict[Locator, None]:
        """Where others listen, each place once, in a fixed order."""
        return dict.fromkeys(
            place for peer in self.peers.values() if not peer.local for place in peer.discovery
        )

    def _announce(self, places: Iterable[Locator]) -> None:
        content = data_submessage(ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, self._sequence, self._content)
        for place in places:
            self._send([content], None, place)


class Welcome(Timed):
    """Tells those just met that a participant is there, until they seem to know.

    knows: whether the participant with a prefix has said something to ours.
    """

    __slots__ = ("_agenda", "_announcer", "_due", "_knows")

    def __init__(self, announcer: Announcer, agenda: Agenda, knows: Callable[[GuidPrefix], bool]) -> None:
        super().__init__()
        self._announcer = announcer
        self._agenda = agenda
        self._knows = knows
        self._due: list[tuple[int, Peer]] = []

    def add(self, peer: Peer, now: int) -> None:
        """Somebody new is there."""
        if not peer.local:
            self._announcer.tell(peer)
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
                self._announcer.tell(peer)
        self._due = [(at, peer) for at, peer in self._due if at > now]
        return min((at for at, _ in self._due), default=NEVER)
