"""A participant that others see: where it is, how long it is believed to live, how much it may say."""

from collections.abc import Callable

from muros.rtps._agenda import Timed
from muros.rtps._constants import VENDOR_EPROSIMA, VENDOR_OURS
from muros.rtps._discovery_data import EndpointData, ParticipantData
from muros.rtps._endpoint import NEVER, SECOND
from muros.rtps._reach import Hosts
from muros.rtps._values import INFINITE, GuidPrefix, Locator

__all__ = ["Budget", "Peer"]


class Peer(Timed):
    """A participant of another process.

    Gone when nothing is heard of it in its lease, of whatever kind.
    """

    __slots__ = (
        "_on_silence", "budget", "data", "discovery", "lease", "payload", "seen", "sequence", "source", "told",
        "user",
    )  # fmt: skip

    def __init__(
        self,
        data: ParticipantData,
        payload: bytes,
        source: Locator | None,
        now: int,
        budget: "Budget",
        on_silence: Callable[["Peer", int], object],
    ) -> None:
        super().__init__()
        self.data = data
        self.payload = payload
        """Its announcement; one that is equal says nothing new."""
        self.source = source
        """Where the announcement came from."""
        self.sequence = 0
        """The announcement's number, ..."""
        self.told = now
        """... and when it came."""
        self.seen = now
        """When something came from it."""
        self.budget = budget
        """How often it may say something else of itself."""
        self.lease = data.lease
        self.discovery: tuple[Locator, ...] = ()
        """Where discovery is sent."""
        self.user: tuple[Locator, ...] = ()
        """Where samples are sent, for endpoints that do not say otherwise."""
        self._on_silence = on_silence

    @property
    def prefix(self) -> GuidPrefix:
        """Its GUID prefix."""
        return self.data.prefix

    @property
    def kin(self) -> bool:
        """Whether it is of this kind: then its process is one with sockets for all its participants, and patient."""
        return self.data.vendor == VENDOR_OURS

    @property
    def hello_base(self) -> int:
        """Where the numbers begin in an ACKNACK that asks a writer of it for nothing but a HEARTBEAT.

        Fast DDS answers at once only when it is 0, and else with its next regular one, in up to three seconds. The
        specification allows no 0 (8.3.5.5), and others drop the message.
        """
        return 0 if self.data.vendor == VENDOR_EPROSIMA else 1

    def locate(self, hosts: Hosts) -> None:
        """Choose anew where to send to it."""
        data = self.data
        self.discovery = hosts.choose(data.metatraffic_unicast or data.default_unicast, self.source)
        self.user = hosts.choose(data.default_unicast or data.metatraffic_unicast, self.source)

    def places(self, endpoint: EndpointData, hosts: Hosts) -> tuple[Locator, ...]:
        """Where to send to an endpoint of it: to its own addresses, else to its participant's."""
        if not endpoint.unicast:
            return self.user
        return hosts.choose(endpoint.unicast, self.source) or self.user

    def wake(self, now: int) -> int:
        if self.lease >= INFINITE:
            return NEVER
        if now - self.seen < self.lease:
            return self.seen + self.lease
        self._on_silence(self, now)
        return NEVER


class Budget:
    """How many changes may come at once, and in a second thereafter."""

    __slots__ = ("_burst", "_left", "_rate", "_since")

    def __init__(self, burst: int, rate: int, now: int) -> None:
        self._burst = burst
        self._rate = rate
        self._left = burst
        self._since = now

    def take(self, now: int) -> bool:
        """Whether one more may come now."""
        earned = (now - self._since) * self._rate // SECOND
        if earned > 0:
            self._left = min(self._burst, self._left + earned)
            self._since = now
        if self._left <= 0:
            return False
        self._left -= 1
        return True
