"""Service objects without an ORB: references are texts, activity is a flag, calls are calls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from muros.rtc.codes import PeerLostError, RtcError
from muros.rtc.services import ServiceTypeError


class MyService:
    """An interface, as a compiler might have made it."""

    operations: tuple[str, ...] = ("echo",)


class BetterService(MyService):
    """One derived from it."""


class OtherService:
    operations: tuple[str, ...] = ()


class LostError(Exception):
    """What the ORB raises for an object that does not exist."""


class DeclaredError(Exception):
    """What an interface declares."""


@dataclass
class Offered:
    reference: str
    interface: Any
    target: Any
    active: bool = False

    def activate(self) -> None:
        self.active = True

    def deactivate(self) -> None:
        self.active = False


@dataclass
class Proxy:
    offered: Offered

    def __getattr__(self, operation: str) -> Any:
        def call(*arguments: Any) -> Any:
            if not self.offered.active:
                raise LostError("OBJECT_NOT_EXIST")
            return getattr(self.offered.target, operation)(*arguments)

        return call


@dataclass
class Objects:
    """Fulfils `ServiceObjects`."""

    offered: dict[str, Offered] = field(default_factory=dict)
    compiled: list[tuple[str, Path]] = field(default_factory=list)

    def interface(self, name: str, idl: Path) -> Any:
        self.compiled.append((name, idl))
        return MyService

    def type_name(self, interface: Any) -> str:
        return str(interface.__name__)

    def offer(self, interface: Any, target: object, on_error: Callable[[str, Exception], object]) -> Offered:
        for operation in interface.operations if interface else ():
            if not hasattr(target, operation):
                raise RtcError(f"{type(target).__name__} has no method {operation}")
        reference = f"IOR:{len(self.offered)}"
        self.offered[reference] = Offered(reference, interface, target)
        return self.offered[reference]

    def resolve(self, reference: str, interface: Any) -> Any:
        if reference not in self.offered:
            raise RtcError(f"{reference} leads nowhere")
        offered = self.offered[reference]
        if interface and offered.interface and not issubclass(offered.interface, interface):
            raise ServiceTypeError(f"it is a {offered.interface.__name__}")
        return Proxy(offered)

    def explain(self, error: Exception) -> RtcError | None:
        return PeerLostError("the provider is not active") if isinstance(error, LostError) else None
