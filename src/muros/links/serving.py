"""What servers of links have in common in an asyncio program: links that open together, one timer, and watchers."""

from __future__ import annotations

import asyncio
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar

from muros.findings import Finding
from muros.links._door import Address, Link, LinkEvents
from muros.links.voice import Event, Voice

__all__ = ["LinkDoor", "LinkServer", "now_ms"]

_NS_PER_MS = 1_000_000
_AFTER_FAILURE = 100
"""When timers are looked at again after one has failed, in ms."""

_OF_A_PORT = frozenset({"port-absent", "port-unusable", "line-noise"})
"""Problems that name a port of a link with several: each port is told of, and counted, by itself."""

E = TypeVar("E", bound=Event)


class Port(Protocol):
    """A link at a server's core."""

    def receive(self, data: bytes, address: Address, now: int) -> None:
        """Takes what came from ``address`` at ``now`` (ms)."""


def now_ms() -> int:
    """The monotonic clock of servers, in ms."""
    return time.monotonic_ns() // _NS_PER_MS


class LinkDoor(LinkEvents):
    """What one link tells a server: the events of a link, turned into calls of the core. Kinds of it add the others."""

    def __init__(self, port: Port, voice: Voice[Any]) -> None:
        self._receive = port.receive
        self._voice = voice

    def on_message(self, link: Link, data: bytes, address: Address) -> None:
        """A message came."""
        self._receive(data, address, time.monotonic_ns() // _NS_PER_MS)

    def on_problem(self, link: Link, code: str, what: str, why: str, remedy: str, n: int) -> None:
        """Something was dropped, refused or does not work."""
        subject = what if code in _OF_A_PORT else ""
        self._voice.report(code, who=link.name, what=what, why=why, remedy=remedy, subject=subject, n=n)


D = TypeVar("D", bound=LinkDoor)


class LinkServer(ABC, Generic[E, D]):
    """A server on the thread of the loop that runs it. ``core`` is the same without I/O, ``what`` it is in a word.

    It serves from `start` to `close`, once. ``links`` are those that it has, ``findings`` what went wrong.
    """

    def __init__(self, core: Voice[E], what: str) -> None:
        self.findings = core.findings
        self.links: list[Link] = []
        self._doors: dict[Link, D] = {}
        self._voice = core
        self._what = what
        self._watchers: list[Callable[[E], object]] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = 0
        self._ticking = False
        self._wanted: list[int] = []
        self._closed: asyncio.Event | None = None
        self._ended = False
        core.on_event = self._tell
        core.on_wake = self._arm

    def on_event(self, callback: Callable[[E], object]) -> Callable[[], None]:
        """Calls ``callback`` with every event from now on; returns a function that ends it."""
        self._watchers.append(callback)
        return lambda: self._watchers.remove(callback)

    def on_finding(self, callback: Callable[[Finding], object]) -> Callable[[], None]:
        """Calls ``callback`` with every new finding and with summaries; returns a function that ends it."""
        return self.findings.on_finding(callback)

    async def start(self) -> None:
        """Opens the links and serves in the background. Raises LinkError; no link is open then, and one may try again.

        Raises RuntimeError for one that serves already or was closed: make a new one.
        """
        if self._loop is not None or self._ended:
            raise RuntimeError(
                f"this {self._what} was closed: make a new one"
                if self._ended
                else f"this {self._what} runs already"
            )
        self._loop = asyncio.get_running_loop()
        self._closed = asyncio.Event()
        try:
            self._attach(self._loop)
            for link in self.links:
                link.open(self._doors[link])
        except BaseException:
            self._halt()
            raise
        self._arm(now_ms())

    async def run(self) -> None:
        """Opens the links and serves until `close` is called or the task is cancelled. Raises LinkError."""
        await self.start()
        assert self._closed is not None
        try:
            await self._closed.wait()
        finally:
            await self.stop()

    async def stop(self) -> None:
        """Closes it in good order: with last words, where there are any, that have left."""
        self.close()

    def close(self) -> None:
        """Closes every link and removes all that came through them, for good. Closing twice is harmless."""
        if self._ended:
            return
        self._ended = True
        self._take_leave()
        self._halt()
        self._clear()
        self.findings.flush()
        self._release()
        if self._closed is not None:
            self._closed.set()

    @abstractmethod
    def _attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """It begins to serve, on ``loop``; the links open next."""

    def _take_leave(self) -> None:
        """It ends, and the links are still open."""

    @abstractmethod
    def _clear(self) -> None:
        """The links are closed: what came through them goes."""

    @abstractmethod
    def _release(self) -> None:
        """Everything has been said: it closes what is its own."""

    def _add(self, link: Link, door: D) -> None:
        """Adds a link; it opens at the start, or now if that was before. Raises LinkError if it cannot open now."""
        if self._loop is not None:
            link.open(door)
        self.links.append(link)
        self._doors[link] = door

    def _remove(self, link: Link) -> D:
        """Takes a link away, which is still open; returns its door."""
        self.links.remove(link)
        return self._doors.pop(link)

    def _halt(self) -> None:
        self._loop = None
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        for link in self.links:
            link.close()

    def _tell(self, event: E) -> None:
        for callback in list(self._watchers):
            try:
                callback(event)
            except Exception as error:  # whoever watches must not harm those who are watched
                self._voice.report(
                    "watcher-failed",
                    who=getattr(callback, "__qualname__", repr(callback)),
                    what=f"{{n}} event{{s}} not taken by a watcher of the {self._what}",
                    why=f"it raised {type(error).__name__}: {error}",
                    remedy="Mend the callback given to on_event.",
                )

    def _arm(self, tick: int) -> None:
        """Sees to a call of `_tick` at ``tick`` (ms) at the latest."""
        if self._ticking:
            self._wanted.append(tick)
            return
        if self._loop is None or (self._timer is not None and self._timer_at <= tick):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer_at = tick
        self._timer = self._loop.call_later(max(0, tick - now_ms()) / 1000, self._tick)

    def _tick(self) -> None:
        self._timer = None
        self._ticking = True  # what is wanted meanwhile is seen to at the end
        now = now_ms()
        try:
            due = self._voice.tick(now)
        except Exception as error:  # said loudly, yet the server goes on, and with it everybody else
            due = now + _AFTER_FAILURE
            context = {"message": f"the {self._what} has failed at a timer", "exception": error}
            asyncio.get_running_loop().call_exception_handler(context)
        finally:
            self._ticking = False
        waits, self._wanted = self._wanted, []
        if due is not None:
            waits.append(due)
        seconds = time.time()
        findings_due = self.findings.tick(seconds)
        if findings_due is not None:
            waits.append(now + max(0, int((findings_due - seconds) * 1000)) + 1)
        if waits:
            self._arm(min(waits))
