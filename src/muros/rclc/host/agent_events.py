"""What becomes of publishers and subscriptions at an agent, as the agent of muros tells it; for both sides of that.

A client that wants to know it reads a topic named after the object that it asks about, ``muros_events_0105`` for its
object 0x0105, in the participant of that object. Nothing of this enters a data space: the agent of muros answers such a
reader itself, at once and after each change; to other agents it is a topic that nobody writes. A sample is

==================  =======================================================================================
bytes, from 0       20, five little-endian unsigned numbers: which sample of this reader it is, from 1; how many
                    are matched now; how many were matched; how many did not fit; how many fell silent
bytes, from 20      what did not fit last, UTF-8, to the end
==================  =======================================================================================

The numbers are counted from when the reader was made; those of a new reader, whose first sample has the number 1, are
added to those before.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from muros.client.link import CONNECTED
from muros.rclc.executor import _NEVER
from muros.rclc.host.handles import tell_problem

if TYPE_CHECKING:
    from muros.xrce._types import Buffer

__all__ = ["TOPIC", "News", "NewsReader", "pack", "read_untrusted"]

TOPIC: Final = "muros_events_"
"""How the names of these topics begin; four hexadecimal digits follow."""
TYPE: Final = "muros_msgs/msg/EntityEvents"
NOT_TOLD: Final = 56
"""The code with which ``on_problem`` is told that an agent does not tell of events."""
PATIENCE: Final = 3000
"""Milliseconds of a connection after which an agent is taken for one that does not tell."""
LONGEST_WHY: Final = 400
"""Bytes of words."""

_HEAD = struct.Struct("<5I")


class News(NamedTuple):
    """A sample."""

    number: int
    current: int
    matched: int
    misfits: int
    silences: int
    why: str


def pack(news: News) -> bytes:
    """A sample, serialised."""
    return _HEAD.pack(*news[:-1]) + news.why.encode()[:LONGEST_WHY]


def read_untrusted(data: bytes) -> News:
    """A sample. ValueError for what is none."""
    if len(data) < _HEAD.size:
        raise ValueError(f"{len(data)} B are too short for events of an entity")
    number, current, matched, misfits, silences = _HEAD.unpack_from(data)
    why = data[_HEAD.size : _HEAD.size + LONGEST_WHY].decode(errors="replace")
    return News(number, current, matched, misfits, silences, why)


class NewsReader:
    """Hears of one object of a session: what it counts goes on when the agent begins anew.

    Whether the agent tells anything is known from its first sample on, after which ``known`` is true.
    """

    def __init__(self, context: Any, participant: Any, entity: Any) -> None:
        self.known = False
        self.malformed = 0
        self._context = context
        self._last = self._before = News(0, 0, 0, 0, 0, "")
        self._since: int | None = None  # the tick from which on an answer is waited for
        self._told = False
        sharing = context.sharing  # what comes is for no handle: whichever thread takes it
        self._session = context.middleware if sharing is None else sharing.real
        name = f"{TOPIC}{entity.id:04x}"
        self._reader = self._session.reader(participant, name, TYPE, "default", self._take)

    def look(self, now: int) -> News:
        """What is known now; tells ``on_problem`` once when an agent does not tell."""
        if not self.known and not self._told and self._waited(now) >= PATIENCE:
            self._told = True
            tell_problem(
                self._context,
                NOT_TOLD,
                "the agent does not tell what its publishers and subscriptions have met: that of muros does, "
                "others do not. Use muros agent, or a context straight in the graph such as Context('dds:')",
            )
        last, before = self._last, self._before
        return last._replace(
            matched=last.matched + before.matched,
            misfits=last.misfits + before.misfits,
            silences=last.silences + before.silences,
        )

    def left(self, now: int) -> int:
        """Milliseconds until ``look`` may have something to tell without a sample."""
        return _NEVER if self.known or self._told else max(PATIENCE - self._waited(now), 0)

    def close(self) -> None:
        """Listens no more."""
        self._reader.destroy()

    def _waited(self, now: int) -> int:
        if self._session.state != CONNECTED or self._session.pending:
            self._since = None
            return 0
        if self._since is None:
            self._since = now
        return now - self._since

    def _take(self, buf: Buffer, off: int, n: int) -> None:
        try:
            news = read_untrusted(bytes(memoryview(buf)[off : off + n]))
        except ValueError:
            self.malformed += 1
            return
        if news.number <= self._last.number:
            self._before = self.look(0)
        self.known = True
        self._last = news
