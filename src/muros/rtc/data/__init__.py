"""Data ports: values between components, with buffers, policies and the ways that carry them.

`in_port` and `out_port` are what components use. Below them, from the user to the wire: `_port` (their part in a
negotiation), `_links` (one end of one connection), `_publishers` (when to send), `_buffer` and `_ring` (what waits),
`_policies` (which of it goes), `_samples` (a value and its octets), `_transports` and `_serializers` (registries that
other rooms fill), `_options` (what the properties of a connection mean).
"""

from muros.rtc.data._buffer import BufferOptions
from muros.rtc.data._connect import connect
from muros.rtc.data._links import Link
from muros.rtc.data._listeners import Changes, ConnectorEvent, ConnectorInfo, DataEvent
from muros.rtc.data._options import Side, effective_properties
from muros.rtc.data._policies import PushPolicy
from muros.rtc.data._port import DIRECT, DataPort
from muros.rtc.data._ring import EmptyPolicy, FullPolicy
from muros.rtc.data._samples import copy_value, stamp
from muros.rtc.data._serializers import (
    CDR,
    codec_of,
    marshaling_types,
    register_serializer,
    register_serializers,
)
from muros.rtc.data._transports import (
    TRANSPORTS,
    ChannelInlet,
    ChannelOutlet,
    Connection,
    DuplexTransport,
    Get,
    Inlet,
    Offer,
    Outlet,
    PullTransport,
    PushTransport,
    Put,
    TransportError,
    register_transport,
)
from muros.rtc.data._types import ANY_TYPE, AnyDataType, DataError, DataType, same_type, type_label
from muros.rtc.data.in_port import DataInPort
from muros.rtc.data.out_port import DataOutPort
from muros.rtc.data.space import register_space

__all__ = [
    "ANY_TYPE",
    "CDR",
    "DIRECT",
    "TRANSPORTS",
    "AnyDataType",
    "BufferOptions",
    "Changes",
    "ChannelInlet",
    "ChannelOutlet",
    "Connection",
    "ConnectorEvent",
    "ConnectorInfo",
    "DataError",
    "DataEvent",
    "DataInPort",
    "DataOutPort",
    "DataPort",
    "DataType",
    "DuplexTransport",
    "EmptyPolicy",
    "FullPolicy",
    "Get",
    "Inlet",
    "Link",
    "Offer",
    "Outlet",
    "PullTransport",
    "PushPolicy",
    "PushTransport",
    "Put",
    "Side",
    "TransportError",
    "codec_of",
    "connect",
    "copy_value",
    "effective_properties",
    "marshaling_types",
    "register_serializer",
    "register_serializers",
    "register_transport",
    "same_type",
    "stamp",
    "type_label",
]

register_space()
