"""The hall: the thread in which the spaces of this process's data ports live.

Spaces are served by an asyncio loop and called from its thread only; ports are used from any thread. So the hall has a
thread with a loop, and what ports want of a space is handed to it. The thread begins with the first connection and
ends with the last; a space is opened once for each URL, a participant once for each node name.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Final, TypeVar

from muros.findings import Finding
from muros.rtc.data._transports import TransportError
from muros.space import Participant, Space, SpaceError, open_space

__all__ = ["HALL", "Hall", "Seat"]

R = TypeVar("R")

CALL_TIME: Final = 10.0
"""Seconds that a space may take for what it is asked for; it never waits for others."""


@dataclass(slots=True, eq=False)
class Seat:
    """One connection's place: a node in a space."""

    url: str
    node: str
    participant: Participant


@dataclass(slots=True)
class _Room:
    """A space, and who is in it."""

    space: Space
    nodes: dict[str, Participant] = field(default_factory=dict)
    seats: list[Seat] = field(default_factory=list)


class Hall:
    """`open` makes a space of a URL; it reports to the first port that needed it."""

    def __init__(self, open: Callable[[str], Space] = open_space) -> None:
        self._open = open
        self._lock = threading.Lock()
        self._rooms: dict[str, _Room] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def enter(self, url: str, node: str, report: Callable[[Finding], object]) -> Seat:
        """A seat as `node` in the space of `url`. TransportError where there is no such space."""

        def sit() -> Seat:
            room = self._rooms.get(url) or self._room(url, report)
            participant = room.nodes.get(node)
            if participant is None:
                participant = room.nodes[node] = room.space.participant(node)
            seat = Seat(url, node, participant)
            room.seats.append(seat)
            return seat

        with self._lock:
            try:
                return self._run(sit)
            finally:
                self._end_if_empty()

    def leave(self, seat: Seat, end: Callable[[], object] = lambda: None) -> None:
        """Give a seat back, after `end` was called in the hall's thread. Giving it back twice is allowed."""

        def go() -> None:
            room = self._rooms.get(seat.url)
            if room is None or seat not in room.seats:
                return
            end()
            room.seats.remove(seat)
            if not any(other.node == seat.node for other in room.seats):
                room.nodes.pop(seat.node).close()
            if not room.seats:
                del self._rooms[seat.url]
                room.space.close()

        with self._lock:
            if self._loop is not None:
                self._run(go)
            self._end_if_empty()

    def run(self, task: Callable[[], R]) -> R:
        """Do it in the hall's thread, and wait for it. TransportError for what a space refuses."""
        with self._lock:
            return self._run(task)

    def post(self, task: Callable[[], object]) -> bool:
        """Do it in the hall's thread, without waiting. False: the hall is closed."""
        loop = self._loop
        if loop is None:
            return False
        try:
            loop.call_soon_threadsafe(task)
        except RuntimeError:  # closed in between
            return False
        return True

    def _run(self, task: Callable[[], R]) -> R:
        """With the lock held."""
        done: Future[R] = Future()

        def work() -> None:
            try:
                done.set_result(task())
            except BaseException as error:
                done.set_exception(error)

        self._started().call_soon_threadsafe(work)
        try:
            return done.result(CALL_TIME)
        except TimeoutError:
            raise TransportError(f"the space did not answer within {CALL_TIME:g} s") from None
        except (SpaceError, ValueError, OSError) as error:
            raise TransportError(str(error)) from error

    def _room(self, url: str, report: Callable[[Finding], object]) -> _Room:
        assert self._loop is not None
        space = self._open(url)
        try:
            space.attach(self._loop)
        except BaseException:
            space.close()
            raise
        space.findings.on_finding(report)
        room = self._rooms[url] = _Room(space)
        return room

    def _started(self) -> asyncio.AbstractEventLoop:
        if self._loop is None:
            loop = self._loop = asyncio.new_event_loop()
            self._thread = threading.Thread(target=_serve, args=(loop,), name="muros rtc space", daemon=True)
            self._thread.start()
        return self._loop

    def _end_if_empty(self) -> None:
        if self._rooms or self._loop is None or self._thread is None:
            return
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(CALL_TIME)
        self._loop = self._thread = None


def _serve(loop: asyncio.AbstractEventLoop) -> None:
    try:
        loop.run_forever()
    finally:
        loop.close()


HALL: Final = Hall()
"""The hall of this process."""
