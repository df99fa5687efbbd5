"""InPorts and OutPorts under their old names: thin faces of muros' data ports, bound to a variable's value."""
# ruff: noqa: N802 (the names are those that components know)

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from muros.rtc.codes import DataPortStatus as Status
from muros.rtc.data import Changes, ConnectorEvent, DataEvent, DataInPort, DataOutPort
from muros.rtc.data import ConnectorInfo as Info
from muros.rtc.data_types import data_type_of
from OpenRTM_aist._ports import PortBase, port_reference
from OpenRTM_aist._properties import Properties

__all__ = [
    "ConnectorDataListener",
    "ConnectorDataListenerT",
    "ConnectorDataListenerType",
    "ConnectorInfo",
    "ConnectorListener",
    "ConnectorListenerStatus",
    "ConnectorListenerType",
    "DataPortStatus",
    "InPort",
    "InPortBase",
    "OnRead",
    "OnReadConvert",
    "OnWrite",
    "OnWriteConvert",
    "OutPort",
    "OutPortBase",
    "PortType",
    "RingBuffer",
    "instantiateDataType",
]


class ConnectorDataListenerType:
    """Moments at which a value is at hand."""

    (
        ON_BUFFER_WRITE,
        ON_BUFFER_FULL,
        ON_BUFFER_WRITE_TIMEOUT,
        ON_BUFFER_OVERWRITE,
        ON_BUFFER_READ,
        ON_SEND,
        ON_RECEIVED,
        ON_RECEIVER_FULL,
        ON_RECEIVER_TIMEOUT,
        ON_RECEIVER_ERROR,
        CONNECTOR_DATA_LISTENER_NUM,
    ) = range(11)

    @staticmethod
    def event(number: int) -> DataEvent:
        return tuple(DataEvent)[number]

    @staticmethod
    def toString(number: int) -> str:
        return tuple(DataEvent)[number].value


class ConnectorListenerType:
    """Moments at which there is no value."""

    (
        ON_BUFFER_EMPTY,
        ON_BUFFER_READ_TIMEOUT,
        ON_SENDER_EMPTY,
        ON_SENDER_TIMEOUT,
        ON_SENDER_ERROR,
        ON_CONNECT,
        ON_DISCONNECT,
        CONNECTOR_LISTENER_NUM,
    ) = range(8)

    @staticmethod
    def event(number: int) -> ConnectorEvent:
        return tuple(ConnectorEvent)[number]

    @staticmethod
    def toString(number: int) -> str:
        return tuple(ConnectorEvent)[number].value


class ConnectorListenerStatus:
    """What a listener answers: whether it has changed what it was given."""

    NO_CHANGE = Changes.NO_CHANGE
    INFO_CHANGED = Changes.INFO_CHANGED
    DATA_CHANGED = Changes.DATA_CHANGED
    BOTH_CHANGED = Changes.BOTH_CHANGED


class DataPortStatus:
    """What became of a value."""

    PORT_OK = Status.PORT_OK
    PORT_ERROR = Status.PORT_ERROR
    BUFFER_ERROR = Status.BUFFER_ERROR
    BUFFER_FULL = Status.BUFFER_FULL
    BUFFER_EMPTY = Status.BUFFER_EMPTY
    BUFFER_TIMEOUT = Status.BUFFER_TIMEOUT
    SEND_FULL = Status.SEND_FULL
    SEND_TIMEOUT = Status.SEND_TIMEOUT
    RECV_EMPTY = Status.RECV_EMPTY
    RECV_TIMEOUT = Status.RECV_TIMEOUT
    INVALID_ARGS = Status.INVALID_ARGS
    PRECONDITION_NOT_MET = Status.PRECONDITION_NOT_MET
    CONNECTION_LOST = Status.CONNECTION_LOST
    UNKNOWN_ERROR = Status.UNKNOWN_ERROR

    @staticmethod
    def toString(status: int) -> str:
        return Status(status).name


class PortType:
    """Which side of a connection a listener hears of."""

    OutPortType, InPortType, PortTypeNum = range(3)


class ConnectorInfo:
    """A connection, as listeners see it."""

    def __init__(self, info: Info) -> None:
        self.name = info.name
        self.id = info.connector_id
        self.properties = Properties.of(info.properties)
        self._ports = info.ports

    @property
    def ports(self) -> list[Any]:
        """The references of the ports connected."""
        return [port_reference(port) for port in self._ports]


class ConnectorDataListener:
    """Base of listeners that are given a value: override `__call__(info, data)`."""

    def __call__(self, info: ConnectorInfo, data: Any) -> Any:
        return ConnectorListenerStatus.NO_CHANGE


class ConnectorDataListenerT(ConnectorDataListener):
    """As above. Components that decode by themselves call this `__call__` with what they were given and a value of
    the data type, and get the value; what version 2 adds, a `PortType`, changes nothing."""

    def __call__(  # type: ignore[override]
        self, info: ConnectorInfo, cdrdata: Any, data: Any = None, porttype: int = PortType.InPortType
    ) -> Any:
        if isinstance(cdrdata, (bytes, bytearray)) and data is not None:
            endian = info.properties.getProperty("serializer.cdr.endian", "little")
            return data_type_of(type(data)).decode(bytes(cdrdata), endian.split(",")[0].strip() != "big")
        return cdrdata


class ConnectorListener:
    """Base of listeners that are given no value: override `__call__(info)`."""

    def __call__(self, info: ConnectorInfo) -> Any:
        return ConnectorListenerStatus.NO_CHANGE


class RingBuffer:
    """How many values wait at a port's connections, where they do not say otherwise; for components of version 1.0."""

    def __init__(self, length: int = 8) -> None:
        self.length = length


class OnRead:
    """Base of callbacks before a read: override `__call__()`."""

    def __call__(self) -> None: ...


class OnReadConvert:
    """Base of callbacks that change what is read: override `__call__(value)`."""

    def __call__(self, value: Any) -> Any:
        return value


class OnWrite:
    """Base of callbacks before a write: override `__call__(value)`."""

    def __call__(self, value: Any) -> None: ...


class OnWriteConvert:
    """Base of callbacks that change what is written: override `__call__(value)`."""

    def __call__(self, value: Any) -> Any:
        return value


def instantiateDataType(dtype: type) -> Any:
    """A value of zeros of a data type, `RTC.TimedLong`: what the code that RTCBuilder writes makes ports of."""
    return data_type_of(dtype).default()


class _DataPort(PortBase):
    """What both kinds have in common."""

    port: Any

    def addConnectorDataListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        """Tell `listener(info, data)` of a moment of `ConnectorDataListenerType`."""

        def call(info: Info, value: Any) -> Any:
            return listener(ConnectorInfo(info), value)

        event = ConnectorDataListenerType.event(listener_type)
        return self._listening.begin(event, listener, call, self.port.listeners)

    def removeConnectorDataListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        self._listening.end(ConnectorDataListenerType.event(listener_type), listener, self.port.listeners)

    def addConnectorListener(
        self, callback_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        """Tell `listener(info)` of a moment of `ConnectorListenerType`."""

        def call(info: Info) -> Any:
            return listener(ConnectorInfo(info))

        event = ConnectorListenerType.event(callback_type)
        return self._listening.begin(event, listener, call, self.port.listeners)

    def removeConnectorListener(self, callback_type: int, listener: Callable[..., Any]) -> None:
        self._listening.end(ConnectorListenerType.event(callback_type), listener, self.port.listeners)

    def getPortDataType(self) -> str:
        return str(self.port.data_type.repository_id)

    def connectors(self) -> list[ConnectorInfo]:
        return [ConnectorInfo(info) for info in self.port.connector_infos]


class InPort(_DataPort):
    """An InPort for values like `value`; `read` returns them.

    `buffer` may be a `RingBuffer`. What follows was for components of version 0.4: the connections' properties count.
    """

    kind: ClassVar[str] = "inport"

    def __init__(
        self,
        name: str,
        value: Any,
        buffer: Any = None,
        read_block: bool = False,
        write_block: bool = False,
        read_timeout: int = 0,
        write_timeout: int = 0,
    ) -> None:
        super().__init__(DataInPort(name, data_type_of(type(value)), initial=value))
        self.wishes = _wishes(buffer)
        self._value = value

    def isNew(self, names: Any = None) -> bool:
        """Whether a value waits; `names`: of that connection, or a list to be filled with those that have one."""
        if isinstance(names, list):
            names[:] = self.port.new_connectors()
            return bool(names)
        return bool(self.port.is_new(names))

    def isEmpty(self, names: Any = None) -> bool:
        """Whether no value waits; a list is filled with the connections that have none."""
        if isinstance(names, list):
            new = self.port.new_connectors()
            names[:] = [info.name for info in self.port.connector_infos if info.name not in new]
            return bool(names)
        return bool(self.port.is_empty(names))

    def read(self, name: str | None = None) -> Any:
        """The next value; where there is none, the one before."""
        self.last_status, self._value = self.port.try_read(name or "")
        return self._value

    def update(self) -> None:
        """Read, if there is something new."""
        if self.isNew():
            self.read()

    def getStatus(self, index: int = 0) -> Status:
        return self.last_status

    last_status: Status = Status.PORT_OK

    def setOnRead(self, on_read: Callable[[], Any]) -> None:
        self.port.on_read = on_read

    def setOnReadConvert(self, on_rconvert: Callable[[Any], Any]) -> None:
        self.port.on_read_convert = on_rconvert


class OutPort(_DataPort):
    """An OutPort for values like `value`, which is what `write` sends where it is not given another."""

    kind: ClassVar[str] = "outport"

    def __init__(self, name: str, value: Any, buffer: Any = None) -> None:
        super().__init__(DataOutPort(name, data_type_of(type(value))))
        self.wishes = _wishes(buffer)
        self._value = value
        self.port.value = value

    def write(self, value: Any = None) -> bool:
        """Send a value. True: there are connections, and all have taken it."""
        return bool(self.port.write(self._value if value is None else value))

    def getStatus(self, index: int = 0) -> Status:
        status: Status = self.port.status[index]
        return status

    def getStatusList(self) -> list[Status]:
        return list(self.port.status)

    def setOnWrite(self, on_write: Callable[[Any], Any]) -> None:
        self.port.on_write = on_write

    def setOnWriteConvert(self, on_wconvert: Callable[[Any], Any]) -> None:
        self.port.on_write_convert = on_wconvert


def _wishes(buffer: Any) -> dict[str, str]:
    return {"buffer.length": str(buffer.length)} if isinstance(buffer, RingBuffer) else {}


InPortBase = InPort
OutPortBase = OutPort
