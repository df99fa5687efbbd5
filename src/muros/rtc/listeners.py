"""Listeners: callbacks by kind, told in the order of adding; one that raises is reported and harms nobody."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

__all__ = ["Listeners"]

Kind = TypeVar("Kind", bound=Hashable)
Callback = Callable[..., Any]


class Listeners(Generic[Kind]):
    """Callbacks by kind. Adding and removing is safe from any thread, also while they are told.

    `on_error(kind, error)` hears of a callback that raised.
    """

    def __init__(self, on_error: Callable[[Kind, Exception], object]) -> None:
        self._on_error = on_error
        self._callbacks: dict[Kind, tuple[Callback, ...]] = {}
        self._lock = threading.Lock()

    def add(self, kind: Kind, callback: Callback) -> Callback:
        """Tell `callback` of `kind` from now on. Returns it."""
        with self._lock:
            self._callbacks[kind] = (*self._callbacks.get(kind, ()), callback)
        return callback

    def remove(self, kind: Kind, callback: Callback) -> bool:
        """Tell `callback` no longer. False where it was not there."""
        with self._lock:
            standing = self._callbacks.get(kind, ())
            rest = tuple(other for other in standing if other != callback)
            self._callbacks[kind] = rest
        return len(rest) < len(standing)

    def of(self, kind: Kind) -> tuple[Callback, ...]:
        """Who would be told: cheap, so that nothing is prepared for nobody."""
        return self._callbacks.get(kind, ())

    def tell(self, kind: Kind, *arguments: object) -> None:
        """Call who listens to `kind`."""
        for callback in self._callbacks.get(kind, ()):
            try:
                callback(*arguments)
            except Exception as error:
                self._on_error(kind, error)
