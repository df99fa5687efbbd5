"""What the graphs of engines share that read their books, of one domain or several, when they are asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from muros.space._core import Core
from muros.space._graph import GraphEvent, ParticipantInfo

__all__ = ["EngineGraph"]

D = TypeVar("D")


class EngineGraph(Generic[D]):
    """A graph over the books of `domains`, by number; `domain` is that of the space. See `muros.space.Graph`."""

    def __init__(self, core: Core, domains: dict[int, D], domain: int) -> None:
        self._core = core
        self._domains = domains
        self._domain = domain

    @property
    def participants(self) -> tuple[ParticipantInfo, ...]:
        """All participants."""
        raise NotImplementedError

    @property
    def nodes(self) -> tuple[ParticipantInfo, ...]:
        """The participants that have a node name."""
        return tuple(info for info in self.participants if info.name)

    def watch(self, callback: Callable[[GraphEvent], object]) -> Callable[[], None]:
        """Call `callback` with every change. Returns a function that ends it."""
        key = object()
        self._core.watchers[key] = callback

        def cancel() -> None:
            self._core.watchers.pop(key, None)

        return cancel

    def _home(self, domain: int | None) -> D | None:
        """The books of one domain, None = that of the space."""
        return self._domains.get(self._domain if domain is None else domain)
