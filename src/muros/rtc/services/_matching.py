"""Which provided interface serves which required one: the keys of a connector's properties, and their rules.

A provider adds its reference under two keys: `<owner>.port.<port>.provided.<type>.<instance>`, and as OpenRTM 1.0
had it, `port.<type>.<instance>`. Whoever connects may add `<owner>.port.<port>.required.<type>.<instance>` with the
name of a provider's key as its value. A consumer looks, in this order,

1. where such a mapping points,
2. under the old key: a provider of the same type and instance name,
3. for a provider of another type under the same instance name: whether its object is of the required type, too
   (it may be of a derived interface), is for the caller to find out. This step is ours.

No clock, no calls: pure functions of the properties.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from muros.rtc.profiles import ConnectorProfile, PropertyValue

__all__ = ["Interface", "Match", "find", "is_strict", "offers"]

NOTHING_ON_PURPOSE: Final = ("null", "nil")
"""What a property holds that offers no object and wants no error for it."""

REFERENCE: Final = "IOR:"
STRICTNESS: Final = "port.connection.strictness"


@dataclass(frozen=True, slots=True)
class Interface:
    """One interface of a port, with what its keys are made of."""

    owner: str
    """The component's instance name."""
    port: str
    type_name: str
    instance_name: str

    @property
    def provided_key(self) -> str:
        return f"{self.owner}.port.{self.port}.provided.{self.type_name}.{self.instance_name}"

    @property
    def required_key(self) -> str:
        return f"{self.owner}.port.{self.port}.required.{self.type_name}.{self.instance_name}"

    @property
    def old_key(self) -> str:
        return f"port.{self.type_name}.{self.instance_name}"


@dataclass(frozen=True, slots=True)
class Match:
    """What a consumer has found."""

    candidates: tuple[tuple[str, str], ...] = ()
    """Keys and references, the best first. Those of step 3 only where there is no other."""
    on_purpose: bool = False
    """Nothing, and so it is meant."""
    complaint: str = ""
    """What was wrong on the way, for a person."""


def offers(interface: Interface, reference: str) -> dict[str, str]:
    """What a provider adds to the connector's properties."""
    return {interface.provided_key: reference, interface.old_key: reference}


def is_strict(profile: ConnectorProfile) -> bool:
    """Whether every consumer must find a provider."""
    return profile.text(STRICTNESS).lower() == "strict"


def find(properties: Mapping[str, PropertyValue], wanted: Interface) -> Match:
    """The providers for a required interface."""
    complaints: list[str] = []
    mapping = _text(properties, wanted.required_key)
    if mapping.lower() in NOTHING_ON_PURPOSE:
        return Match(on_purpose=True)
    if mapping and mapping not in properties:
        complaints.append(f"{wanted.required_key} names {mapping}, which nobody offers")
    for key in filter(None, (mapping, wanted.old_key)):
        reference = _text(properties, key)
        if reference.lower() in NOTHING_ON_PURPOSE:
            return Match(on_purpose=True)
        if reference.startswith(REFERENCE):
            return Match(((key, reference),), complaint="; ".join(complaints))
        if reference:
            complaints.append(f"{key} holds {reference[:20]!r}, which is no reference (IOR:...)")
    return Match(tuple(_namesakes(properties, wanted)), complaint="; ".join(complaints))


def _namesakes(properties: Mapping[str, PropertyValue], wanted: Interface) -> list[tuple[str, str]]:
    """Providers of other types under the instance name of `wanted`."""
    end = f".{wanted.instance_name}"
    found = []
    for key in properties:
        reference = _text(properties, key)
        if ".provided." in key and key.endswith(end) and reference.startswith(REFERENCE):
            found.append((key, reference))
    return found


def _text(properties: Mapping[str, PropertyValue], key: str) -> str:
    value = properties.get(key, "")
    return value.strip() if isinstance(value, str) else ""
