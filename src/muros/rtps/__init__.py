"""The DDSI-RTPS 2.3 protocol (OMG formal/19-04-03) without I/O.

Bytes, events and the time come in as arguments, bytes and events go out. Nothing here opens a socket, reads a clock,
starts a thread or logs. What participants and endpoints say of themselves is gathered here; below it stand

================================  ============================================================================
module                            holds
================================  ============================================================================
``_constants``, ``_values``       numbers of the specification by name; GUIDs, locators, times
``_parameters``                   parameter lists and inline QoS
``_events``, ``_parser``          what a received message holds; reading it
``_wire``                         building messages, and all that is needed to handle them
``_qos``, ``_discovery_data``     participants and endpoints as discovery carries them
``_writer``, ``_reader``          best-effort and reliable endpoints as state machines
================================  ============================================================================
"""

from muros.rtps._constants import MAX_DOMAIN, BuiltinEndpoint, Ports, vendor_name
from muros.rtps._discovery_data import EndpointData, InvalidDiscoveryData, ParticipantData, user_values
from muros.rtps._events import InvalidMessage
from muros.rtps._qos import (
    READER_QOS,
    WRITER_QOS,
    AccessScope,
    DestinationOrder,
    Durability,
    DurabilityService,
    EndpointQos,
    History,
    Liveliness,
    Ownership,
    Reliability,
    ResourceLimits,
)
from muros.rtps._values import INFINITE, Locator, guid_of, split_guid, udp4

__all__ = [
    "INFINITE",
    "MAX_DOMAIN",
    "READER_QOS",
    "WRITER_QOS",
    "AccessScope",
    "BuiltinEndpoint",
    "DestinationOrder",
    "Durability",
    "DurabilityService",
    "EndpointData",
    "EndpointQos",
    "History",
    "InvalidDiscoveryData",
    "InvalidMessage",
    "Liveliness",
    "Locator",
    "Ownership",
    "ParticipantData",
    "Ports",
    "Reliability",
    "ResourceLimits",
    "guid_of",
    "split_guid",
    "udp4",
    "user_values",
    "vendor_name",
]
