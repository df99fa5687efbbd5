"""What a reader knows of one matched writer (DDSI-RTPS 2.3, 8.4.10.4)."""

from muros.rtps._endpoint import NEVER, Place
from muros.rtps._events import Data
from muros.rtps._fragments import Assembly
from muros.rtps._values import EntityId, GuidPrefix, guid_of

__all__ = ["WriterProxy"]


class WriterProxy:
    """One matched writer: where it is, what has come from it too early, what was asked of it."""

    __slots__ = (
        "answer_at", "asked_at", "asked_to", "asks", "assemblies", "came", "count", "entity", "expected",
        "floor", "fragment_at", "fragment_count", "guid", "held", "hello_at", "hello_base", "hellos", "irrelevant",
        "last", "owes", "patient", "paused", "pending", "places", "prefix", "progress", "reliable", "sent_count",
        "sent_fragment_count", "skip",
    )  # fmt: skip

    def __init__(
        self, prefix: GuidPrefix, entity: EntityId, places: tuple[Place, ...], reliable: bool
    ) -> None:
        self.guid = guid_of(prefix, entity)
        self.prefix = prefix
        self.entity = entity
        self.places = places
        self.reliable = reliable
        self.patient = False
        """It may be answered a little later, together with others."""
        self.expected = 1
        """The next sample to deliver."""
        self.last = 0
        """The last sample the writer is known to have sent."""
        self.pending: dict[int, Data] = {}
        """Samples that came early, or were refused, ..."""
        self.came: dict[int, int] = {}
        """... and when they came."""
        self.irrelevant: set[int] = set()
        """Numbers after the expected one that shall not be waited for."""
        self.skip = 0
        """What lies before shall not be waited for."""
        self.floor = 0
        """What lies before is no longer to be had."""
        self.assemblies: dict[int, Assembly] = {}
        """Samples of which fragments have come."""
        self.held = 0
        """Bytes of memory all these take."""
        self.paused = False
        """The expected sample is there, and was refused."""
        self.count: int | None = None
        """Count of the last HEARTBEAT."""
        self.fragment_count: int | None = None
        """Count of the last HEARTBEAT_FRAG."""
        self.sent_count = 0
        self.sent_fragment_count = 0
        self.answer_at = NEVER
        """When an ACKNACK is to be sent."""
        self.owes = False
        """It was asked for."""
        self.asks = 0
        """How often in a row something was asked for in vain."""
        self.fragment_at = 0
        """When the last fragment came."""
        self.asked_at = -NEVER
        """When something was asked for."""
        self.asked_to = 0
        """The last number asked for."""
        self.progress = False
        """Whether something up to there has come since."""
        self.hello_at = NEVER
        """When to ask again whether the writer is there."""
        self.hello_base = 1
        """Where the numbers begin in the ACKNACK that does so."""
        self.hellos = 0
