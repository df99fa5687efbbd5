"""Listeners of old programs, which come and go by the program's own objects."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, Protocol

__all__ = ["Listening", "Registry"]


class Registry(Protocol):
    """Whom muros tells of something: those of components, of configurations, of ports and of their connections."""

    def add(self, kind: Any, callback: Callable[..., Any], /) -> object: ...

    def remove(self, kind: Any, callback: Callable[..., Any], /) -> object: ...


class Listening:
    """What muros calls in place of a program's listeners, so that these can be removed."""

    def __init__(self) -> None:
        self._calls: dict[tuple[Hashable, Callable[..., Any]], Callable[..., Any]] = {}

    def begin(
        self,
        event: Hashable,
        listener: Callable[..., Any],
        call: Callable[..., Any],
        *where: Registry,
    ) -> Callable[..., Any]:
        """Have `call` told of `event` for `listener`; returns this."""
        self._calls[event, listener] = call
        for listeners in where:
            listeners.add(event, call)
        return listener

    def end(self, event: Hashable, listener: Callable[..., Any], *where: Registry) -> None:
        """Tell `listener` no longer. Twice is allowed."""
        call = self._calls.pop((event, listener), None)
        if call is not None:
            for listeners in where:
                listeners.remove(event, call)
