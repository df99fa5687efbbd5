"""Service ports under their old names."""
# ruff: noqa: N802, N803 (the names are those that components know)

from __future__ import annotations

from typing import Any

from muros.findings import Finding
from muros.rtc.codes import RtcError
from muros.rtc.services import Consumer, ServicePort, service_objects
from OpenRTM_aist._ports import PortBase

__all__ = ["CorbaConsumer", "CorbaConsumerBase", "CorbaPort"]


class CorbaConsumer(Consumer):
    """A required interface: `_ptr()` is what to call, None while there is nothing.

    Calling the consumer itself (`consumer.echo("hello")`) says what is the matter where it is not connected.
    """

    def __init__(self, interfaceType: Any = None, consumer: CorbaConsumer | None = None) -> None:
        super().__init__(interfaceType if consumer is None else consumer.interface)
        self._given: Any = None

    def _ptr(self, get: bool = False) -> Any:
        return self.object if self.object is not None else self._given

    def getObject(self) -> Any:
        return self._ptr()

    def setObject(self, obj: Any) -> bool:
        """Call `obj`, a reference, instead of what connections bring. False where it has another interface."""
        self._given = None
        if obj is None:
            return False
        self._given = obj if self.interface is None else obj._narrow(self.interface)
        return self._given is not None

    def releaseObject(self) -> None:
        self._given = None


CorbaConsumerBase = CorbaConsumer


class CorbaPort(PortBase):
    """A service port."""

    def __init__(self, name: str) -> None:
        super().__init__(ServicePort(name))
        self._service: ServicePort = self.port  # type: ignore[assignment]

    def registerProvider(self, instance_name: str, type_name: str, provider: Any) -> bool:
        """Provide an interface with `provider`, a servant. False where it cannot be; a finding says why."""
        try:
            self._service.register_provider(instance_name, type_name, provider)
        except RtcError as error:
            self._refused(f"provider {type_name} {instance_name}", error)
            return False
        return True

    def registerConsumer(self, instance_name: str, type_name: str, consumer: CorbaConsumer) -> bool:
        """Require an interface through `consumer`. False where it cannot be; a finding says why."""
        try:
            self._service.register_consumer(instance_name, type_name, consumer)
        except RtcError as error:
            self._refused(f"consumer {type_name} {instance_name}", error)
            return False
        return True

    def _refused(self, what: str, error: RtcError) -> None:
        who = f"port {self.port.full_name}"
        self.port.report(Finding("register-failed", who, f"{what} not registered", str(error)))

    def activateInterfaces(self) -> None:
        self._service.activate()

    def deactivateInterfaces(self) -> None:
        self._service.deactivate()


def to_reference(text: str) -> Any:
    """The object that a reference as text (IOR:..., corbaloc:...) leads to."""
    return service_objects().resolve(text, None)
