"""What servers of links say: events, for whoever watches, and findings, for whoever has to do something."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Generic, TypeVar

from muros.findings import Findings

__all__ = ["Event", "Voice", "counted"]

_SUMMARY = 1_000
"""When to look whether findings are to be summarised, in ms after one."""


class Event:
    """Something that happened at a server. Its kinds are frozen dataclasses; in ``words``, ``e`` is the event."""

    __slots__ = ()
    words: ClassVar[str]

    def text(self) -> str:
        """One line for people."""
        return self.words.format(e=self)


E = TypeVar("E", bound=Event)


def counted(**counts: int) -> str:
    """How many there are of what: ``2 writers, 1 service client``; nothing of what there is none. ``_`` is a space."""
    return ", ".join(
        f"{n} {what.replace('_', ' ')}{'' if n == 1 else 's'}" for what, n in counts.items() if n
    )


class Voice(ABC, Generic[E]):
    """A server's core as others hear it: ``on_event`` gets every event, ``findings`` what went wrong.

    ``wall`` gives the wall clock in ns. ``on_wake(when)`` is called when ``tick`` is needed earlier than it said.
    """

    def __init__(self, findings: Findings, wall: Callable[[], int]) -> None:
        self.findings = findings
        self.on_event: Callable[[E], object] | None = None
        self.on_wake: Callable[[int], object] | None = None
        self._wall = wall

    @abstractmethod
    def tick(self, now: int) -> int | None:
        """Does what has become due at ``now`` (ms); returns when to call again, None: when something happens."""

    def tell(self, event: E) -> None:
        """Hands an event to whoever watches."""
        if self.on_event is not None:
            self.on_event(event)

    def report(
        self, code: str, *, who: str, what: str, why: str, remedy: str, subject: str = "", n: int = 1
    ) -> None:
        """Counts a finding, which has the time of the wall clock."""
        now = self._wall() / 1e9
        self.findings.report(code, who=who, subject=subject, what=what, why=why, remedy=remedy, now=now, n=n)
        self._wake_in(_SUMMARY)

    @abstractmethod
    def _wake_in(self, ms: int) -> None:
        """Sees to a call of `tick` in so many ms at the latest."""
