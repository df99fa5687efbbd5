"""The calling side of a service: an object that is called like the provider, wherever that is."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Final

from muros.rtc.services._objects import NotConnectedError, ServiceObjects

__all__ = ["Consumer"]


class Consumer:
    """A required interface. Its operations are called on it: `consumer.echo("hello")`.

    While the port is not connected that raises NotConnectedError; where the provider has ended or is not active,
    PeerLostError; what the interface itself declares is raised as it is. After a second connection the newer provider
    is called, until that connection ends.
    """

    def __init__(self, interface: Any = None) -> None:
        self.interface = interface
        """The class that an IDL compiler made for callers; None where objects are not to be narrowed."""
        self.name_by: Callable[[], str] = lambda: "the service"
        """What errors call it; the port that it is registered at says it."""
        self._providers: dict[str, Any] = {}
        self._objects: ServiceObjects | None = None
        self._lock: Final = threading.Lock()
        self._current = _Provider(None)

    @property
    def is_connected(self) -> bool:
        """Whether there is a provider to call."""
        return self._current.object is not None

    @property
    def object(self) -> Any:
        """The provider itself, as the ORB hands it out; None while there is none."""
        return self._current.object

    def __bool__(self) -> bool:
        return self._current.object is not None

    def __getattr__(self, operation: str) -> Callable[..., Any]:
        if operation.startswith("__"):
            raise AttributeError(operation)
        provider = self._current
        if provider.object is None:
            raise NotConnectedError(
                f"{self.name_by()} is not connected, {operation} cannot be called: connect its port with one that "
                "provides the interface (rtcon, or an editor), or look at is_connected before"
            )
        call = provider.calls.get(operation)
        if call is None:
            call = provider.calls[operation] = self._checked(getattr(provider.object, operation))
        return call

    # What its port calls

    def connect(self, connector_id: str, provider: Any, objects: ServiceObjects) -> None:
        """Call `provider` from now on."""
        with self._lock:
            self._objects = objects
            self._providers[connector_id] = provider
            self._choose()

    def disconnect(self, connector_id: str) -> None:
        """Forget the provider of a connection, if there is one."""
        with self._lock:
            if self._providers.pop(connector_id, None) is not None:
                self._choose()

    def _choose(self) -> None:
        self._current = _Provider(next(reversed(self._providers.values()), None))

    def _checked(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """`call`, with errors that say what is the matter."""
        if not callable(call):
            return call

        def checked(*arguments: Any) -> Any:
            try:
                return call(*arguments)
            except Exception as error:
                meant = self._objects.explain(error) if self._objects is not None else None
                if meant is None:
                    raise
                raise type(meant)(f"{self.name_by()}: {meant}") from error

        return checked


class _Provider:
    """Who is called, with the calls made of it so far."""

    __slots__ = ("calls", "object")

    def __init__(self, object_: Any) -> None:
        self.object = object_
        self.calls: dict[str, Callable[..., Any]] = {}
