"""Factories: what kinds of components a manager can make, and how many of each there are."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from muros.rtc.codes import RtcError
from muros.rtc.component import Component
from muros.rtc.manager._requests import ComponentId

if TYPE_CHECKING:
    from muros.rtc.manager._manager import Manager

__all__ = ["Factories", "Factory", "LimitError"]


class LimitError(RtcError):
    """A kind of component has as many instances as its max_instance allows."""


@dataclass(frozen=True, slots=True, eq=False)
class Factory:
    """One kind of component: its properties, what makes one, and what is called when one has ended."""

    properties: Mapping[str, str]
    create: Callable[[Manager], Component]
    delete: Callable[[Component], object] | None = None
    module: Path | None = None
    """The file it came from."""

    @property
    def name(self) -> str:
        """Its implementation id."""
        return self.properties.get("implementation_id") or self.properties.get("type_name", "")

    @property
    def max_instance(self) -> int:
        """Instances at most; 0: any number."""
        text = self.properties.get("max_instance", "").strip() or "0"
        try:
            return max(0, int(text))
        except ValueError:
            raise RtcError(
                f"{self.name}: max_instance is {text!r}; it is a number, 0 for any number"
            ) from None


class Factories:
    """The kinds that are registered, and the instances that stand, with those being made."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._factories: list[Factory] = []
        self._instances: dict[str, Factory] = {}

    @property
    def all(self) -> tuple[Factory, ...]:
        """The factories, in the order of registering."""
        return tuple(self._factories)

    def add(self, factory: Factory) -> bool:
        """Register a kind. False where one with the same id, vendor, category, language and version is there."""
        if not factory.name:
            raise RtcError("a component's specification has no implementation_id")
        with self._lock:
            if any(_key(other.properties) == _key(factory.properties) for other in self._factories):
                return False
            self._factories.append(factory)
            return True

    def remove(self, factory: Factory) -> None:
        """Forget a kind; its instances stay."""
        with self._lock:
            if factory in self._factories:
                self._factories.remove(factory)

    def find(self, wanted: ComponentId) -> Factory | None:
        """The first kind that fits."""
        return next((factory for factory in self.all if wanted.fits(factory.properties)), None)

    def instances(self, factory: Factory) -> tuple[str, ...]:
        """The names of a kind's instances."""
        with self._lock:
            return tuple(name for name, other in self._instances.items() if other is factory)

    def reserve(self, name: str, factory: Factory) -> bool:
        """Take an instance name. False where it is taken. LimitError where the kind has all it may have."""
        limit = factory.max_instance
        with self._lock:
            if name in self._instances:
                return False
            if limit and sum(other is factory for other in self._instances.values()) >= limit:
                raise LimitError(
                    f"there are {limit} instances of {factory.name} already, as many as its max_instance allows"
                )
            self._instances[name] = factory
            return True

    def release(self, name: str) -> Factory | None:
        """Give an instance name back."""
        with self._lock:
            return self._instances.pop(name, None)


def _key(properties: Mapping[str, str]) -> tuple[str, ...]:
    keys = ("implementation_id", "vendor", "category", "language", "version")
    return tuple(properties.get(key, "") for key in keys)
