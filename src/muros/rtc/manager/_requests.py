"""What managers are asked for in one text: components to create, ports to connect. Pure parsing.

| text | asks for |
| --- | --- |
| `Foo` | a component of that type |
| `RTC:vendor:category:Foo:Python:1.0` | the same, where the parts that are not empty agree |
| `Foo?instance_name=Left&conf.default.gain=2` | one with properties |
| `A.out?port=B.in&subscription_type=new` | a connection of two ports with properties of the connector |
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from muros.rtc.codes import RtcError
from muros.rtc.properties import Properties

__all__ = [
    "ComponentId",
    "ConnectRequest",
    "CreateRequest",
    "RequestError",
    "parse_connect_untrusted",
    "parse_create_untrusted",
]

REQUEST_LENGTH: Final = 65536
"""Characters that a request may have."""

PUBLISHER_KEYS: Final = frozenset(["push_policy", "push_rate", "skip_count"])
"""Keys of a connection that belong under `dataport.publisher`."""


class RequestError(RtcError):
    """A manager was asked for something in a text that it cannot read."""


@dataclass(frozen=True, slots=True)
class ComponentId:
    """Which kind of component: empty parts fit any."""

    implementation_id: str
    vendor: str = ""
    category: str = ""
    language: str = ""
    version: str = ""

    def fits(self, properties: Mapping[str, str]) -> bool:
        """Whether a component with these properties is of this kind."""
        name = self.implementation_id
        if name and name not in (properties.get("implementation_id"), properties.get("type_name")):
            return False
        rest = (
            ("vendor", self.vendor),
            ("category", self.category),
            ("language", self.language),
            ("version", self.version),
        )
        return all(not part or properties.get(key, "") == part for key, part in rest)

    def __str__(self) -> str:
        parts = (self.vendor, self.category, self.implementation_id, self.language, self.version)
        return f"RTC:{':'.join(parts)}" if any(parts[:2] + parts[3:]) else self.implementation_id


@dataclass(frozen=True, slots=True)
class CreateRequest:
    """A component to create."""

    id: ComponentId
    properties: Properties = field(default_factory=Properties)

    def __str__(self) -> str:
        options = "&".join(f"{key}={text}" for key, text in self.properties.items())
        return f"{self.id}?{options}" if options else str(self.id)


@dataclass(frozen=True, slots=True)
class ConnectRequest:
    """Ports to connect: `<component>.<port>` each, the component as a name or an address."""

    ports: tuple[str, ...]
    properties: Mapping[str, str]


def parse_create_untrusted(text: str) -> CreateRequest:
    """A request to create a component. Raises RequestError, nothing else."""
    _check(text)
    name, _, options = text.strip().partition("?")
    if not name:
        raise RequestError(f"{text!r} names no component; write Type?key=value&key=value")
    parts = name.split(":")
    if len(parts) == 1:
        component = ComponentId(name)
    elif parts[0] != "RTC" or len(parts) != 6 or not parts[3]:
        raise RequestError(
            f"{name!r} is no component id; it has the form RTC:vendor:category:implementation_id:language:version"
        )
    else:
        component = ComponentId(parts[3], parts[1], parts[2], parts[4], parts[5])
    properties = Properties()
    for key, value in _options(options, text):
        if not key:
            raise RequestError(f"{text!r}: no key before '={value}'")
        properties[key] = value
    return CreateRequest(component, properties)


def parse_connect_untrusted(text: str) -> ConnectRequest:
    """A request to connect ports. Raises RequestError, nothing else.

    Keys are those of a connector without `dataport.`; those of the publisher may be written short.
    """
    _check(text)
    first, _, options = text.strip().partition("?")
    ports, properties = (
        [first.strip()],
        {"dataport.dataflow_type": "push", "dataport.interface_type": "corba_cdr"},
    )
    for key, value in _options(options, text):
        if key.startswith("port") and (key == "port" or key[4:].isdecimal()):
            ports.append(value)
        elif key.startswith(("dataport.", "port.", "corbaport.")):
            properties[key] = value
        elif key:
            properties[f"dataport.publisher.{key}" if key in PUBLISHER_KEYS else f"dataport.{key}"] = value
        else:
            raise RequestError(f"{text!r}: no key before '={value}'")
    for port in ports:
        component, dot, name = port.rpartition(".")
        if not (component and dot and name):
            raise RequestError(
                f"{text!r}: {port!r} is no port; write Comp0.out?port=Comp1.in&subscription_type=new"
            )
    return ConnectRequest(tuple(ports), properties)


def _options(text: str, whole: str) -> list[tuple[str, str]]:
    pairs = []
    for option in text.split("&") if text.strip() else []:
        key, equals, value = option.partition("=")
        if not equals:
            raise RequestError(f"{whole!r}: {option!r} is no key=value")
        pairs.append((key.strip(), value.strip()))
    return pairs


def _check(text: str) -> None:
    if len(text) > REQUEST_LENGTH:
        raise RequestError(f"a request of {len(text)} characters; at most {REQUEST_LENGTH} are read")
    if not text.isprintable():  # names come into logs and onto terminals
        raise RequestError(f"{text!r}: control characters have no place in a request")
