"""What ports of all kinds have in common under their old names."""
# ruff: noqa: N802 (the names are those that components know)

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from muros.rtc.ports import ConnectEvent, ConnectEventKind, Port
from muros.rtc.profiles import ConnectorProfile
from OpenRTM_aist._codes import to_code, to_connector_profile
from OpenRTM_aist._listening import Listening
from OpenRTM_aist._properties import Properties

__all__ = [
    "PortBase",
    "PortConnectListener",
    "PortConnectListenerType",
    "PortConnectRetListener",
    "PortConnectRetListenerType",
    "connect_call",
    "connect_ret_call",
    "port_reference",
]


class PortConnectListenerType:
    """Moments of a connection at which there is no answer yet."""

    ON_NOTIFY_CONNECT, ON_NOTIFY_DISCONNECT, ON_UNSUBSCRIBE_INTERFACES, PORT_CONNECT_LISTENER_NUM = range(4)

    @staticmethod
    def event(number: int) -> ConnectEventKind:
        return tuple(ConnectEventKind)[number]


class PortConnectRetListenerType:
    """Moments of a connection with the answer of a step."""

    (
        ON_PUBLISH_INTERFACES,
        ON_CONNECT_NEXTPORT,
        ON_SUBSCRIBE_INTERFACES,
        ON_CONNECTED,
        ON_DISCONNECT_NEXT,
        ON_DISCONNECTED,
        PORT_CONNECT_RET_LISTENER_NUM,
    ) = range(7)

    @staticmethod
    def event(number: int) -> ConnectEventKind:
        return tuple(ConnectEventKind)[number + PortConnectListenerType.PORT_CONNECT_LISTENER_NUM]


class PortConnectListener:
    """Base of listeners: override `__call__(port name, profile)`."""

    def __call__(self, portname: str, profile: Any) -> None: ...


class PortConnectRetListener:
    """Base of listeners: override `__call__(port name, profile, return code)`."""

    def __call__(self, portname: str, profile: Any, ret: Any) -> None: ...


class PortBase:
    """A face of a muros port."""

    def __init__(self, port: Port) -> None:
        self.port = port
        self.wishes: dict[str, str] = {}
        """What holds where neither rtc.conf nor the connection says otherwise."""
        self._listening = Listening()

    def name(self) -> str:
        """The name given: `in`."""
        return self.port.name

    def getName(self) -> str:
        """The one that others know, with the component's: `Comp0.in`."""
        return self.port.full_name

    def getPortRef(self) -> Any:
        """The reference that others call; None before the component is known to them."""
        owner = getattr(self.port.owner, "outer", None)
        ports = owner.get_ports() if owner is not None else ()
        return next((one for one in ports if one.get_port_profile().name == self.port.full_name), None)

    def properties(self) -> Properties:
        return Properties.of({**self.port.properties, **self.port.configuration})

    def getConnectorProfiles(self) -> list[Any]:
        return [_profile(connector) for connector in self.port.connectors]

    def getConnectorIds(self) -> list[str]:
        return [connector.connector_id for connector in self.port.connectors]

    def getConnectorNames(self) -> list[str]:
        return [connector.name for connector in self.port.connectors]

    def getConnectorProfileById(self, connector_id: str) -> Any:
        return next((one for one in self.getConnectorProfiles() if one.connector_id == connector_id), None)

    def getConnectorProfileByName(self, name: str) -> Any:
        return next((one for one in self.getConnectorProfiles() if one.name == name), None)

    # What others may ask of the port, for those that ask it here

    def get_port_profile(self) -> Any:
        return self.getPortRef().get_port_profile()

    def get_connector_profiles(self) -> list[Any]:
        return list(self.getPortRef().get_connector_profiles())

    def get_connector_profile(self, connector_id: str) -> Any:
        return self.getPortRef().get_connector_profile(connector_id)

    def connect(self, connector_profile: Any) -> Any:
        """Make a connection; the return code and the profile."""
        return self.getPortRef().connect(connector_profile)

    def disconnect(self, connector_id: str) -> Any:
        return self.getPortRef().disconnect(connector_id)

    def disconnect_all(self) -> Any:
        return to_code(self.port.disconnect_all())

    def addPortConnectListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        """Tell `listener(port name, profile)` of a moment of `PortConnectListenerType`."""
        event = PortConnectListenerType.event(listener_type)
        return self._listening.begin(event, listener, connect_call(listener), self.port.connect_listeners)

    def removePortConnectListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        event = PortConnectListenerType.event(listener_type)
        self._listening.end(event, listener, self.port.connect_listeners)

    def addPortConnectRetListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        """Tell `listener(port name, profile, code)` of a moment of `PortConnectRetListenerType`."""
        event = PortConnectRetListenerType.event(listener_type)
        return self._listening.begin(event, listener, connect_ret_call(listener), self.port.connect_listeners)

    def removePortConnectRetListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        event = PortConnectRetListenerType.event(listener_type)
        self._listening.end(event, listener, self.port.connect_listeners)


def connect_call(listener: Callable[..., Any]) -> Callable[[ConnectEvent], None]:
    """What tells a `PortConnectListener`."""
    return lambda event: listener(event.port.name, _profile(event.profile))


def connect_ret_call(listener: Callable[..., Any]) -> Callable[[ConnectEvent], None]:
    """What tells a `PortConnectRetListener`."""

    def call(event: ConnectEvent) -> None:
        assert event.code is not None
        listener(event.port.name, _profile(event.profile), to_code(event.code))

    return call


def _profile(profile: ConnectorProfile) -> Any:
    return to_connector_profile(profile, [port_reference(port) for port in profile.ports])


def port_reference(port: Any) -> Any:
    """What leads to a port of a connection, of this process or another; None where it is not known."""
    return PortBase(port).getPortRef() if isinstance(port, Port) else getattr(port, "reference", None)
