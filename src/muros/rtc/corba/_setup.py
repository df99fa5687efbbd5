"""What the rest of this room needs of an ORB that has started: data types, service objects, transports."""

from __future__ import annotations

from collections.abc import Callable

from muros.findings import Finding
from muros.rtc.corba._channel import CspChannel
from muros.rtc.corba._codec import data_type_of
from muros.rtc.corba._importer import install
from muros.rtc.corba._objects import Objects
from muros.rtc.corba._orb import Orb
from muros.rtc.corba._service_objects import OrbServiceObjects
from muros.rtc.corba._shared_memory import SharedMemoryTransport, is_available
from muros.rtc.corba._transports import corba_cdr, data_service
from muros.rtc.data import register_transport
from muros.rtc.data_types import use_data_types
from muros.rtc.services import use_service_objects

__all__ = ["set_up"]


def set_up(orb: Orb, *, report: Callable[[Finding], object] = lambda finding: None) -> Objects:
    """Let components of this process use `orb`; a later one takes the place of an earlier one.

    Returns what offers components to other processes. Until this has been called, data types and service ports have
    no meaning, and data ports connect within the process only.
    """
    install()
    use_data_types(data_type_of)
    use_service_objects(OrbServiceObjects(orb))
    for name, transport in (("corba_cdr", corba_cdr(orb)), ("data_service", data_service(orb))):
        register_transport(name, push=transport, pull=transport)
    register_transport("csp_channel", duplex=CspChannel(orb))
    if is_available():
        shared = SharedMemoryTransport(orb)
        register_transport("shared_memory", push=shared, pull=shared)
    return Objects(orb, report=report)
