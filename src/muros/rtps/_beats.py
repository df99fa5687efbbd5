"""The HEARTBEATs of a writer: what there is, said to one reader, to all at a place, or to whoever listens.

They are counted, and a reader goes by the newest count. Those meant for several readers name none (DDSI-RTPS 2.3,
8.3.7.5); those for readers of one participant have its prefix as destination.
"""

from collections.abc import Iterable
from typing import Final

from muros.rtps._constants import ENTITYID_UNKNOWN
from muros.rtps._endpoint import Place, Send, first_count
from muros.rtps._keeping import Keeper
from muros.rtps._reader_proxy import Audience, ReaderProxy
from muros.rtps._values import EntityId, GuidPrefix
from muros.rtps._wire import heartbeat

__all__ = ["Beats"]


class Beats:
    """Those of one writer to its audience. `sent`: the last sample that left."""

    __slots__ = ("_audience", "_count", "_entity", "_keeper", "_send")

    def __init__(
        self,
        entity: EntityId,
        send: Send,
        keeper: Keeper,
        audience: Audience,
    ) -> None:
        self._entity: Final = entity
        self._send = send
        self._keeper = keeper
        self._audience = audience
        self._count = 0

    def begin(self, now: int) -> None:
        """The first reader comes."""
        if not self._count:
            self._count = first_count(now)

    def for_all(self, sent: int, *, final: bool = False, alive: bool = False, start: int = 0) -> bytes:
        """For whoever listens. start: nobody is meant to have samples before this one."""
        self._count += 1
        first = max(self._keeper.lowest(sent), start)
        return heartbeat(
            ENTITYID_UNKNOWN, self._entity, first, sent, self._count, final=final, liveliness=alive
        )

    def for_one(self, reader: ReaderProxy, sent: int, *, final: bool = False) -> bytes:
        """For one reader: it counts what is meant for that one only."""
        self._count += 1
        first = max(self._keeper.lowest(sent), reader.start)
        return heartbeat(reader.entity, self._entity, first, sent, self._count, final=final)

    def send(self, reader: ReaderProxy, sent: int, *, final: bool) -> None:
        """Tell one reader."""
        beat = self.for_one(reader, sent, final=final)
        for place in reader.places:
            self._send([beat], reader.prefix, place)

    def ask(self, readers: Iterable[ReaderProxy], sent: int) -> None:
        """Ask readers that lag for acknowledgement, those of one participant together."""
        groups: dict[tuple[GuidPrefix, tuple[Place, ...]], list[ReaderProxy]] = {}
        for reader in readers:
            groups.setdefault((reader.prefix, reader.places), []).append(reader)
        for (prefix, places), group in groups.items():
            if len(group) == 1:
                self.send(group[0], sent, final=False)
                continue
            beat = self.for_all(sent, start=min(reader.start for reader in group))
            for place in places:
                self._send([beat], prefix, place)

    def ask_together(self, readers: Iterable[ReaderProxy], sent: int) -> None:
        """Tell patient readers what there is, and ask those that lag: all at one place at once, if most are meant."""
        groups: dict[tuple[Place, ...], list[ReaderProxy]] = {}
        for reader in readers:
            groups.setdefault(reader.places, []).append(reader)
        for places, group in groups.items():
            if len(group) > 1 and 2 * len(group) > self._audience.at(places):
                final = all(_knows_all(reader, sent) for reader in group)
                beat = self.for_all(sent, final=final, start=min(reader.start for reader in group))
                for place in places:
                    self._send([beat], None, place)
            else:
                for reader in group:
                    self.send(reader, sent, final=_knows_all(reader, sent))


def _knows_all(reader: ReaderProxy, sent: int) -> bool:
    """Whether it need not answer. One never heard of shall, even when there is nothing that it could miss."""
    return reader.acked >= sent and reader.count is not None
