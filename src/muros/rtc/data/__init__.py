"""Data ports: values between components, with buffers, policies and the ways that carry them."""

from muros.rtc.data._transports import (
    TRANSPORTS,
    Connection,
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

__all__ = [
    "ANY_TYPE",
    "TRANSPORTS",
    "AnyDataType",
    "Connection",
    "DataError",
    "DataType",
    "Get",
    "Inlet",
    "Offer",
    "Outlet",
    "PullTransport",
    "PushTransport",
    "Put",
    "TransportError",
    "register_transport",
    "same_type",
    "type_label",
]
