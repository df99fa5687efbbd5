"""Ports: how two or more of them agree on a connection, and how it ends again.

A connection is negotiated along the chain of the ports it names. Whoever wants it calls `Port.connect` on any of
them; that one calls `notify_connect` on the first of the chain, and each port

1. completes the profile with what it is configured to (`prepare`),
2. refuses if it has no room, or is already connected to one of the others (`connection_limit`, `allows_again`),
3. adds what it offers (`publish_interfaces`),
4. calls the next port and takes over the profile that it hands back, with all that the others offer,
5. looks for what it needs (`subscribe_interfaces`), and
6. remembers the connection.

Whatever fails on the way is undone on both sides of the place where it failed: a port that refuses leaves nothing
behind, and one that cannot go on tells those it had called. Ending goes the same way: each port tells the next and
then lets go. RTC 1.1, 5.4.2.8; what is not said there follows OpenRTM-aist.

Calls come from several threads at once. The lock guards the table of connections and is never held while another
port, a listener or a subclass is called; what is being negotiated holds a place in the table meanwhile, so that
limits hold and an end that overtakes its beginning is not lost.
"""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final, Protocol

from muros.findings import Finding, Severity
from muros.rtc.codes import PeerLostError, PortType, ReturnCode, RtcError
from muros.rtc.listeners import Listeners
from muros.rtc.profiles import ConnectorProfile, InterfaceProfile, PeerPort, PortProfile

__all__ = ["ConnectEvent", "ConnectEventKind", "Port", "PortOwner", "connect_ports"]

CONNECTION_LIMIT: Final = 1000
"""Connections of one port at most, where neither its configuration nor its kind says otherwise."""

PORTS_LIMIT: Final = 100
"""Ports that one connection may join."""

_NO = ReturnCode.PRECONDITION_NOT_MET
_OK = ReturnCode.RTC_OK


class PortOwner(Protocol):
    """What a port asks of the component it belongs to."""

    @property
    def instance_name(self) -> str: ...


class ConnectEventKind(Enum):
    """Moments in the life of a connection, as OpenRTM-aist names them; `ConnectEvent.code` is there from
    ON_PUBLISH_INTERFACES on."""

    ON_NOTIFY_CONNECT = "ON_NOTIFY_CONNECT"
    ON_NOTIFY_DISCONNECT = "ON_NOTIFY_DISCONNECT"
    ON_UNSUBSCRIBE_INTERFACES = "ON_UNSUBSCRIBE_INTERFACES"
    ON_PUBLISH_INTERFACES = "ON_PUBLISH_INTERFACES"
    ON_CONNECT_NEXTPORT = "ON_CONNECT_NEXTPORT"
    ON_SUBSCRIBE_INTERFACES = "ON_SUBSCRIBE_INTERFACES"
    ON_CONNECTED = "ON_CONNECTED"
    ON_DISCONNECT_NEXT = "ON_DISCONNECT_NEXT"
    ON_DISCONNECTED = "ON_DISCONNECTED"


@dataclass(frozen=True, slots=True)
class ConnectEvent:
    """What the listeners of a port are told."""

    kind: ConnectEventKind
    port: Port
    profile: ConnectorProfile
    """The connection as it stood at that moment."""
    code: ReturnCode | None = None
    """What the step answered; None where the step has yet to begin."""


class Port:
    """What all ports share: a name, a profile, connections. A `PeerPort` of this process.

    `properties` go into the profile. `owner` may be set later, before the port is used. Nothing here raises for
    what a peer does: operations answer a `ReturnCode`, the reason of a refusal is a finding given to `report`.

    Subclasses override `prepare`, `publish_interfaces`, `subscribe_interfaces`, `unsubscribe_interfaces`,
    `complete_request`, `connection_limit`, `allows_again`; these are called without the lock, from any thread.
    """

    def __init__(
        self,
        name: str,
        port_type: PortType,
        properties: Mapping[str, str] = {},
        *,
        owner: PortOwner | None = None,
        report: Callable[[Finding], object] | None = None,
    ) -> None:
        self.name: Final = name
        self.port_type: Final = port_type
        self.owner: PortOwner | None = owner
        self.properties: dict[str, str] = dict(properties)
        self.configuration: Mapping[str, str] = {}
        """The keys of rtc.conf that are meant for this port, without their prefix."""
        self.report: Callable[[Finding], object] = report or (lambda finding: None)
        self.connect_listeners: Final = Listeners[ConnectEventKind](self._listener_failed)
        """Called with a `ConnectEvent`, in the thread of whoever connects."""
        self._lock = threading.Lock()
        self._connections: dict[str, ConnectorProfile] = {}
        self._negotiated: dict[str, _Negotiation] = {}

    # ---- what it is

    @property
    def full_name(self) -> str:
        """`<instance>.<port>`: the name other processes know."""
        return f"{self.owner.instance_name}.{self.name}" if self.owner is not None else self.name

    @property
    def interfaces(self) -> tuple[InterfaceProfile, ...]:
        """The interfaces of a service port; none otherwise."""
        return ()

    @property
    def connectors(self) -> tuple[ConnectorProfile, ...]:
        """Its connections, oldest first, without asking whether the peers still exist (`living_connectors`)."""
        with self._lock:
            return tuple(self._connections.values())

    def connector(self, connector_id: str) -> ConnectorProfile | None:
        """The connection of this id, or None."""
        with self._lock:
            return self._connections.get(connector_id)

    def living_connectors(self) -> tuple[ConnectorProfile, ...]:
        """Its connections, after those with a peer that no longer exists have been ended.

        Asks the processes of all peers; takes as long as they do. This is what tools are answered with.
        """
        asked: dict[PeerPort, bool] = {self: True}
        for connector in self.connectors:
            for peer in connector.ports:
                if peer not in asked:
                    asked[peer] = _is_there(peer)
            living = tuple(peer for peer in connector.ports if asked[peer])
            if living != connector.ports:
                self._tell(
                    "peer-lost",
                    f"a peer of connection {connector.name or connector.connector_id} has ended",
                    "its process does not answer; the connection is dropped",
                    severity=Severity.INFO,
                )
                _end_at(living, connector.connector_id)
                self.notify_disconnect(connector.connector_id)
        return self.connectors

    def profile(self) -> PortProfile:
        """How tools see it; connections as of `living_connectors`."""
        return PortProfile(
            name=self.full_name,
            port=self,
            owner=self.owner,
            interfaces=self.interfaces,
            connectors=self.living_connectors(),
            properties={"port.port_type": self.port_type.value, **self.properties, **self.configuration},
        )

    def is_there(self) -> bool:
        """Always: a port of this process."""
        return True

    def activate(self) -> None:
        """The component has become active."""

    def deactivate(self) -> None:
        """The component is active no longer."""

    # ---- connecting

    def connect(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
        """Connect the ports of `profile`. RTC 1.1, 5.4.2.8.1.

        Returns the code and the profile as it was agreed on, with its id. BAD_PARAMETER: no ports, one of them
        twice, or one that does not answer; PRECONDITION_NOT_MET: the id is taken, or a port has no room; otherwise
        what the port answers that refuses. After anything but RTC_OK no port is connected.
        """
        if not profile.connector_id:
            profile = replace(profile, connector_id=str(uuid.uuid1()))
        elif self._knows(profile.connector_id):
            return self._refuse(profile, _NO, "its id is in use here", "leave the id empty")
        if (code := self._check_ports(profile)) is not _OK:
            return code, profile
        profile = self.complete_request(profile)
        first = profile.ports[0]
        try:
            code, agreed = first.notify_connect(profile)
        except Exception as error:
            self._tell("connect-failed", f"connection {profile.name}: the first port failed", _text(error))
            return ReturnCode.BAD_PARAMETER, profile
        if code is not _OK and first is not self:
            if code is not _NO:
                _end_at((first,), profile.connector_id)
            if self._knows(profile.connector_id):
                self.disconnect(profile.connector_id)
        return code, agreed

    def notify_connect(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
        """Take part in a connection, and let the ports after this one do so. RTC 1.1, 5.4.2.8.4.

        Called by `connect` and by the port before this one.
        """
        if not profile.connector_id:
            return self._refuse(profile, ReturnCode.BAD_PARAMETER, "it has no id", "call connect instead")
        if (code := self._check_ports(profile)) is not _OK:
            return code, profile
        if self not in profile.ports:
            return self._refuse(
                profile,
                ReturnCode.BAD_PARAMETER,
                "the port is not among those to connect",
                "name it in ports",
            )
        self._announce(ConnectEventKind.ON_NOTIFY_CONNECT, profile)
        try:
            profile = self.prepare(profile)
        except Exception as error:
            return self._failed(profile, "prepare", error), profile
        negotiation = self._reserve(profile)
        if isinstance(negotiation, str):
            return self._refuse(profile, _NO, negotiation)
        try:
            code, profile = self._negotiate(profile, negotiation)
        finally:
            with self._lock:
                self._negotiated.pop(profile.connector_id, None)
        self._announce(ConnectEventKind.ON_CONNECTED, profile, code)
        return code, profile

    def disconnect(self, connector_id: str) -> ReturnCode:
        """End a connection at all its ports. RTC 1.1, 5.4.2.8.5. BAD_PARAMETER: there is none of this id."""
        profile = self.connector(connector_id)
        if profile is None:
            return ReturnCode.BAD_PARAMETER
        code = _end_at(profile.ports, connector_id)
        if self._knows(connector_id):
            # The first port that answered did not know it, or does not reach this one: let go alone.
            code = self.notify_disconnect(connector_id)
        return code

    def notify_disconnect(self, connector_id: str) -> ReturnCode:
        """Let go of a connection, after the ports behind this one have. RTC 1.1, 5.4.2.8.6.

        BAD_PARAMETER: there is none of this id. Peers that do not answer are passed over.
        """
        with self._lock:
            profile = self._connections.pop(connector_id, None)
            if profile is None:
                if (negotiation := self._negotiated.get(connector_id)) is None:
                    return ReturnCode.BAD_PARAMETER
                negotiation.ended = True
                return _OK
        self._announce(ConnectEventKind.ON_NOTIFY_DISCONNECT, profile)
        code = _end_at(self._after(profile), connector_id)
        self._announce(ConnectEventKind.ON_DISCONNECT_NEXT, profile, code)
        self._unsubscribe(profile)
        self._announce(ConnectEventKind.ON_DISCONNECTED, profile, code)
        return code

    def disconnect_all(self) -> ReturnCode:
        """End all connections; the first code that is not RTC_OK."""
        codes = [self.disconnect(connector.connector_id) for connector in self.connectors]
        # One that another port has ended meanwhile is not there any more: as wanted.
        return next((code for code in codes if code not in (_OK, ReturnCode.BAD_PARAMETER)), _OK)

    # ---- for subclasses

    def complete_request(self, profile: ConnectorProfile) -> ConnectorProfile:
        """`connect` was called here: add what a request is to have where it lacks it."""
        return profile

    def prepare(self, profile: ConnectorProfile) -> ConnectorProfile:
        """Add what this port is configured to."""
        return profile

    def connection_limit(self, profile: ConnectorProfile) -> int:
        """Connections the port may have, with this one. Key `connection_limit` of its configuration."""
        text = self.configuration.get("connection_limit", "").strip()
        try:
            limit = int(text) if text else -1
        except ValueError:
            self._tell(
                "bad-key", f"connection_limit is '{text}'", "it is not a whole number, taken as no limit"
            )
            limit = -1
        return limit if limit >= 0 else CONNECTION_LIMIT

    def allows_again(self, profile: ConnectorProfile) -> bool:
        """Whether two ports may be connected more than once: `allow_dup_connection` of either."""
        return "YES" in (
            self.configuration.get("allow_dup_connection", "").strip().upper(),
            profile.text("dataport.allow_dup_connection").upper(),
        )

    def publish_interfaces(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
        """Add what this port offers to the others. Anything but RTC_OK ends the negotiation."""
        return _OK, profile

    def subscribe_interfaces(self, profile: ConnectorProfile) -> ReturnCode:
        """Take what this port needs of what all have offered. Anything but RTC_OK ends the negotiation."""
        return _OK

    def unsubscribe_interfaces(self, profile: ConnectorProfile) -> None:
        """Let go of all that belongs to the connection; called, too, when a negotiation fails half way."""

    # ---- inside

    def _negotiate(
        self, profile: ConnectorProfile, negotiation: _Negotiation
    ) -> tuple[ReturnCode, ConnectorProfile]:
        """Steps 3 to 6 of the head of this file."""
        behind = self._after(profile)
        called: tuple[PeerPort, ...] = ()
        try:
            code, profile = self.publish_interfaces(profile)
        except Exception as error:
            code = self._failed(profile, "publish_interfaces", error)
        self._announce(ConnectEventKind.ON_PUBLISH_INTERFACES, profile, code)
        if code is _OK and behind:
            code, profile = self._connect_next(behind, profile)
            # A port at the end of the chain that finds a precondition not met has not begun; to end the
            # connection there would end another one that has the same id.
            called = () if code is _NO and len(behind) == 1 else behind
            self._announce(ConnectEventKind.ON_CONNECT_NEXTPORT, profile, code)
        if code is _OK:
            try:
                code = self.subscribe_interfaces(profile)
            except Exception as error:
                code = self._failed(profile, "subscribe_interfaces", error)
            self._announce(ConnectEventKind.ON_SUBSCRIBE_INTERFACES, profile, code)
        if code is _OK:
            with self._lock:
                if not negotiation.ended:
                    self._connections[profile.connector_id] = profile
                    return _OK, profile
            self._tell("connect-failed", f"connection {profile.name}: ended before it stood")
            code = ReturnCode.RTC_ERROR
        _end_at(called, profile.connector_id)
        self._unsubscribe(profile)
        return code, profile

    def _connect_next(
        self, behind: tuple[PeerPort, ...], profile: ConnectorProfile
    ) -> tuple[ReturnCode, ConnectorProfile]:
        try:
            code, agreed = behind[0].notify_connect(profile)
        except PeerLostError as error:
            self._tell("peer-lost", f"connection {profile.name}: the next port does not answer", _text(error))
            return ReturnCode.BAD_PARAMETER, profile
        except Exception as error:
            return self._failed(profile, "notify_connect of the next port", error), profile
        # Who took part and under which id is not for a peer to change.
        return code, replace(agreed, connector_id=profile.connector_id, ports=profile.ports)

    def _reserve(self, profile: ConnectorProfile) -> _Negotiation | str:
        """Hold a place in the table; the reason if there is none."""
        limit = self.connection_limit(profile)
        again = self.allows_again(profile)
        others = set(profile.ports) - {self}
        with self._lock:
            standing = [*self._connections.values(), *(n.profile for n in self._negotiated.values())]
            if any(known.connector_id == profile.connector_id for known in standing):
                return "its id is in use here"
            if len(standing) >= limit:
                return f"the port has {len(standing)} connections of {limit} allowed"
            if not again and any(not others.isdisjoint(known.ports) for known in standing):
                return "the two ports are already connected (allow_dup_connection: YES permits it)"
            negotiation = self._negotiated[profile.connector_id] = _Negotiation(profile)
            return negotiation

    def _check_ports(self, profile: ConnectorProfile) -> ReturnCode:
        """Whether the chain can be walked. The same port twice would have it called while it waits for itself."""
        count = len(profile.ports)
        if not count:
            reason = "it names no ports"
        elif count > PORTS_LIMIT:
            reason = f"it joins {count} ports; {PORTS_LIMIT} are allowed"
        elif len(set(profile.ports)) != count:
            reason = "it names the same port twice"
        else:
            return _OK
        return self._refuse(profile, ReturnCode.BAD_PARAMETER, reason, "name each port once")[0]

    def _after(self, profile: ConnectorProfile) -> tuple[PeerPort, ...]:
        """The ports behind this one in the chain."""
        try:
            return profile.ports[profile.ports.index(self) + 1 :]
        except ValueError:
            return ()

    def _knows(self, connector_id: str) -> bool:
        with self._lock:
            return connector_id in self._connections or connector_id in self._negotiated

    def _unsubscribe(self, profile: ConnectorProfile) -> None:
        self._announce(ConnectEventKind.ON_UNSUBSCRIBE_INTERFACES, profile)
        try:
            self.unsubscribe_interfaces(profile)
        except Exception as error:
            self._failed(profile, "unsubscribe_interfaces", error)

    def _announce(
        self, kind: ConnectEventKind, profile: ConnectorProfile, code: ReturnCode | None = None
    ) -> None:
        if self.connect_listeners.of(kind):
            self.connect_listeners.tell(kind, ConnectEvent(kind, self, profile, code))

    def _listener_failed(self, kind: ConnectEventKind, error: Exception) -> None:
        self._tell("listener-failed", f"a listener of {kind.value} failed", _text(error))

    def _refuse(
        self, profile: ConnectorProfile, code: ReturnCode, why: str, remedy: str = ""
    ) -> tuple[ReturnCode, ConnectorProfile]:
        self._tell(
            "connect-refused", f"connection {profile.name or profile.connector_id} refused", why, remedy
        )
        return code, profile

    def _failed(self, profile: ConnectorProfile, where: str, error: Exception) -> ReturnCode:
        self._tell("connect-failed", f"connection {profile.name}: {where} failed", _text(error))
        return ReturnCode.RTC_ERROR

    def _tell(
        self, code: str, what: str, why: str = "", remedy: str = "", severity: Severity = Severity.WARNING
    ) -> None:
        self.report(Finding(code, f"port {self.full_name}", what, why, remedy, severity, self.name))


def connect_ports(ports: tuple[Port, ...], properties: Mapping[str, str], name: str = "") -> ConnectorProfile:
    """Connect ports of this process, the first one leading; the profile that they agreed on.

    Without `name` the connection is called after the ports. RtcError where a port refuses; it reports why.
    """
    if not ports:
        raise RtcError("connect needs the ports to connect")
    names = "_".join(port.name for port in ports)
    code, profile = ports[0].connect(ConnectorProfile(name or names, "", ports, properties))
    if code is not _OK:
        full = " and ".join(port.full_name for port in ports)
        raise RtcError(f"{full} are not connected: {code.name}; the findings of the ports tell why")
    return profile


@dataclass(slots=True, eq=False)
class _Negotiation:
    """A connection between its beginning and its standing."""

    profile: ConnectorProfile
    ended: bool = False
    """A peer has ended it already."""


def _end_at(ports: tuple[PeerPort, ...], connector_id: str) -> ReturnCode:
    """Tell the first of `ports` that answers and knows the connection; it tells those behind it."""
    for port in ports:
        try:
            code = port.notify_disconnect(connector_id)
        except Exception:  # lost, or of a make that raises: the next one is asked
            continue
        if code is not ReturnCode.BAD_PARAMETER:
            return code
    return _OK


def _is_there(peer: PeerPort) -> bool:
    try:
        return peer.is_there()
    except Exception:
        return False


def _text(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
