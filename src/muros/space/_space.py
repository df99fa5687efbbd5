"""What the spaces of all engines have in common: findings, clock, bounds, ticks, and what they refuse."""

from __future__ import annotations

from collections.abc import Callable

from muros.findings import Findings
from muros.space._core import Core, Engine, Limits
from muros.space._door import ClosedError
from muros.space._endpoint import Closing, Home

__all__ = ["EngineSpace"]


class EngineSpace(Closing):
    """A space. See `muros.space.Space`. An engine makes participants, serves it on a loop, and closes it."""

    def __init__(
        self,
        url: str,
        domain: int,
        findings: Findings | None,
        clock: Callable[[], int],
        limits: Limits | None,
        engine: Engine | None = None,
    ) -> None:
        """`engine` has work of its own to be done in ticks."""
        self.url = url
        self.domain = domain
        self.findings = Findings() if findings is None else findings
        self.clock = clock
        self.closed = False
        self._core = Core(clock, self.findings, limits or Limits(), engine)

    @property
    def limits(self) -> Limits:
        """The bounds it keeps."""
        return self._core.limits

    def tick(self) -> int | None:
        """Do what has become due. Returns when to call again, None = when asked to."""
        return None if self.closed else self._core.tick()

    def on_wake(self, callback: Callable[[], object] | None) -> None:
        """Call `callback` when `tick` is needed earlier than it said."""
        self._core.on_wake = callback

    def check_open(self) -> None:
        """ClosedError if it is closed."""
        if self.closed:
            raise ClosedError("the space is closed; open another one")

    def check_free(self, key: bytes | None, holder: Home | None) -> None:
        """ValueError if somebody has the key of a new participant."""
        if holder is not None:
            raise ValueError(f"key {key!r} is in use by {holder.owner}; close it first, or take another key")
