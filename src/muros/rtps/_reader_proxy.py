"""What a writer knows of its matched readers (DDSI-RTPS 2.3, 8.4.7.2)."""

from collections import Counter
from collections.abc import Iterable

from muros.rtps._endpoint import NEVER, Place
from muros.rtps._values import EntityId, Guid, GuidPrefix, guid_of

__all__ = ["Audience", "ReaderProxy"]


class ReaderProxy:
    """One matched reader: where it is, what it has, what it wants again."""

    __slots__ = (
        "acked", "aside", "count", "due", "entity", "fragment_count", "inline_qos", "interval", "patient", "places",
        "prefix",
        "reliable", "repaired", "repaired_at", "since", "start", "wanted",
    )  # fmt: skip

    def __init__(
        self, prefix: GuidPrefix, entity: EntityId, places: tuple[Place, ...], reliable: bool, start: int
    ) -> None:
        self.prefix = prefix
        self.entity = entity
        self.places = places
        self.reliable = reliable
        self.inline_qos = False
        """Whether it wants the endpoint's QoS with every sample."""
        self.patient = False
        """It may be served a little later, together with others."""
        self.start = start
        """The first sample meant for it."""
        self.acked = start - 1
        """It has everything up to here."""
        self.aside = False
        """It holds nobody, having been silent for too long."""
        self.count: int | None = None
        """Count of its last ACKNACK."""
        self.fragment_count: int | None = None
        """Count of its last NACK_FRAG."""
        self.due = NEVER
        """When it gets the next heartbeat."""
        self.interval = 0
        """Pause after that one."""
        self.since = 0
        """Time of its last progress while it lags."""
        self.wanted: dict[int, Iterable[int] | None] = {}
        """What is to be sent again: samples, of some only these fragments."""
        self.repaired: set[int] = set()
        """What was sent again since `repaired_at`; 0 stands for a GAP."""
        self.repaired_at = 0

    @property
    def key(self) -> tuple[GuidPrefix, EntityId]:
        """The same in two parts, as events have it."""
        return self.prefix, self.entity

    @property
    def guid(self) -> Guid:
        """The reader's GUID."""
        return guid_of(self.prefix, self.entity)


class Audience:
    """All matched readers of a writer, and where they are. With hundreds of them, one more costs what the first did."""

    __slots__ = ("_at", "changes", "proxies", "reliable", "routes", "with_qos")

    def __init__(self) -> None:
        self.proxies: dict[tuple[GuidPrefix, EntityId], ReaderProxy] = {}
        self.routes: tuple[Place, ...] = ()
        """Every place where a reader listens, once."""
        self.reliable = 0
        """How many are reliable ..."""
        self.with_qos = 0
        """... and how many want the endpoint's QoS with every sample."""
        self.changes = 0
        """Counts comings, goings and moves."""
        self._at: Counter[tuple[Place, ...]] = Counter()

    def add(self, proxy: ReaderProxy) -> None:
        """One more."""
        self.proxies[proxy.key] = proxy
        self.reliable += proxy.reliable
        self.with_qos += proxy.inline_qos
        self._count(proxy.places, 1)

    def drop(self, proxy: ReaderProxy) -> None:
        """One less."""
        del self.proxies[proxy.key]
        self.reliable -= proxy.reliable
        self.with_qos -= proxy.inline_qos
        self._count(proxy.places, -1)

    def move(self, proxy: ReaderProxy, places: tuple[Place, ...]) -> None:
        """One is to be reached elsewhere."""
        self._count(proxy.places, -1)
        proxy.places = places
        self._count(places, 1)

    def at(self, places: tuple[Place, ...]) -> int:
        """How many are to be reached there."""
        return self._at[places]

    def _count(self, places: tuple[Place, ...], change: int) -> None:
        counts = self._at
        self.changes += 1
        counts[places] += change
        if not counts[places]:
            del counts[places]
        elif counts[places] > 1 or change < 0:
            return
        self.routes = tuple(dict.fromkeys(place for those in counts for place in those))
