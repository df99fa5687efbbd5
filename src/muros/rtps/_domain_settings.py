"""The bounds and times of a domain, its participants and their discovery. Times are in ns, sizes in bytes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias

from muros.rtps._endpoint import MILLISECOND, SECOND
from muros.rtps._settings import READER_DEFAULTS, WRITER_DEFAULTS, ReaderSettings, WriterSettings
from muros.rtps._values import Locator

__all__ = ["DOMAIN_DEFAULTS", "NOWHERE", "Addresses", "DomainSettings", "Transmit"]

Transmit: TypeAlias = Callable[[bytes, Locator], object]
"""Takes one datagram and where it is to go. Must not raise or call the core; what is lost is lost."""


class Addresses(NamedTuple):
    """Where this process listens, and where it makes itself known."""

    metatraffic_unicast: tuple[Locator, ...] = ()
    """Discovery is received here."""
    metatraffic_multicast: tuple[Locator, ...] = ()
    """Groups in which discovery is received."""
    default_unicast: tuple[Locator, ...] = ()
    """Samples are received here."""
    default_multicast: tuple[Locator, ...] = ()
    """Groups in which samples are received."""
    announce_to: tuple[Locator, ...] = ()
    """Where participants announce themselves: a multicast group, known peers, the well-known ports of this host."""


NOWHERE: Final = Addresses()
"""Without a network participants of this process still meet each other."""


@dataclass(frozen=True, slots=True)
class DomainSettings:
    """Bounds and times of a domain; one value may serve several. Times are in ns, sizes in bytes."""

    domain_tag: str = ""
    """Participants meet only those with the same tag."""
    lease: int = 20 * SECOND
    """Others forget a participant of ours that is silent for so long, unless it is made with a lease of its own."""
    announce_burst: tuple[int, ...] = (0, 100 * MILLISECOND, 250 * MILLISECOND, 500 * MILLISECOND, SECOND)
    """When after its start a participant announces itself, ..."""
    announce_period: int = 3 * SECOND
    """... and how often from then on; at least five times in its lease."""
    peers: int = 512
    """Participants of others that are known at the same time."""
    endpoints_per_peer: int = 4096
    """Writers and readers of one of them."""
    memory_per_peer: int = 16 << 20
    """Bytes of discovery data of one of them."""
    changes_burst: int = 8192
    """Endpoints that one participant may tell of (or change) at once, ..."""
    changes_per_second: int = 1000
    """... and from then on in a second. What it tells beyond is heard later."""
    instances: int = 4096
    """Instances of one keyed writer or reader whose deadline or owner is watched."""
    queue: int = 10_000
    """Datagrams on their way between participants of this process."""
    turn: int = 1000
    """Of them, those handed over in one call; the others are handed over by `tick`."""
    lease_least: int = 100 * MILLISECOND
    """A shorter lease of a participant or of a writer's liveliness is taken as this."""
    writer: WriterSettings = WRITER_DEFAULTS
    reader: ReaderSettings = READER_DEFAULTS
    discovery_writer: WriterSettings = field(
        default_factory=lambda: WriterSettings(
            fragment_size=1300, heartbeat_period=100 * MILLISECOND, together=5 * MILLISECOND
        )
    )
    """Of the writers that tell of endpoints; one datagram of theirs has to pass every network."""
    discovery_reader: ReaderSettings = field(
        default_factory=lambda: ReaderSettings(memory=8 << 20, together=10 * MILLISECOND)
    )

    def __post_init__(self) -> None:
        for name in (
            "lease",
            "announce_period",
            "peers",
            "endpoints_per_peer",
            "memory_per_peer",
            "changes_burst",
            "changes_per_second",
            "instances",
            "queue",
            "turn",
            "lease_least",
        ):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")


DOMAIN_DEFAULTS: Final = DomainSettings()
