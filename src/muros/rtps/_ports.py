"""A writer's or reader's core with its place in a domain: what events are routed to, and what is woken in time.

Ports are of two sorts: those of discovery, which stand on these classes as they are, and those of users, `LocalWriter`
and `LocalReader`.
"""

from collections.abc import Callable
from typing import Any, Final

from muros.rtps._agenda import Timed
from muros.rtps._events import Data, DataFrag, Gap, Heartbeat, HeartbeatFrag
from muros.rtps._liveliness import WriterLease
from muros.rtps._reader import ReaderCore
from muros.rtps._values import split_guid
from muros.rtps._writer import WriterCore

__all__ = ["FOR_READERS", "ReaderPort", "Route", "WriterPort"]


class WriterPort(Timed):
    """A writer that is woken when its core wants it."""

    __slots__ = ("core", "entity", "prefix")

    def __init__(self, core: WriterCore) -> None:
        super().__init__()
        self.core = core
        self.prefix, self.entity = split_guid(core.guid)

    def wake(self, now: int) -> int:
        self.core.tick(now)
        return self.core.due


class ReaderPort(Timed):
    """A reader that is woken when its core wants it."""

    __slots__ = ("core", "entity", "prefix")

    def __init__(self, core: ReaderCore) -> None:
        super().__init__()
        self.core = core
        self.prefix, self.entity = split_guid(core.guid)

    def wake(self, now: int) -> int:
        self.core.tick(now)
        return self.core.due


class Route:
    """Who wants the samples of one writer of somebody else. The tuples are replaced, never changed."""

    __slots__ = ("leases", "ports")

    def __init__(self) -> None:
        self.ports: tuple[ReaderPort, ...] = ()
        self.leases: tuple[WriterLease, ...] = ()
        """Those who watch whether the writer is alive."""


FOR_READERS: Final[dict[type, Callable[[ReaderCore, Any, int], None]]] = {
    Data: ReaderCore.on_data,
    DataFrag: ReaderCore.on_data_frag,
    Heartbeat: ReaderCore.on_heartbeat,
    Gap: ReaderCore.on_gap,
    HeartbeatFrag: ReaderCore.on_heartbeat_frag,
}
"""What a reader's core does with an event."""
