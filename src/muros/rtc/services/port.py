"""Service ports: interfaces that a component provides to others, and those that it requires of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from muros.findings import Finding, Severity
from muros.rtc.codes import Polarity, PortType, ReturnCode, RtcError
from muros.rtc.ports import Port, PortOwner
from muros.rtc.profiles import ConnectorProfile, InterfaceProfile
from muros.rtc.services._matching import Interface, find, is_strict, offers
from muros.rtc.services._objects import (
    OfferedObject,
    ServiceObjects,
    ServiceTypeError,
    service_objects,
)
from muros.rtc.services.consumer import Consumer

__all__ = ["ServicePort"]

OK = ReturnCode.RTC_OK


class ServicePort(Port):
    """A port with any number of provided and required interfaces. OpenRTM-aist's CorbaPort.

    Providers can be called while the component is active, as with OpenRTM-aist. `objects` is what makes references
    of servants; the one registered if not given.
    """

    def __init__(
        self,
        name: str,
        properties: Mapping[str, str] = {},
        *,
        owner: PortOwner | None = None,
        objects: ServiceObjects | None = None,
        report: Callable[[Finding], object] | None = None,
    ) -> None:
        super().__init__(name, PortType.SERVICE, properties, owner=owner, report=report)
        self._objects = objects
        self._providers: dict[tuple[str, str], _Provider] = {}
        self._consumers: dict[tuple[str, str], Consumer] = {}
        self._active = False

    @property
    def interfaces(self) -> tuple[InterfaceProfile, ...]:
        """What it provides and requires, in the order of registering, providers first."""
        return tuple(
            InterfaceProfile(instance, type_name, polarity)
            for polarity, known in (
                (Polarity.PROVIDED, self._providers),
                (Polarity.REQUIRED, self._consumers),
            )
            for type_name, instance in known
        )

    def register_provider(
        self, instance_name: str, type_name: str, target: object, interface: Any = None
    ) -> None:
        """Provide an interface: calls become calls of `target`'s methods.

        `target` is a servant (then `interface` is not needed) or any object that has the operations. RtcError: the
        names are taken, or an operation is missing.
        """
        key = self._new_key(instance_name, type_name)
        offered = self._space().offer(interface, target, self._operation_failed)
        self._providers = {**self._providers, key: _Provider(target, offered)}
        if self._active:
            offered.activate()

    def register_consumer(self, instance_name: str, type_name: str, consumer: Consumer) -> Consumer:
        """Require an interface, which is called through `consumer`. RtcError: the names are taken."""
        key = self._new_key(instance_name, type_name)
        self._consumers = {**self._consumers, key: consumer}
        consumer.name_by = lambda: f"{type_name} {instance_name} of port {self.full_name}"
        return consumer

    def activate(self) -> None:
        """Let providers be called."""
        self._active = True
        for provider in self._providers.values():
            provider.offered.activate()

    def deactivate(self) -> None:
        """Let providers be called no longer."""
        self._active = False
        for provider in self._providers.values():
            provider.offered.deactivate()

    # ---- negotiation

    def allows_again(self, profile: ConnectorProfile) -> bool:
        """Always: each connection may serve another interface."""
        return True

    def publish_interfaces(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
        """Add the references of the providers."""
        for (type_name, instance), provider in self._providers.items():
            profile = profile.with_properties(
                offers(self._interface(type_name, instance), provider.offered.reference)
            )
        return OK, profile

    def subscribe_interfaces(self, profile: ConnectorProfile) -> ReturnCode:
        """Find a provider for every consumer. RTC_ERROR where there is none and the connection is strict."""
        missing = False
        for (type_name, instance), consumer in self._consumers.items():
            missing |= not self._serve(self._interface(type_name, instance), consumer, profile)
        return ReturnCode.RTC_ERROR if missing and is_strict(profile) else OK

    def unsubscribe_interfaces(self, profile: ConnectorProfile) -> None:
        """Forget the providers of this connection."""
        for consumer in self._consumers.values():
            consumer.disconnect(profile.connector_id)

    # ---- inside

    def _serve(self, wanted: Interface, consumer: Consumer, profile: ConnectorProfile) -> bool:
        """Give `consumer` its provider; whether there is one, or is meant to be none."""
        match = find(profile.properties, wanted)
        if match.on_purpose:
            return True
        complaints = [match.complaint] if match.complaint else []
        served = False
        for key, reference in match.candidates:
            try:
                provider = self._space().resolve(reference, consumer.interface)
            except ServiceTypeError as error:
                complaints.append(f"{key} is of another type: {error}")
            except RtcError as error:
                complaints.append(f"{key}: {error}")
            else:
                if provider is not None:
                    consumer.connect(profile.connector_id, provider, self._space())
                    served = True
                    break
                complaints.append(f"{key} is nil")
        if complaints or not served:
            self._tell(
                "service-mapping" if served else "service-without-provider",
                f"connection {profile.name}: {wanted.type_name} {wanted.instance_name} "
                + ("is not served as asked" if served else "finds no provider"),
                "; ".join(complaints) or f"nobody offers {wanted.old_key}",
                f"Give provider and consumer the same instance name, or map them: {wanted.required_key} = "
                "the provider's key",
            )
        return served

    def _operation_failed(self, operation: str, error: Exception) -> None:
        self._tell(
            "service-failed",
            f"operation {operation} raised",
            f"{type(error).__name__}: {error}",
            "The caller was told CORBA.UNKNOWN. Let the operation raise what its interface declares.",
            Severity.ERROR,
        )

    def _space(self) -> ServiceObjects:
        return self._objects if self._objects is not None else service_objects()

    def _interface(self, type_name: str, instance_name: str) -> Interface:
        owner = self.owner.instance_name if self.owner is not None else ""
        return Interface(owner, self.name, type_name, instance_name)

    def _new_key(self, instance_name: str, type_name: str) -> tuple[str, str]:
        key = (type_name, instance_name)
        if key in self._providers or key in self._consumers:
            raise RtcError(
                f"port {self.full_name} has an interface {type_name} {instance_name} already: "
                "give each one another instance name"
            )
        return key


@dataclass(frozen=True, slots=True)
class _Provider:
    target: object
    offered: OfferedObject
