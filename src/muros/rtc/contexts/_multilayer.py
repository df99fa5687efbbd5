"""A periodic context that runs groups of components side by side."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from typing import ClassVar

from muros.rtc.contexts._cycle import Member
from muros.rtc.contexts._participant import name_of
from muros.rtc.contexts._requests import conducting
from muros.rtc.contexts._threads import PeriodicExecutionContext

__all__ = ["MultilayerCompositeEC", "parse_groups"]


class MultilayerCompositeEC(PeriodicExecutionContext):
    """Components in groups, `a,b|c,d` by instance name: each pass runs the groups in parallel, and ends with the last.

    Within a group components are called in their order, a pass being do of all, then post-do of all. Who is in no group
    runs in the context's own thread. State changes are one after the other.
    """

    registered_name: ClassVar[str] = "MultilayerCompositeEC"
    _groups: tuple[tuple[str, ...], ...] = ()
    _layers: tuple[tuple[Member, ...], ...] = ()
    _layered: tuple[Member, ...] = ()
    _team: _Team | None = None

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Instance names, by group."""
        return self._groups

    def set_groups(self, text: str) -> None:
        """The groups from the next pass on: `a,b|c,d`."""
        with self._changed:
            self._groups = parse_groups(text)
            self._layered = ()

    def _execute(self) -> None:
        members = self._cycle.members
        if members is not self._layered:
            with self._changed:
                self._layers, self._layered = _layers(members, self._groups), members
        own, *others = self._layers
        if not others:
            self._cycle.execute_group(own)
            return
        if self._team is None:
            self._team = _Team(f"rtc {self}", self._as_conductor)
        self._team.perform([partial(self._cycle.execute_group, group) for group in (own, *others)])

    def _as_conductor(self, work: Callable[[], None]) -> None:
        with conducting(self):
            work()

    def _stopped(self) -> None:
        if self._team is not None:
            self._team.close()


def parse_groups(text: str) -> tuple[tuple[str, ...], ...]:
    """`a,b|c,d` as names by group; empty names and groups are left out."""
    groups = (tuple(name.strip() for name in part.split(",") if name.strip()) for part in text.split("|"))
    return tuple(group for group in groups if group)


def _layers(
    members: tuple[Member, ...], groups: tuple[tuple[str, ...], ...]
) -> tuple[tuple[Member, ...], ...]:
    """The members of the context's own thread, then those of each group that has some."""
    place = {name: number for number, group in reversed(tuple(enumerate(groups, 1))) for name in group}
    layers: list[list[Member]] = [[] for _ in range(len(groups) + 1)]
    for member in members:
        layers[place.get(name_of(member.participant), 0)].append(member)
    return (tuple(layers[0]), *(tuple(layer) for layer in layers[1:] if layer))


class _Team:
    """Threads that do several things at once; as many as were ever needed."""

    def __init__(self, name: str, around: Callable[[Callable[[], None]], None]) -> None:
        self._name = name
        self._around = around
        self._inboxes: list[SimpleQueue[Callable[[], None] | None]] = []
        self._done: SimpleQueue[None] = SimpleQueue()

    def perform(self, works: list[Callable[[], None]]) -> None:
        """Do all; the first in the calling thread. Returns when all have been done."""
        while len(self._inboxes) < len(works) - 1:
            inbox: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
            name = f"{self._name} {len(self._inboxes) + 1}"
            threading.Thread(target=self._main, args=(inbox,), name=name, daemon=True).start()
            self._inboxes.append(inbox)
        for inbox, work in zip(self._inboxes, works[1:], strict=False):
            inbox.put(work)
        try:
            works[0]()
        finally:
            for _ in works[1:]:
                self._done.get()

    def close(self) -> None:
        """End the threads."""
        for inbox in self._inboxes:
            inbox.put(None)
        self._inboxes.clear()

    def _main(self, inbox: SimpleQueue[Callable[[], None] | None]) -> None:
        while (work := inbox.get()) is not None:
            try:
                self._around(work)
            finally:
                self._done.put(None)
