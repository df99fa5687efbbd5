"""Grounds: the spaces that contexts stand on, and who of them is told what a space reports.

Contexts that are opened by URL share one space for each engine and domain, so that they meet; it is closed with the
last of them. A space that was given is the giver's: contexts leave it, and tell only of their own nodes.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from muros.findings import Finding
from muros.rclc.errors import RclError
from muros.space._door import Space
from muros.space.rclc._problems import NOT_SCHEDULED
from muros.space.rclc._serving import Server

if TYPE_CHECKING:
    from muros.space.rclc._middleware import SpaceMiddleware

__all__ = ["Ground"]

_OF_THE_LOOP: Final = (
    "the asyncio loop of this program serves this space, and other threads may not use it meanwhile: "
    "hand it over with loop.call_soon_threadsafe(...), or give the context a space of its own"
)


class LoopLock:
    """In place of the server's lock where the loop of a program serves a space: it lets in the loop's thread alone.

    Raises RclError for other threads while the loop runs.
    """

    def __init__(self, lock: threading.RLock, loop: asyncio.AbstractEventLoop) -> None:
        self._lock = lock
        self._loop = loop
        self._thread = threading.get_ident()

    def __enter__(self) -> None:
        if threading.get_ident() != self._thread and self._loop.is_running():
            raise RclError(_OF_THE_LOOP)
        self._lock.acquire()

    def __exit__(self, *error: object) -> None:
        self._lock.release()


class Ground:
    """A space that is attached to `loop`, and the contexts on it.

    `owned`: it is closed with the last of them; `on_gone` is called then.
    """

    def __init__(
        self,
        space: Space,
        server: Server,
        loop: asyncio.AbstractEventLoop,
        on_gone: Callable[[], object],
        *,
        owned: bool,
    ) -> None:
        self.space = space
        self.server = server
        self.owned = owned
        self.loop = loop
        self.served = served = loop is server.loop
        """Whether we serve it; else the asyncio loop of this thread does, and nobody here can wait."""
        self.lock = server.lock if served else LoopLock(server.lock, loop)
        """What is held while the space is used."""
        self.contexts: list[SpaceMiddleware] = []
        self._on_gone = on_gone
        self._deaf = space.findings.on_finding(self._tell)
        if served:
            server.use()

    def enter(self, context: SpaceMiddleware) -> None:
        """A context comes."""
        self.contexts.append(context)

    def leave(self, context: SpaceMiddleware) -> None:
        """A context goes; with the last one the ground is gone too."""
        self.contexts.remove(context)
        if self.contexts:
            return
        self._on_gone()
        if self.owned:
            self.space.close()
        self._deaf()
        if self.served:
            self.server.release()

    def _tell(self, finding: Finding) -> None:
        """Give a finding to the contexts whose node it is about; what is about nobody, to those who listen."""
        if finding.code == NOT_SCHEDULED:
            return
        hearing = [context for context in self.contexts if finding.who in context.owners]
        if not hearing and self.owned:
            hearing = [context for context in self.contexts if context.on_problem is not None]
            if len(hearing) < len(self.contexts):  # who does not listen has it printed, once
                hearing.append(next(c for c in self.contexts if c.on_problem is None))
        for context in hearing:
            context.findings.append(finding)
            self.server.wake(context)
