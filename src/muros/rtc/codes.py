"""The codes of the RTC specification and of OpenRTM-aist's ports, with their values on the wire."""

from enum import Enum, IntEnum

__all__ = [
    "BufferStatus",
    "DataPortStatus",
    "ExecutionKind",
    "LifeCycleState",
    "PeerLostError",
    "Polarity",
    "PortStatus",
    "PortType",
    "ReturnCode",
    "RtcError",
]


class RtcError(Exception):
    """What all errors of this room are: something was asked for that cannot be; the text says what to do."""


class ReturnCode(IntEnum):
    """What an operation answers. RTC 1.1, 5.2.1.1 (ReturnCode_t)."""

    RTC_OK = 0
    RTC_ERROR = 1
    BAD_PARAMETER = 2
    UNSUPPORTED = 3
    OUT_OF_RESOURCES = 4
    PRECONDITION_NOT_MET = 5


class LifeCycleState(IntEnum):
    """Where a component stands in one execution context. RTC 1.1, 5.2.2.3."""

    CREATED_STATE = 0
    INACTIVE_STATE = 1
    ACTIVE_STATE = 2
    ERROR_STATE = 3


class ExecutionKind(IntEnum):
    """How an execution context runs. RTC 1.1, 5.2.2.7."""

    PERIODIC = 0
    EVENT_DRIVEN = 1
    OTHER = 2


class Polarity(IntEnum):
    """Whether a port provides an interface or requires it. RTC 1.1, 5.4.2.6."""

    PROVIDED = 0
    REQUIRED = 1


class PortStatus(IntEnum):
    """What a data port's peer answers to put and get (OpenRTM::PortStatus)."""

    PORT_OK = 0
    PORT_ERROR = 1
    BUFFER_FULL = 2
    BUFFER_EMPTY = 3
    BUFFER_TIMEOUT = 4
    UNKNOWN_ERROR = 5


class BufferStatus(IntEnum):
    """What a buffer answers."""

    OK = 0
    ERROR = 1
    FULL = 2
    EMPTY = 3
    NOT_SUPPORTED = 4
    TIMEOUT = 5
    PRECONDITION_NOT_MET = 6


class DataPortStatus(IntEnum):
    """What became of a value at one connector of a data port."""

    PORT_OK = 0
    PORT_ERROR = 1
    BUFFER_ERROR = 2
    BUFFER_FULL = 3
    BUFFER_EMPTY = 4
    BUFFER_TIMEOUT = 5
    SEND_FULL = 6
    SEND_TIMEOUT = 7
    RECV_EMPTY = 8
    RECV_TIMEOUT = 9
    INVALID_ARGS = 10
    PRECONDITION_NOT_MET = 11
    CONNECTION_LOST = 12
    UNKNOWN_ERROR = 13


class PortType(Enum):
    """`port.port_type` of a port's profile: tools go by it."""

    DATA_IN = "DataInPort"
    DATA_OUT = "DataOutPort"
    SERVICE = "CorbaPort"


class PeerLostError(RtcError):
    """A port, component or context of another process does not answer: it has ended, or the line is cut."""
