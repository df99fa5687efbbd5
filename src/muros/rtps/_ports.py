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
from muros.rtps._values import GuidPrefix, split_guid
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

    __slots__ = ("_by_prefix", "leases", "ports")

    def __init__(self) -> None:
        self.ports: tuple[ReaderPort, ...] = ()
        self._by_prefix: dict[GuidPrefix, tuple[ReaderPort, ...]] | None = None
        self.leases: tuple[WriterLease, ...] = ()
        """Those who watch whether the writer is alive."""

    def set(self, ports: tuple[ReaderPort, ...]) -> None:
        """These want its samples from now on."""
        self.ports = ports
        self._by_prefix = None

    def of(self, prefix: GuidPrefix) -> tuple[ReaderPort, ...]:
        """Those of them that belong to the participant `prefix`."""
        if self._by_prefix is None:
            groups: dict[GuidPrefix, list[ReaderPort]] = {}
            for port in self.ports:
                groups.setdefault(port.prefix, []).append(port)
            self._by_prefix = {prefix: tuple(group) for prefix, group in groups.items()}
        return self._by_prefix.get(prefix, ())


FOR_READERS: Final[dict[type, Callable[[ReaderCore, Any, int], None]]] = {
    Data: ReaderCore.on_data,
    DataFrag: ReaderCore.on_data_frag,
    Heartbeat: ReaderCore.on_heartbeat,
    Gap: ReaderCore.on_gap,
    HeartbeatFrag: ReaderCore.on_heartbeat_frag,
}
"""What a reader's core does with an event."""
