"""What service ports need of the ORB, as a protocol: this room knows no CORBA.

The room that does (`muros.rtc.corba`) registers itself with `use_service_objects`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from muros.rtc.codes import RtcError

__all__ = [
    "NotConnectedError",
    "OfferedObject",
    "ServiceObjects",
    "ServiceTypeError",
    "service_objects",
    "use_service_objects",
]


class NotConnectedError(RtcError):
    """A required service was called while its port is not connected to a provider."""


class ServiceTypeError(RtcError):
    """An object does not have the interface that is asked of it."""


class OfferedObject(Protocol):
    """An object of this process that others may be given a reference to. Made inactive."""

    @property
    def reference(self) -> str:
        """`IOR:...`; the same for its whole life."""

    def activate(self) -> None:
        """From now on callers reach it. Twice is allowed."""

    def deactivate(self) -> None:
        """From now on callers are told that it does not exist. Twice is allowed."""


class ServiceObjects(Protocol):
    """Interfaces are the classes that an IDL compiler makes for callers (`SimpleService.MyService`)."""

    def interface(self, name: str, idl: Path) -> Any:
        """The interface of that name (`SimpleService::MyService`) in an IDL file. RtcError if it has none."""

    def type_name(self, interface: Any) -> str:
        """Its name without the modules it stands in: `MyService`."""

    def offer(
        self, interface: Any, target: object, on_error: Callable[[str, Exception], object]
    ) -> OfferedObject:
        """An object whose operations are the methods of `target`, or `target` itself where it is a servant.

        `interface` is not needed for a servant (None). RtcError where an operation is missing. `on_error` is told
        the operation that raised what its interface does not declare, and what that was.
        """

    def resolve(self, reference: str, interface: Any) -> Any:
        """What `reference` leads to, to be called as `interface`; None if to nothing.

        A provider that is not active cannot be asked what it is: it is believed. ServiceTypeError: it is something
        else. RtcError: no reference, or nobody there.
        """

    def explain(self, error: Exception) -> RtcError | None:
        """What a call's error means (PeerLostError, RtcError); None for those that the interface itself declares."""


_in_use: ServiceObjects | None = None


def use_service_objects(objects: ServiceObjects | None) -> None:
    """Let service ports that are not given any use these."""
    global _in_use
    _in_use = objects


def service_objects() -> ServiceObjects:
    """Those in use. RtcError if there are none."""
    if _in_use is None:
        raise RtcError("service ports need an ORB: start one first (muros.rtc.corba), or let a Manager do it")
    return _in_use
