"""The readers by which clients learn what became of their publishers and subscriptions.

No such reader is in the data space: it is answered here, with samples as `muros.rclc.host.agent_events` describes
them, one at once and one after each change, as fast as the client takes them.
"""

from collections.abc import Mapping
from typing import Final

from muros.agent._proxies import Answered, ParticipantProxy, Proxy, ReaderProxy, Reading, WriterProxy
from muros.space import Reader, Space, Topic, Writer
from muros.xrce.representation import Entity

__all__ = ["TOPIC", "EventsProxy", "subject"]

TOPIC: Final = "muros_events_"
"""How the names of their topics begin; the id of the object follows, in four hexadecimal digits."""


def subject(topic: str, objects: Mapping[int, Proxy]) -> WriterProxy | ReaderProxy | None:
    """The writer or reader that the events of a topic are of; None for one that is not there."""
    digits = topic.removeprefix(TOPIC)
    if len(digits) != 4 or not all(digit in "0123456789abcdef" for digit in digits):
        return None
    found = objects.get(int(digits, 16))
    return found if isinstance(found, WriterProxy | ReaderProxy) else None


class EventsProxy(Answered):
    """A datareader of the events of `of`, which `objects` may have replaced since."""

    __slots__ = ("_changed", "_counts", "_number", "_objects")

    def __init__(
        self,
        object_id: int,
        entity: Entity,
        parent: ParticipantProxy,
        topic: Topic,
        of: WriterProxy | ReaderProxy,
        objects: Mapping[int, Proxy],
        space: Space,
    ) -> None:
        super().__init__(object_id, entity, parent, topic, f"reads events of what {of.detail}")
        from muros.space.rclc._counts import EndpointCounts  # which few agents need

        self._objects = objects
        self._changed = True
        self._number = 0
        self._counts = EndpointCounts(space, parent.domain, _end(of), self._on_change)

    def start(self, reading: Reading) -> None:
        """Replaces what was being read by `reading`, which begins with what there is."""
        self._changed = True
        super().start(reading)

    def take(self) -> bytes | None:
        """A sample, if something has changed since the last."""
        if not self._changed:
            return None
        from muros.rclc.host.agent_events import News, pack

        self._changed = False
        self._number += 1
        of = subject(self.topic.name, self._objects)
        now = 0 if of is None else len(_end(of).matched)
        counts = self._counts
        return pack(News(self._number, now, counts.matched, counts.misfits, counts.silences, counts.why))

    def close(self) -> None:
        """Counts no more."""
        self._counts.close()
        super().close()

    def _on_change(self) -> None:
        self._changed = True
        self._on_data(None)


def _end(of: WriterProxy | ReaderProxy) -> Writer | Reader:
    return of.writer if isinstance(of, WriterProxy) else of.reader
