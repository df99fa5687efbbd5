"""Service ports: operations that one component offers and others call."""

from muros.rtc.services._connect import connect
from muros.rtc.services._objects import (
    NotConnectedError,
    OfferedObject,
    ServiceObjects,
    ServiceTypeError,
    service_objects,
    use_service_objects,
)
from muros.rtc.services.consumer import Consumer
from muros.rtc.services.declarations import Provided, Required
from muros.rtc.services.port import ServicePort

__all__ = [
    "Consumer",
    "NotConnectedError",
    "OfferedObject",
    "Provided",
    "Required",
    "ServiceObjects",
    "ServicePort",
    "ServiceTypeError",
    "connect",
    "service_objects",
    "use_service_objects",
]
