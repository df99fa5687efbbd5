"""What carries octets from an OutPort to an InPort: the registry of transports, and what each has to offer.

A transport has two ends. The end that is *called* is offered when a connection is negotiated (push: by the InPort,
pull: by the OutPort): what it adds to the connector's properties leads the other end to it. The end that *calls* is
made from those properties afterwards.

    push    InPort  `offer_inlet(put)`    ...properties...>   OutPort `reach_inlet()`  .put(octets)
    pull    OutPort `offer_outlet(get)`   ...properties...>   InPort  `reach_outlet()` .get()
    duplex  both: each offers one end and reaches the other's
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol, TypeAlias

from muros.findings import Finding
from muros.rtc.codes import PortStatus, RtcError
from muros.rtc.data._types import AnyDataType
from muros.rtc.profiles import ConnectorProfile, PropertyValue

__all__ = [
    "TRANSPORTS",
    "ChannelInlet",
    "ChannelOutlet",
    "Connection",
    "DuplexTransport",
    "Get",
    "Inlet",
    "Offer",
    "Outlet",
    "PullTransport",
    "PushTransport",
    "Put",
    "TransportError",
    "each_offer",
    "offered_in",
    "register_transport",
]

Put: TypeAlias = "Callable[[bytes], PortStatus]"
"""What an InPort does with octets that come: stores them and answers. Never raises. Any thread may call it."""

Get: TypeAlias = "Callable[[], tuple[PortStatus, bytes]]"
"""What an OutPort gives when it is asked: octets with PORT_OK, or no octets and why. Never raises. Any thread."""


class TransportError(RtcError):
    """A connection cannot be made this way: its properties lead nowhere; the text says which and why."""


@dataclass(frozen=True, slots=True)
class Connection:
    """What a transport is told of the connection it is to carry."""

    profile: ConnectorProfile
    """As it stands at this step of the negotiation."""
    options: Mapping[str, str]
    """The effective properties of this side, without `dataport.` and `dataport.inport.` or `dataport.outport.`."""
    codec: AnyDataType
    """The serializer agreed on, for this side's data type."""
    marshaling: str
    """Its name."""
    little: bool
    """The endianness agreed on."""
    port_name: str
    """`<instance>.<port>`, for findings."""
    report: Callable[[Finding], object]
    """Takes findings."""


class Offer(Protocol):
    """The end that is called, standing."""

    @property
    def properties(self) -> Mapping[str, PropertyValue]:
        """What the connector's profile needs for the other end to reach this one."""

    def close(self) -> None:
        """Take it away. Closing twice is allowed."""


class Inlet(Protocol):
    """The way to an InPort, as its OutPort has it. Any thread may use it, several at once, too."""

    def put(self, octets: bytes) -> PortStatus:
        """Bring `octets` (not changed afterwards) there; what the InPort answers. PeerLostError if nobody does."""

    def close(self) -> None:
        """Forget the way. Closing twice is allowed."""


class Outlet(Protocol):
    """The way to an OutPort, as its InPort has it. Any thread may use it, several at once, too."""

    def get(self) -> tuple[PortStatus, bytes]:
        """Fetch a value's octets; BUFFER_EMPTY and none if there is no value. PeerLostError if nobody answers."""

    def close(self) -> None:
        """Forget the way. Closing twice is allowed."""


class PushTransport(Protocol):
    """Octets are brought by the OutPort."""

    def offer_inlet(self, connection: Connection, put: Put) -> Offer:
        """Of the InPort: an object that calls `put`."""

    def reach_inlet(self, connection: Connection) -> Inlet:
        """Of the OutPort: the way to the InPort that the profile's properties tell of. TransportError if none does."""


class PullTransport(Protocol):
    """Octets are fetched by the InPort."""

    def offer_outlet(self, connection: Connection, get: Get) -> Offer:
        """Of the OutPort: an object that calls `get`."""

    def reach_outlet(self, connection: Connection) -> Outlet:
        """Of the InPort: the way to the OutPort that the profile's properties tell of. TransportError if none does."""


class ChannelInlet(Inlet, Protocol):
    """The way to an InPort that takes a value only when somebody reads it; else `put` gives BUFFER_FULL."""

    def is_writable(self, retry: bool) -> bool:
        """Whether somebody reads. `retry`: not for the first time. PeerLostError if nobody answers."""


class ChannelOutlet(Outlet, Protocol):
    """The way to an OutPort that has a value only while somebody writes it."""

    def is_readable(self, retry: bool) -> bool:
        """Whether somebody writes. `retry`: not for the first time. PeerLostError if nobody answers."""


class DuplexTransport(Protocol):
    """Octets are brought or fetched, by whoever comes second."""

    def offer_inlet(self, connection: Connection, put: Put, writable: Callable[[], bool]) -> Offer:
        """Of the InPort: an object that calls `put` and `writable`."""

    def offer_outlet(self, connection: Connection, get: Get, readable: Callable[[], bool]) -> Offer:
        """Of the OutPort: an object that calls `get` and `readable`."""

    def reach_inlet(self, connection: Connection) -> ChannelInlet:
        """Of the OutPort: the way to the InPort. TransportError if the profile's properties lead nowhere."""

    def reach_outlet(self, connection: Connection) -> ChannelOutlet:
        """Of the InPort: the way to the OutPort. TransportError if the profile's properties lead nowhere."""


class _Registry:
    """Transports by `dataport.interface_type`."""

    def __init__(self) -> None:
        self.push: Final[dict[str, PushTransport]] = {}
        self.pull: Final[dict[str, PullTransport]] = {}
        self.duplex: Final[dict[str, DuplexTransport]] = {}
        self.marshaling: Final[dict[str, Callable[[AnyDataType], str]]] = {}
        """The serializer of a data type on a transport, where the connection names none and it is not `cdr`."""


TRANSPORTS: Final = _Registry()
"""What connections may ask for, besides what data ports have themselves (`direct`)."""


def register_transport(
    interface_type: str,
    *,
    push: PushTransport | None = None,
    pull: PullTransport | None = None,
    duplex: DuplexTransport | None = None,
    marshaling: Callable[[AnyDataType], str] | None = None,
) -> None:
    """Let connections ask for `dataport.interface_type` = `interface_type`, with the dataflow types given.

    `marshaling`: the serializer of a data type where a connection names none, "" if there is none; default `cdr`.
    """
    if marshaling is not None:
        TRANSPORTS.marshaling[interface_type] = marshaling
    if push is not None:
        TRANSPORTS.push[interface_type] = push
    if pull is not None:
        TRANSPORTS.pull[interface_type] = pull
    if duplex is not None:
        TRANSPORTS.duplex[interface_type] = duplex


def offered_in(
    profile: ConnectorProfile, place: int, properties: Mapping[str, PropertyValue]
) -> Mapping[str, PropertyValue]:
    """What an offer's properties are called where a connection joins more than two ports.

    The first port that offers has the usual names, which are all that OpenRTM-aist looks at; each also has them with
    its `place` among the ports behind them, so that none is lost.
    """
    if len(profile.ports) <= 2:
        return properties
    usual = {name: value for name, value in properties.items() if name not in profile.properties}
    return {**usual, **{f"{name}.{place}": value for name, value in properties.items()}}


def each_offer(profile: ConnectorProfile) -> tuple[ConnectorProfile, ...]:
    """The profile as it would be if each of the ports that offer something were the only one that does."""
    if len(profile.ports) <= 2:
        return (profile,)
    found: list[dict[str, PropertyValue]] = []
    for place in range(len(profile.ports)):
        ending = f".{place}"
        names = [name.removesuffix(ending) for name in profile.properties if name.endswith(ending)]
        own = {name: profile.properties[name + ending] for name in names if name in profile.properties}
        if own:
            found.append(own)
    if not any(all(profile.properties[name] == own[name] for name in own) for own in found):
        found.insert(0, {})  # who has the usual names knows no places
    return tuple(profile.with_properties(own) for own in found)
