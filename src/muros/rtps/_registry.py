"""The writers and readers of all participants of a process, by topic: they meet here, without discovery.

Participants of one process need not tell each other of themselves. What one makes is compared at once with what the
others (and it itself) have on the other side of its topic. However many participants there are, that costs only where
there is something to match.
"""

from collections.abc import Iterable

from muros.rtps import _matching
from muros.rtps._local import LocalReader, LocalWriter
from muros.rtps._news import Why
from muros.rtps._values import Guid

__all__ = ["Registry"]


class Registry:
    """Everything local."""

    __slots__ = ("_by_guid", "_topics")

    def __init__(self) -> None:
        self._by_guid: dict[Guid, LocalWriter | LocalReader] = {}
        self._topics: dict[str, dict[Guid, LocalWriter | LocalReader]] = {}

    def __len__(self) -> int:
        return len(self._by_guid)

    def get(self, guid: Guid) -> LocalWriter | LocalReader | None:
        """The one with this GUID."""
        return self._by_guid.get(guid)

    def on_topic(self, topic: str) -> Iterable[LocalWriter | LocalReader]:
        """Those with this topic."""
        return self._topics.get(topic, {}).values()

    def add(self, local: LocalWriter | LocalReader, now: int) -> None:
        """One was made: match it with those that fit."""
        self._by_guid[local.guid] = local
        there = self._topics.setdefault(local.data.topic, {})
        there[local.guid] = local
        for other in tuple(there.values()):
            if isinstance(local, LocalWriter) and isinstance(other, LocalReader):
                _meet(local, other, now)
            elif isinstance(local, LocalReader) and isinstance(other, LocalWriter):
                _meet(other, local, now)

    def remove(self, local: LocalWriter | LocalReader, now: int) -> None:
        """One is closed: the others are not matched with it any more."""
        guid = local.guid
        del self._by_guid[guid]
        there = self._topics[local.data.topic]
        del there[guid]
        if not there:
            del self._topics[local.data.topic]
        for other in there.values():
            other.refused.pop(guid, None)
            if guid in other.remotes:
                other.owner.separate(other, local.data, Why.LEFT, now)


def _meet(writer: LocalWriter, reader: LocalReader, now: int) -> None:
    """The reader first: it is ready when the writer sends what it has kept."""
    reasons = _matching.mismatches(writer.data, reader.data)
    reader.owner.compared(reader, writer.data, reasons, None, now)
    writer.owner.compared(writer, reader.data, reasons, None, now)
