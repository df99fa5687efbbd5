"""Interface type `csp_channel`: both sides offer an object and call the other's, see `muros.rtc.data._channel`.

The properties have the names of `corba_cdr`, as those of OpenRTM-aist 2.1 do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from muros.rtc.corba._orb import Orb
from muros.rtc.corba._stubs import CSP, CSP__POA, RTC
from muros.rtc.corba._transports import CorbaInlet, CorbaOffer, CorbaOutlet, reference_in
from muros.rtc.data import ChannelInlet, ChannelOutlet, Connection, Get, Offer, Put

__all__ = ["CspChannel"]

_INPORT: Final = "dataport.corba_cdr.inport"
_OUTPORT: Final = "dataport.corba_cdr.outport"
_STATUS: Final = tuple(RTC.PortStatus._items)


class _InPortCsp(CSP__POA.InPortCsp):  # type: ignore[name-defined,misc]
    def __init__(self, put: Put, writable: Callable[[], bool]) -> None:
        self._put = put
        self._writable = writable

    def put(self, data: bytes) -> Any:
        return _STATUS[self._put(data)]

    def is_writable(self, retry: bool) -> bool:
        return self._writable()


class _OutPortCsp(CSP__POA.OutPortCsp):  # type: ignore[name-defined,misc]
    def __init__(self, get: Get, readable: Callable[[], bool]) -> None:
        self._get = get
        self._readable = readable

    def get(self) -> tuple[Any, bytes]:
        status, octets = self._get()
        return _STATUS[status], octets

    def is_readable(self, retry: bool) -> bool:
        return self._readable()


class CspChannel:
    """CSP::InPortCsp and OutPortCsp."""

    def __init__(self, orb: Orb) -> None:
        self._orb = orb

    def offer_inlet(self, connection: Connection, put: Put, writable: Callable[[], bool]) -> Offer:
        """Of the InPort: an object that calls `put` and `writable`."""
        return CorbaOffer(self._orb, _InPortCsp(put, writable), CSP.InPortCsp, _INPORT, True)

    def offer_outlet(self, connection: Connection, get: Get, readable: Callable[[], bool]) -> Offer:
        """Of the OutPort: an object that calls `get` and `readable`."""
        return CorbaOffer(self._orb, _OutPortCsp(get, readable), CSP.OutPortCsp, _OUTPORT, True)

    def reach_inlet(self, connection: Connection) -> ChannelInlet:
        """Of the OutPort: the InPort's object."""
        return _Inlet(reference_in(connection.profile, _INPORT, CSP.InPortCsp, self._orb), connection)

    def reach_outlet(self, connection: Connection) -> ChannelOutlet:
        """Of the InPort: the OutPort's object."""
        return _Outlet(reference_in(connection.profile, _OUTPORT, CSP.OutPortCsp, self._orb), connection)


class _Inlet(CorbaInlet):
    def __init__(self, target: Any, connection: Connection) -> None:
        super().__init__(target.put, connection)
        self._is_writable = target.is_writable

    def is_writable(self, retry: bool) -> bool:
        """Ask the InPort's object."""
        return self.agrees(self._is_writable, retry)


class _Outlet(CorbaOutlet):
    def __init__(self, target: Any, connection: Connection) -> None:
        super().__init__(target.get, connection)
        self._is_readable = target.is_readable

    def is_readable(self, retry: bool) -> bool:
        """Ask the OutPort's object."""
        return self.agrees(self._is_readable, retry)
