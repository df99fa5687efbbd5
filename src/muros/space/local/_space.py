"""The local space: in process, nothing to install, everything delivered in the writer's call."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from muros.findings import Findings
from muros.space._core import Limits
from muros.space._door import SpaceError
from muros.space._participant import prefix_of, prefixes
from muros.space._space import EngineSpace
from muros.space.local._participant import Domain, LocalParticipant
from muros.space.local._view import LocalGraph

if TYPE_CHECKING:
    import asyncio

__all__ = ["LocalSpace", "open_local"]


class LocalSpace(EngineSpace):
    """A space of one process. See `muros.space.Space`."""

    def __init__(
        self,
        *,
        domain: int = 0,
        findings: Findings | None = None,
        clock: Callable[[], int] = time.time_ns,
        limits: Limits | None = None,
    ) -> None:
        super().__init__(f"local:{domain}" if domain else "local:", domain, findings, clock, limits)
        self._domains: dict[int, Domain] = {}
        self._next_prefix = prefixes(os.urandom(8))
        self.graph = LocalGraph(self._core, self._domains, domain)

    def participant(
        self,
        name: str,
        *,
        namespace: str = "/",
        domain: int | None = None,
        enclave: str = "/",
        key: bytes | None = None,
        owner: str = "",
    ) -> LocalParticipant:
        """A new participant."""
        self.check_open()
        number = self.domain if domain is None else domain
        home = self._domains.get(number)
        if home is None:
            for empty in [n for n, d in self._domains.items() if not d.participants]:
                del self._domains[empty]
            home = self._domains[number] = Domain(number)
        prefix = self._next_prefix() if key is None else prefix_of(key)
        self.check_free(key, home.participants.get(prefix))
        return LocalParticipant(self._core, home, prefix, name, namespace, enclave, owner)

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """Serve the space on this loop from now on."""
        self.check_open()
        self._core.driver.attach(loop)

    def close(self) -> None:
        """Close every participant."""
        if self.closed:
            return
        self.closed = True
        self._core.driver.stop()
        for home in tuple(self._domains.values()):
            for participant in tuple(home.participants.values()):
                participant.close()
        self._domains.clear()
        self._core.queue.clear()


def open_local(
    rest: str,
    *,
    findings: Findings | None = None,
    clock: Callable[[], int] = time.time_ns,
    **limits: object,
) -> LocalSpace:
    """The engine of `local:` URLs. `rest` is the default domain; limits are the fields of `Limits`."""
    if rest and not (rest.isascii() and rest.isdigit()):
        raise SpaceError(f"local:{rest}: {rest!r} is no domain number; write local: or local:42")
    unknown = sorted(set(limits) - set(Limits.__dataclass_fields__))
    if unknown:
        known = ", ".join(Limits.__dataclass_fields__)
        raise TypeError(f"local: has no option {', '.join(unknown)} (known: {known})")
    return LocalSpace(domain=int(rest or 0), findings=findings, clock=clock, limits=Limits(**limits))  # type: ignore[arg-type]
