"""A process's names at its name servers: never those of others who live, and nobody waits for a server that is silent.

`Names` (in `_naming.py`) asks every server; this decides what is asked for, and when it is better asked by a thread of
its own: while a server is away, names are bound and given back in the background, one after the other.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as FutureTimeoutError
from functools import partial
from typing import Any, Final

from muros.rtc.codes import PeerLostError, RtcError
from muros.rtc.corba._lost import is_there, quick_answer
from muros.rtc.corba._naming import Names, NameServer, _quoted, is_same, lives, split_path
from muros.rtc.corba._orb import Orb
from muros.rtc.reports import Reporter

__all__ = ["Registration"]

NAME_TIMEOUT: Final = 2.0
"""Seconds that one question to a name server may take."""

AWAY: Final = 5.0
"""Seconds for which a name server that did not answer is not asked."""


class Registration:
    """Names at the servers of `addresses`. Any thread may call; nothing raises for what servers do."""

    def __init__(self, orb: Orb, addresses: Iterable[str], reporter: Reporter) -> None:
        self._names: Final = Names(orb, addresses, report=reporter.take)
        self._reporter = reporter
        self._lock = threading.Lock()
        self._waiting: dict[str, Any] = {}
        """Names that living objects of others have."""
        self._silent: dict[str, float] = {}
        """When each name server did not answer last."""
        self._background = ThreadPoolExecutor(1, "rtc-names")
        self._last: Future[None] | None = None

    @property
    def servers(self) -> tuple[NameServer, ...]:
        """The name servers."""
        return self._names.servers

    def bind(self, names: Iterable[str], reference: Any) -> None:
        """Give `reference` these names, now or as soon as servers answer and nobody else has them."""
        for name in names:
            try:
                split_path(name)
            except RtcError as error:
                self._tell(name, str(error), "Mend naming.formats")
                continue
            self._change(partial(self._bind, name, reference))

    def unbind(self, names: Iterable[str]) -> None:
        """Give names back."""
        for name in names:
            self._change(partial(self._unbind, name))

    def update(self) -> None:
        """Bind what servers lack."""
        with quick_answer(NAME_TIMEOUT):
            self._names.update()
            with self._lock:
                waiting = dict(self._waiting)
            for name, reference in waiting.items():
                self._bind(name, reference)

    def close(self) -> None:
        """Give all names back; a server that is silent is waited for a little."""
        self._change(self._names.unbind_all)
        last = self._last
        if last is not None:
            with contextlib.suppress(FutureTimeoutError):
                last.result(2 * NAME_TIMEOUT)
        self._background.shutdown(wait=False, cancel_futures=True)

    def is_free(self, name: str) -> bool:
        """Whether no living object of others has the name at any server that answers."""
        return self._is_free(name, self._answering())

    def _is_free(self, name: str, servers: Iterable[NameServer]) -> bool:
        for server in servers:
            with self._noted(server):
                bound = server.resolve(name)
                if bound is None or is_same(bound, self._names.bound.get(name)):
                    continue
                if is_there(bound):
                    return False
        return True

    def instance_names(self) -> set[str]:
        """The ids of all components that the servers know."""
        names = set[str]()
        for server in self._answering():
            with self._noted(server):
                names |= {binding.name for _, binding in server.walk() if binding.kind == "rtc"}
        return names

    def objects_in(self, context: str, kind: str) -> list[tuple[str, Any]]:
        """The living objects that have names of a kind in a context, with the names' ids."""
        found: list[tuple[str, Any]] = []
        for server in self._answering():
            with self._noted(server):
                names = [one.name for one in server.list(context) if one.kind == kind]
                bound = [(name, server.resolve(f"{context}/{_quoted(name)}.{kind}")) for name in names]
                found += [(name, one) for name, one in bound if one is not None and lives(one)]
        return found

    def _answering(self) -> list[NameServer]:
        now = time.monotonic()
        return [server for server in self.servers if now - self._silent.get(server.address, -AWAY) >= AWAY]

    @contextlib.contextmanager
    def _noted(self, server: NameServer) -> Iterator[None]:
        """Around questions to a server: a silent one is left alone for a while, what it refuses is passed over."""
        with quick_answer(NAME_TIMEOUT):
            try:
                yield
            except PeerLostError:
                self._silent[server.address] = time.monotonic()
            except RtcError:
                pass

    def _change(self, change: Callable[[], object]) -> None:
        """Change names at all servers: at once where they answer, else behind what waits in the background."""

        def made() -> None:
            begin = time.monotonic()
            with quick_answer(NAME_TIMEOUT):
                change()
            if time.monotonic() - begin >= NAME_TIMEOUT:  # one was silent; which one, only `Names` knows
                self._silent.update(dict.fromkeys((one.address for one in self.servers), time.monotonic()))

        behind = self._last is not None and not self._last.done()
        if not behind and len(self._answering()) == len(self.servers):
            made()
        else:
            with contextlib.suppress(RuntimeError):  # closed already
                self._last = self._background.submit(made)

    def _bind(self, name: str, reference: Any) -> None:
        """Bind a name that nobody else has at this moment; one that somebody has waits."""
        free = self._is_free(name, self.servers)
        if free:
            self._names.bind(name, reference)
        with self._lock:
            if free:
                self._waiting.pop(name, None)
                return
            new = name not in self._waiting
            self._waiting[name] = reference
        if new:
            self._tell(
                name,
                "another component that lives has this name",
                "Give it another instance_name, or end the other one: it is bound as soon as the name is free",
            )

    def _unbind(self, name: str) -> None:
        with self._lock:
            waited = self._waiting.pop(name, None)
        if waited is None:
            self._names.unbind(name)

    def _tell(self, name: str, why: str, remedy: str) -> None:
        self._reporter.report(
            "name-not-bound", who="naming", what=f"{name} is not bound", why=why, remedy=remedy, subject=name
        )
