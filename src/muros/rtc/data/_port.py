"""What InPorts and OutPorts share: their part in a negotiation, their connectors, their listeners."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Final, Generic, TypeVar

from muros.findings import Finding, Severity
from muros.rtc.codes import PeerLostError, PortType, ReturnCode
from muros.rtc.data._links import Link, LinkSetup
from muros.rtc.data._listeners import ConnectorEvent, ConnectorInfo, DataEvent, DataListeners
from muros.rtc.data._options import (
    ENDIAN_KEY,
    Dataflow,
    DataOptions,
    OptionError,
    Side,
    effective_properties,
    merged_back,
    parse_options,
)
from muros.rtc.data._serializers import CDR, codec_of, marshaling_types
from muros.rtc.data._transports import TRANSPORTS, Connection, TransportError, offered_in
from muros.rtc.data._types import AnyDataType, DataType, same_type
from muros.rtc.ports import Port, PortOwner
from muros.rtc.profiles import ConnectorProfile, PortProfile

__all__ = ["DIRECT", "DataPort"]

T = TypeVar("T")
L = TypeVar("L", bound=Link)

DIRECT: Final = "direct"
"""The interface type of connections inside one process: values are handed over, no octets made."""

FAN_LIMIT: Final = 100
"""Connections of a data port, where `fan_in` or `fan_out` does not say otherwise."""


class DataPort(Port, Generic[T]):
    """A port that values of one data type go through.

    `properties` go into its profile, `report` takes findings. Time-outs are measured by `clock` (seconds, monotonic),
    `timestamp_policy` sets `wall` (ns since the epoch).
    """

    side: ClassVar[Side]
    calls: ClassVar[Dataflow]
    """The dataflow in which this side is the one that calls the other."""
    _kind: ClassVar[PortType]

    def __init__(
        self,
        name: str,
        data_type: DataType[T],
        properties: Mapping[str, str] = {},
        *,
        owner: PortOwner | None = None,
        report: Callable[[Finding], object] | None = None,
        clock: Callable[[], float] = time.monotonic,
        wall: Callable[[], int] = time.time_ns,
    ) -> None:
        super().__init__(name, self._kind, properties, owner=owner, report=report)
        self.data_type: Final = data_type
        self.listeners: Final = DataListeners(self._data_listener_failed)
        """Told in the thread that writes, reads, sends or receives."""
        self._clock = clock
        self._wall = wall
        self._links_lock = threading.Lock()
        self._links_by_id: dict[str, tuple[Link, ...]] = {}

    # ---- what it is

    def profile(self) -> PortProfile:
        """How tools see it: with the transports and serializers that are there now."""
        self.properties.update(self._abilities())
        return super().profile()

    def add_listener(
        self, event: DataEvent | ConnectorEvent, callback: Callable[..., object]
    ) -> Callable[..., object]:
        """Tell `callback(info, value)` of a `DataEvent`, `callback(info)` of a `ConnectorEvent`. Returns it."""
        return self.listeners.add(event, callback)

    def remove_listener(self, event: DataEvent | ConnectorEvent, callback: Callable[..., object]) -> bool:
        """Tell it no longer. False where it was not told."""
        return self.listeners.remove(event, callback)

    @property
    def connector_infos(self) -> tuple[ConnectorInfo, ...]:
        """Its connections, in the order of `status`."""
        return tuple(link.info for link in self._all_links())

    def link(self, connector_id: str) -> Link | None:
        """The connector of this id, with its counts of values lost; the first where it joins several ports."""
        links = self._links_by_id.get(connector_id)
        return links[0] if links else None

    # ---- its part in a negotiation

    def complete_request(self, profile: ConnectorProfile) -> ConnectorProfile:
        if profile.text(ENDIAN_KEY):
            return profile
        return profile.with_properties({ENDIAN_KEY: "little,big"})

    def prepare(self, profile: ConnectorProfile) -> ConnectorProfile:
        added = merged_back(self.configuration, profile.properties, self.side, self.data_type.repository_id)
        return profile.with_properties(added)

    def connection_limit(self, profile: ConnectorProfile) -> int:
        key = "fan_in" if self.side is Side.IN else "fan_out"
        text = effective_properties(self.configuration, profile.properties, self.side).get(key, "").strip()
        limit = int(text) if text.isdecimal() else FAN_LIMIT
        return min(limit, super().connection_limit(profile))

    def publish_interfaces(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
        try:
            connection, options = self._understand(profile)
            if options.dataflow is not self.calls:
                duplex = options.dataflow is Dataflow.DUPLEX
                link = (self._channel_link if duplex else self._receiving_link)(connection, options)
                self._add(profile, (link,))
                if link.offer is not None:
                    place = profile.ports.index(self)
                    profile = profile.with_properties(offered_in(profile, place, link.offer.properties))
        except OptionError as error:
            return self._refuse_options(profile, error), profile
        except TransportError as error:
            return self._refuse_options(profile, OptionError(ReturnCode.BAD_PARAMETER, str(error))), profile
        return ReturnCode.RTC_OK, profile

    def subscribe_interfaces(self, profile: ConnectorProfile) -> ReturnCode:
        try:
            connection, options = self._understand(profile)
            if options.dataflow is self.calls:
                self._add(profile, self._calling_links(connection, options))
            elif options.dataflow is Dataflow.DUPLEX:
                self._reach_channel(connection, options)
            for remark in options.remarks:
                self._tell("bad-connection-option", f"connection {profile.name}: {remark}")
        except OptionError as error:
            return self._refuse_options(profile, error)
        except (TransportError, PeerLostError) as error:
            return self._refuse_options(profile, OptionError(ReturnCode.BAD_PARAMETER, str(error)))
        return ReturnCode.RTC_OK

    def unsubscribe_interfaces(self, profile: ConnectorProfile) -> None:
        with self._links_lock:
            links = self._links_by_id.get(profile.connector_id, ())
            self._links_by_id = {
                id_: others for id_, others in self._links_by_id.items() if id_ != profile.connector_id
            }
            self._links_changed()
        for link in links:
            link.close()

    def codec_for(self, options: Mapping[str, str], marshaling: str) -> AnyDataType | None:
        """The serializer for a connection with these effective properties. For ports that take `any` type."""
        return codec_of(self.data_type, marshaling, options)

    # ---- for the two kinds

    def _receiving_link(self, connection: Connection, options: DataOptions) -> Link:
        """The connector of the side that is called, with what it offers."""
        raise NotImplementedError

    def _calling_link(self, connection: Connection, options: DataOptions) -> Link:
        """The connector of the side that calls. TransportError where the way leads nowhere."""
        raise NotImplementedError

    def _calling_links(self, connection: Connection, options: DataOptions) -> tuple[Link, ...]:
        """One for each port that this one calls."""
        return (self._calling_link(connection, options),)

    def _channel_link(self, connection: Connection, options: DataOptions) -> Link:
        """The connector of a duplex connection, with what it offers."""
        raise NotImplementedError

    def _reach_channel(self, connection: Connection, options: DataOptions) -> None:
        """Lead the duplex connection's connector to the other side. TransportError where the way leads nowhere."""
        raise NotImplementedError

    def _all_links(self) -> tuple[Link, ...]:
        return tuple(link for links in self._links_by_id.values() for link in links)

    def _links_changed(self) -> None:
        """`_links_by_id` is another one. With the lock held."""

    def _setup(self, connection: Connection, options: DataOptions) -> LinkSetup:
        profile = connection.profile
        return LinkSetup(
            info=ConnectorInfo(profile.name, profile.connector_id, profile.ports, dict(connection.options)),
            options=options,
            codec=connection.codec,
            listeners=self.listeners,
            who=f"port {self.full_name}",
            report=self._forward,
            wall=self._wall,
            clock=self._clock,
        )

    def _links_here(self, profile: ConnectorProfile, kind: type[L]) -> tuple[L, ...]:
        """The connectors of the other side, as far as its ports are of this process."""
        peers = (peer for peer in profile.ports if isinstance(peer, DataPort) and peer is not self)
        links = (peer.link(profile.connector_id) for peer in peers)
        return tuple(link for link in links if isinstance(link, kind))

    def _drop(self, connector_id: str) -> None:
        """The other side of a connection has gone: let go of it."""
        self.disconnect(connector_id)

    # ---- inside

    def _abilities(self) -> dict[str, str]:
        ways = self._ways()
        abilities = {
            "dataport.data_type": self.data_type.repository_id,
            "dataport.interface_type": ",".join(sorted(set().union(*ways.values()))),
            "dataport.dataflow_type": ",".join(dataflow.value for dataflow, names in ways.items() if names),
            "dataport.subscription_type": "Any",
            "dataport.marshaling_types": ",".join(marshaling_types(self.data_type)),
            "data_type": self.data_type.repository_id,
        }
        if self.side is Side.OUT:
            abilities["dataport.subscription_type"] = "block,flush,new,nonblock,periodic"
            abilities["dataport.io_mode"] = abilities["dataport.subscription_type"]
        return abilities

    def _ways(self) -> dict[Dataflow, set[str]]:
        """The interface types that can be had, as far as the port's configuration permits them."""
        known: dict[Dataflow, set[str]] = {
            Dataflow.PUSH: {DIRECT, *TRANSPORTS.push},
            Dataflow.PULL: {DIRECT, *TRANSPORTS.pull},
            Dataflow.DUPLEX: set(TRANSPORTS.duplex),
        }
        for dataflow, names in known.items():
            key = "consumer_types" if dataflow is self.calls else "provider_types"
            permitted = {name.strip().lower() for name in self.configuration.get(key, "").split(",")} - {""}
            if permitted and "all" not in permitted:
                names &= permitted
        return known

    def _understand(self, profile: ConnectorProfile) -> tuple[Connection, DataOptions]:
        """What the profile asks of this side. OptionError for what it cannot be."""
        effective = effective_properties(self.configuration, profile.properties, self.side)
        options = parse_options(effective, self.side)
        self._check_data_types(profile)
        interface = options.interface_type
        there = self._ways()[options.dataflow]
        if interface not in there:
            raise OptionError(
                ReturnCode.BAD_PARAMETER,
                f"dataport.interface_type: {interface!r} with {options.dataflow.value} is not to be had; "
                f"ask for {', '.join(sorted(there)) or 'another dataflow'}",
            )
        ways = self._abilities()["dataport.dataflow_type"]
        if options.dataflow is Dataflow.DUPLEX and options.dataflow.value not in ways.split(","):
            raise OptionError(
                ReturnCode.BAD_PARAMETER, f"dataport.dataflow_type: duplex is not to be had here, only {ways}"
            )
        if options.dataflow is Dataflow.DUPLEX and len(profile.ports) != 2:
            raise OptionError(
                ReturnCode.BAD_PARAMETER,
                f"{interface}: a channel joins an OutPort and an InPort, not {len(profile.ports)} port(s)",
            )
        marshaling = options.marshaling
        if not marshaling:
            default = TRANSPORTS.marshaling.get(interface)
            marshaling = default(self.data_type) if default is not None else CDR
        codec = self.codec_for(effective, marshaling) if marshaling else None
        if codec is None:
            known = ", ".join(marshaling_types(self.data_type))
            raise OptionError(
                ReturnCode.RTC_ERROR,
                f"dataport.marshaling_type: {marshaling!r} is unknown for {self.data_type.repository_id} over "
                f"{interface}; ask for one of {known}",
            )
        connection = Connection(
            profile, effective, codec, marshaling, options.little, self.full_name, self._forward
        )
        return connection, options

    def _check_data_types(self, profile: ConnectorProfile) -> None:
        """All sides that have told their data type must have the same. OpenRTM-aist does not look."""
        own = self.data_type.repository_id
        for side in Side:
            other = profile.text(f"dataport.{side.value}.data_type")
            if not same_type(own, other):
                raise OptionError(
                    ReturnCode.BAD_PARAMETER,
                    f"the data types differ: {own} here, {other} at the {side.value}; "
                    f"connect ports of one data type",
                )

    def _refuse_options(self, profile: ConnectorProfile, error: OptionError) -> ReturnCode:
        self._tell(
            "connect-refused", f"connection {profile.name or profile.connector_id} refused", str(error)
        )
        return error.code

    def _add(self, profile: ConnectorProfile, links: tuple[Link, ...]) -> None:
        with self._links_lock:
            before = self._links_by_id.get(profile.connector_id, ())
            self._links_by_id = {**self._links_by_id, profile.connector_id: (*before, *links)}
            self._links_changed()
        for link in links:
            link.connected()

    def _forward(self, finding: Finding) -> None:
        self.report(finding)

    def _call_back(self, name: str, callback: Callable[..., Any], *arguments: Any) -> tuple[bool, Any]:
        """Call a user's callback: whether it returned, and what."""
        try:
            return True, callback(*arguments)
        except Exception as error:
            self._tell(
                "callback-failed",
                f"{name} raised",
                f"{type(error).__name__}: {error}",
                "mend the callback",
                Severity.ERROR,
            )
            return False, None

    def _data_listener_failed(self, event: DataEvent | ConnectorEvent, error: Exception) -> None:
        self._tell(
            "listener-failed", f"a listener of {event.value} raised", f"{type(error).__name__}: {error}"
        )
