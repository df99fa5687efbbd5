"""The participants of other processes, as they announce themselves (DDSI-RTPS 2.3, 8.5.3), once for all of ours.

An announcement says everything of a participant and comes again and again. One that says nothing new costs no more
than the comparison. What was overtaken on the way by a newer one, or by a farewell, is left alone. How many are
known, and how often one may say something else, is limited.
"""

from typing import TYPE_CHECKING, Final, NamedTuple

from muros.rtps._constants import PROTOCOL_VERSION, StatusInfo
from muros.rtps._discovery_data import InvalidDiscoveryData, ParticipantData, key_untrusted
from muros.rtps._endpoint import MILLISECOND, SECOND
from muros.rtps._events import Data
from muros.rtps._gather import SIZE, SIZE_HERE
from muros.rtps._news import DomainProblem, Why
from muros.rtps._parameters import InvalidParameters, status_info
from muros.rtps._peer import Budget, Peer
from muros.rtps._values import Guid, GuidPrefix, Locator

if TYPE_CHECKING:
    from muros.rtps._domain import DomainCore

__all__ = ["Kin", "Others"]

OVERTAKEN: Final = 2 * SECOND
"""For so long an announcement may be on its way that was overtaken by a newer one, or by a farewell."""

GONE_MOST: Final = 256
"""Farewells remembered."""

UPDATES_BURST: Final = 20
"""How often a participant may say something else of itself at once, ..."""

UPDATES_PER_SECOND: Final = 5
"""... and in a second thereafter. What it says beyond is heard when it is said again."""

IDLE: Final = 5 * SECOND
"""Where there is no room for more, one that has no endpoints makes way for a newcomer after this silence."""

LOOK_AGAIN: Final = 100 * MILLISECOND
"""When none such was found, it is looked for again after this time."""

PREFIX_SIZE: Final = 12


class Kin(NamedTuple):
    """Participants of one other process of this kind."""

    size: int
    """Bytes of discovery that go there together."""
    peers: list[Peer]


class Others:
    """`peers`: those that are there."""

    __slots__ = ("_gone", "_home", "_look_at", "kin", "peers")

    def __init__(self, home: "DomainCore") -> None:
        self._home = home
        self.peers: Final[dict[GuidPrefix, Peer]] = {}
        self.kin: dict[Locator, Kin] = {}
        """Where those of them listen that are of this kind."""
        self._gone: dict[GuidPrefix, tuple[int, int]] = {}
        self._look_at = 0

    def announced(self, event: Data, source: Locator | None, now: int) -> None:
        """A participant says something of itself."""
        home, prefix = self._home, event.source
        peer = self.peers.get(prefix)
        if peer is not None and event.payload == peer.payload and event.payload:
            return
        number, at = (peer.sequence, peer.told) if peer is not None else self._gone.get(prefix, (0, 0))
        if event.sequence < number and now - at < OVERTAKEN:
            return
        if event.destination is not None and home.find(event.destination) is None:
            home.counters["unmatched"] += 1
            return
        known = prefix if peer is not None else b""
        try:
            if not event.payload or event.key or status_info(event.inline_qos) & ~StatusInfo.FILTERED:
                self._departed(key_untrusted(event.payload, event.inline_qos), event, now)
                return
            data = ParticipantData.parse_untrusted(event.payload)
        except (InvalidDiscoveryData, InvalidParameters) as error:
            home.refuse(DomainProblem.DISCOVERY_MALFORMED, known, str(error))
            return
        if data.prefix != prefix:
            home.refuse(DomainProblem.PREFIX_MISMATCH, known, data.prefix.hex())
        elif not self._is_of_this_domain(data, source):
            home.counters["foreign"] += 1
        elif peer is not None:
            self._update(peer, data, event, source, now)
        elif len(self.peers) >= home.settings.peers and not self._make_place(now):
            home.refuse(DomainProblem.TOO_MANY_PEERS, b"", prefix.hex(), home.settings.peers)
        else:
            self._meet(data, event, source, now)

    def relocate(self, now: int) -> None:
        """Our addresses have changed: choose anew where to send to everybody."""
        for peer in self.peers.values():
            self._locate(peer)
            for participant in self._home.participants:
                participant.update(peer, None, now)

    def neighbours(self, peer: Peer) -> list[Peer]:
        """The participants of its process, itself included, the oldest first; nobody when it is not of this kind."""
        at = self.kin.get(peer.discovery[0]) if peer.kin and peer.discovery else None
        return [] if at is None else at.peers

    def lose(self, peer: Peer, why: Why, now: int) -> None:
        """One is there no more."""
        del self.peers[peer.prefix]
        self._find_kin()
        self._home.agenda.forget(peer)
        for participant in self._home.participants:
            participant.part(peer, why, now)

    # --- Helpers -----------------------------------------------------------------------------------------

    def _make_place(self, now: int) -> bool:
        """Let go of the one that has been silent longest of those that have no endpoints, if it was silent for long.

        So nobody keeps others out for long by making participants up.
        """
        if now < self._look_at:
            return False
        self._look_at = now + LOOK_AGAIN
        participants = self._home.participants
        idle = (
            peer
            for peer in self.peers.values()
            if now - peer.seen >= IDLE
            and not any(one.knows_endpoints_of(peer.prefix) for one in participants)
        )
        longest = min(idle, key=lambda peer: peer.seen, default=None)
        if longest is None:
            return False
        self._look_at = now
        self.lose(longest, Why.LEASE, now)
        return True

    def _is_of_this_domain(self, data: ParticipantData, source: Locator | None) -> bool:
        home = self._home
        if data.domain in (None, home.domain) and data.domain_tag == home.settings.domain_tag:
            return data.version[0] == PROTOCOL_VERSION[0]
        number = -1 if data.domain is None else data.domain
        home.report(DomainProblem.FOREIGN_DOMAIN, b"", number, data.domain_tag, source)
        return False

    def _meet(self, data: ParticipantData, event: Data, source: Locator | None, now: int) -> None:
        settings = self._home.settings
        budget = Budget(UPDATES_BURST, UPDATES_PER_SECOND, now)
        peer = Peer(data, event.payload, source, now, budget, self._silent)
        peer.sequence = event.sequence
        peer.lease = max(peer.lease, settings.lease_least)
        self.peers[peer.prefix] = peer
        self._locate(peer)
        self._home.agenda.at(peer, now + peer.lease)
        for participant in self._home.participants:
            participant.meet(peer, now)

    def _update(
        self, peer: Peer, data: ParticipantData, event: Data, source: Locator | None, now: int
    ) -> None:
        home = self._home
        if not peer.budget.take(now):
            home.refuse(DomainProblem.FLOOD, peer.prefix, "announcements", UPDATES_PER_SECOND)
            return  # what it says last will be said again
        before, peer.data, peer.payload, peer.source = peer.data, data, event.payload, source
        peer.sequence, peer.told = event.sequence, now
        peer.lease = max(data.lease, home.settings.lease_least)
        self._locate(peer)
        home.agenda.at(peer, now + peer.lease)
        for participant in home.participants:
            participant.update(peer, before if before != data else None, now)

    def _locate(self, peer: Peer) -> None:
        peer.locate(self._home.hosts)
        self._find_kin()
        if not peer.discovery or not peer.user:
            data = peer.data
            offered = data.metatraffic_unicast + data.default_unicast
            addresses = ", ".join(map(str, offered))
            self._home.report(DomainProblem.UNREACHABLE, peer.prefix, len(offered), addresses, peer.source)

    def _find_kin(self) -> None:
        hosts = self._home.hosts
        self.kin = {}
        for peer in self.peers.values():
            if peer.kin:
                for place in peer.discovery:
                    at = self.kin.get(place)
                    if at is None:
                        at = self.kin[place] = Kin(SIZE_HERE if hosts.has(place) else SIZE, [])
                    at.peers.append(peer)

    def _departed(self, guid: Guid, event: Data, now: int) -> None:
        prefix = event.source
        peer = self.peers.get(prefix)
        if guid[:PREFIX_SIZE] != prefix:
            self._home.refuse(DomainProblem.PREFIX_MISMATCH, prefix if peer else b"", guid.hex())
        elif peer is not None:
            self._gone.pop(prefix, None)
            if len(self._gone) >= GONE_MOST:
                del self._gone[next(iter(self._gone))]
            self._gone[prefix] = event.sequence, now
            self.lose(peer, Why.LEFT, now)

    def _silent(self, peer: Peer, now: int) -> None:
        self.lose(peer, Why.LEASE, now)
