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
``_domain``, ``_participant``     those of this process, and what they stand on: ``_others`` and ``_discovery``
                                  (who else is there), ``_registry`` and ``_matching`` (who meets whom)
``_local``                        writers and readers in users' hands
``_news``                         what a participant tells its owner
================================  ============================================================================
"""

from muros.rtps._constants import MAX_DOMAIN, BuiltinEndpoint, Ports, StatusInfo, vendor_name
from muros.rtps._discovery_data import EndpointData, InvalidDiscoveryData, ParticipantData, user_values
from muros.rtps._domain import DomainCore
from muros.rtps._domain_settings import DOMAIN_DEFAULTS, NOWHERE, Addresses, DomainSettings, Transmit
from muros.rtps._endpoint import Problem
from muros.rtps._events import InvalidMessage
from muros.rtps._local import LocalReader, LocalWriter, OnSample, Received
from muros.rtps._news import (
    DeadlineMissed,
    DomainProblem,
    DomainReport,
    EndpointChanged,
    EndpointFound,
    EndpointLost,
    Incompatible,
    LivelinessChanged,
    LivelinessLost,
    Matched,
    Mismatch,
    ParticipantChanged,
    ParticipantEvent,
    ParticipantFound,
    ParticipantLost,
    Policy,
    Trouble,
    Unmatched,
    Why,
)
from muros.rtps._parameters import InvalidParameters, Parameters, inline_qos, related_identity
from muros.rtps._participant import ParticipantCore
from muros.rtps._qos import (
    READER_QOS,
    WRITER_QOS,
    XCDR1,
    XCDR2,
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
from muros.rtps._settings import ReaderSettings, WriterSettings
from muros.rtps._values import INFINITE, Guid, GuidPrefix, Locator, guid_of, split_guid, udp4

__all__ = [
    "DOMAIN_DEFAULTS",
    "INFINITE",
    "MAX_DOMAIN",
    "NOWHERE",
    "READER_QOS",
    "WRITER_QOS",
    "XCDR1",
    "XCDR2",
    "AccessScope",
    "Addresses",
    "BuiltinEndpoint",
    "DeadlineMissed",
    "DestinationOrder",
    "DomainCore",
    "DomainProblem",
    "DomainReport",
    "DomainSettings",
    "Durability",
    "DurabilityService",
    "EndpointChanged",
    "EndpointData",
    "EndpointFound",
    "EndpointLost",
    "EndpointQos",
    "Guid",
    "GuidPrefix",
    "History",
    "Incompatible",
    "InvalidDiscoveryData",
    "InvalidMessage",
    "InvalidParameters",
    "Liveliness",
    "LivelinessChanged",
    "LivelinessLost",
    "LocalReader",
    "LocalWriter",
    "Locator",
    "Matched",
    "Mismatch",
    "OnSample",
    "Ownership",
    "Parameters",
    "ParticipantChanged",
    "ParticipantCore",
    "ParticipantData",
    "ParticipantEvent",
    "ParticipantFound",
    "ParticipantLost",
    "Policy",
    "Ports",
    "Problem",
    "ReaderSettings",
    "Received",
    "Reliability",
    "ResourceLimits",
    "StatusInfo",
    "Transmit",
    "Trouble",
    "Unmatched",
    "Why",
    "WriterSettings",
    "guid_of",
    "inline_qos",
    "related_identity",
    "split_guid",
    "udp4",
    "user_values",
    "vendor_name",
]
