"""What carries octets between data ports over CORBA: interface types `corba_cdr` and `data_service`.

Both are an object with one operation: `put` or `push` of the InPort's side, `get` or `pull` of the OutPort's. The side
that offers it adds its reference to the connector's properties, as a text (`..._ior`) and, for `corba_cdr`, as an
object (`..._ref`), too.

A call that takes too long is BUFFER_TIMEOUT, for the peer may only be slow; the second in a row is a lost peer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from omniORB import CORBA

from muros.findings import Finding
from muros.rtc.codes import PeerLostError, PortStatus, RtcError
from muros.rtc.corba._lost import LOST, describe, is_late
from muros.rtc.corba._orb import Orb
from muros.rtc.corba._stubs import RTC, RTC__POA, OpenRTM, OpenRTM__POA
from muros.rtc.data import Connection, Get, Inlet, Offer, Outlet, Put, TransportError
from muros.rtc.profiles import ConnectorProfile, PropertyValue

__all__ = [
    "CorbaInlet",
    "CorbaOffer",
    "CorbaOutlet",
    "CorbaTransport",
    "corba_cdr",
    "data_service",
    "reference_in",
]

_CDR: Final = tuple(OpenRTM.PortStatus._items)
_SERVICE: Final = tuple(RTC.PortStatus._items)
_STATUS: Final = tuple(PortStatus)


class _InPortCdr(OpenRTM__POA.InPortCdr):  # type: ignore[misc]
    def __init__(self, put: Put) -> None:
        self._put = put

    def put(self, data: bytes) -> Any:
        return _CDR[self._put(data)]


class _OutPortCdr(OpenRTM__POA.OutPortCdr):  # type: ignore[misc]
    def __init__(self, get: Get) -> None:
        self._get = get

    def get(self) -> tuple[Any, bytes]:
        status, octets = self._get()
        return _CDR[status], octets


class _DataPushService(RTC__POA.DataPushService):  # type: ignore[misc]
    def __init__(self, put: Put) -> None:
        self._put = put

    def push(self, data: bytes) -> Any:
        return _SERVICE[self._put(data)]


class _DataPullService(RTC__POA.DataPullService):  # type: ignore[misc]
    def __init__(self, get: Get) -> None:
        self._get = get

    def pull(self) -> tuple[Any, bytes]:
        status, octets = self._get()
        return _SERVICE[status], octets


class CorbaTransport:
    """Push and pull by one operation of an object. `key` is the part of the property names that tells the type."""

    def __init__(
        self,
        orb: Orb,
        key: str,
        *,
        inlet: tuple[Callable[[Put], Any], Any, str],
        outlet: tuple[Callable[[Get], Any], Any, str],
        with_object: bool,
    ) -> None:
        self._orb = orb
        self._key = key
        self._inlet = inlet
        self._outlet = outlet
        self._with_object = with_object

    def offer_inlet(self, connection: Connection, put: Put) -> Offer:
        """Of the InPort: an object that calls `put`."""
        servant, interface, _ = self._inlet
        return CorbaOffer(self._orb, servant(put), interface, self._name("inport"), self._with_object)

    def offer_outlet(self, connection: Connection, get: Get) -> Offer:
        """Of the OutPort: an object that calls `get`."""
        servant, interface, _ = self._outlet
        return CorbaOffer(self._orb, servant(get), interface, self._name("outport"), self._with_object)

    def reach_inlet(self, connection: Connection) -> Inlet:
        """Of the OutPort: the InPort's object."""
        _, interface, operation = self._inlet
        target = reference_in(connection.profile, self._name("inport"), interface, self._orb)
        return CorbaInlet(getattr(target, operation), connection)

    def reach_outlet(self, connection: Connection) -> Outlet:
        """Of the InPort: the OutPort's object."""
        _, interface, operation = self._outlet
        target = reference_in(connection.profile, self._name("outport"), interface, self._orb)
        return CorbaOutlet(getattr(target, operation), connection)

    def _name(self, side: str) -> str:
        return f"dataport.{self._key}.{side}"


class CorbaOffer:
    """An object that stands until it is closed; `name` is what its properties' names begin with."""

    def __init__(self, orb: Orb, servant: Any, interface: Any, name: str, with_object: bool) -> None:
        self._orb = orb
        self._servant = servant
        reference = orb.activate(servant)
        properties: dict[str, PropertyValue] = {f"{name}_ior": orb.to_text(reference)}
        if with_object:
            properties[f"{name}_ref"] = reference._narrow(interface)
        self._properties = properties

    @property
    def properties(self) -> Mapping[str, PropertyValue]:
        """Its reference, as text and as object."""
        return self._properties

    def close(self) -> None:
        """Take the object away."""
        servant, self._servant = self._servant, None
        if servant is not None:
            self._orb.deactivate(servant)


class _Caller:
    """The operation of the peer's object, and what its failures mean."""

    def __init__(self, operation: Callable[..., Any], connection: Connection) -> None:
        self._operation = operation
        self._connection = connection
        self._late = 0

    def close(self) -> None:
        """Nothing is held but the reference."""

    def agrees(self, operation: Callable[[bool], Any], retry: bool) -> bool:
        """What an operation of the peer's object says; False for one that could not be called."""
        try:
            answer = bool(operation(retry))
        except CORBA.Exception as error:
            self._failed(error)
            return False
        self._late = 0
        return answer

    def _failed(self, error: CORBA.Exception) -> PortStatus:
        text = describe(error)
        if isinstance(error, LOST):
            self._late += 1
            if is_late(error) and self._late < 2:
                return PortStatus.BUFFER_TIMEOUT
            raise PeerLostError(f"{self._connection.port_name}: the peer does not answer: {text}") from error
        self._connection.report(
            Finding(
                "data-call-failed",
                f"port {self._connection.port_name}",
                "{n} value{s} not carried",
                f"the call to the peer failed: {text}",
                subject=self._connection.profile.name,
            )
        )
        return PortStatus.UNKNOWN_ERROR


class CorbaInlet(_Caller):
    """An InPort's object."""

    def put(self, octets: bytes) -> PortStatus:
        """Call the InPort's object."""
        try:
            answer: int = self._operation(octets)._v
        except CORBA.Exception as error:
            return self._failed(error)
        self._late = 0
        return _STATUS[answer]


class CorbaOutlet(_Caller):
    """An OutPort's object."""

    def get(self) -> tuple[PortStatus, bytes]:
        """Call the OutPort's object."""
        try:
            status, octets = self._operation()
        except CORBA.Exception as error:
            return self._failed(error), b""
        self._late = 0
        return _STATUS[status._v], octets


def reference_in(profile: ConnectorProfile, name: str, interface: Any, orb: Orb) -> Any:
    """The object that `NAME_ior`, or else `NAME_ref`, of a connector's properties leads to. TransportError if none."""
    text, reference = profile.text(f"{name}_ior"), profile.properties.get(f"{name}_ref")
    try:
        if text:
            reference = orb.to_reference(text)
        narrowed = reference._narrow(interface) if isinstance(reference, CORBA.Object) else None
    except RtcError as error:
        raise TransportError(f"{name}_ior: {error}") from error
    except CORBA.Exception as error:
        raise TransportError(f"{name}: its object does not answer: {describe(error)}") from error
    if narrowed is None:
        what = "leads to an object of another interface" if reference is not None else "is not there"
        raise TransportError(f"{name}_ior {what}: the other port must offer {interface.__name__}")
    return narrowed


def corba_cdr(orb: Orb) -> CorbaTransport:
    """OpenRTM::InPortCdr and OutPortCdr."""
    return CorbaTransport(
        orb,
        "corba_cdr",
        inlet=(_InPortCdr, OpenRTM.InPortCdr, "put"),
        outlet=(_OutPortCdr, OpenRTM.OutPortCdr, "get"),
        with_object=True,
    )


def data_service(orb: Orb) -> CorbaTransport:
    """RTC::DataPushService and DataPullService."""
    return CorbaTransport(
        orb,
        "data_service",
        inlet=(_DataPushService, RTC.DataPushService, "push"),
        outlet=(_DataPullService, RTC.DataPullService, "pull"),
        with_object=False,
    )
