"""Profiles: how components, ports, connectors and contexts describe themselves, as values.

Properties are texts by dotted names, as tools show them; only a connector's may also hold references to objects
(`Reference`: opaque here, CORBA objects in ``muros.rtc.corba``). Peers of a port are `PeerPort`: a port of this
process or one behind CORBA, which answers the same questions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeAlias

from muros.rtc.codes import Polarity, ReturnCode

__all__ = [
    "ComponentProfile",
    "ConnectorProfile",
    "InterfaceProfile",
    "PeerPort",
    "PortProfile",
    "PropertyValue",
    "Reference",
]

Reference: TypeAlias = object
"""A reference to an object that other processes can call; opaque outside ``muros.rtc.corba``."""

PropertyValue: TypeAlias = "str | Reference"


@dataclass(frozen=True, slots=True)
class InterfaceProfile:
    """One interface of a service port. RTC 1.1, 5.4.2.7."""

    instance_name: str
    type_name: str
    polarity: Polarity


@dataclass(frozen=True, slots=True)
class ConnectorProfile:
    """A connection, asked for or standing. RTC 1.1, 5.4.2.4.

    Profiles are passed from port to port and grow on their way; each step makes a new one (`with_properties`).
    """

    name: str = ""
    connector_id: str = ""
    ports: tuple[PeerPort, ...] = ()
    properties: Mapping[str, PropertyValue] = field(default_factory=dict)

    def text(self, key: str, default: str = "") -> str:
        """The property `key` where it is a text, without surrounding blanks; `default` where it is not there."""
        value = self.properties.get(key, default)
        return value.strip() if isinstance(value, str) else default

    def with_properties(self, more: Mapping[str, PropertyValue]) -> ConnectorProfile:
        """The same with `more` properties; those of the same name are replaced."""
        return replace(self, properties={**self.properties, **more})


@dataclass(frozen=True, slots=True)
class PortProfile:
    """A port as tools see it. RTC 1.1, 5.4.2.2."""

    name: str
    """`<instance>.<port>`"""
    port: PeerPort
    owner: object
    """The component, as a model object; its servant makes the reference."""
    interfaces: tuple[InterfaceProfile, ...] = ()
    connectors: tuple[ConnectorProfile, ...] = ()
    properties: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ComponentProfile:
    """A component as tools see it. RTC 1.1, 5.4.2.1."""

    instance_name: str
    type_name: str
    description: str
    version: str
    vendor: str
    category: str
    ports: tuple[PortProfile, ...]
    properties: Mapping[str, str]


class PeerPort(Protocol):
    """A port as other ports see it: here, or in another process. RTC 1.1, 5.4.2.8 (PortService).

    Two that stand for the same port are equal and have the same hash. The operations of a port of another process
    raise `PeerLostError` when it does not answer.
    """

    def notify_connect(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]: ...

    def notify_disconnect(self, connector_id: str) -> ReturnCode: ...

    def is_there(self) -> bool:
        """Whether the port still exists: asked of its process."""
        ...
