"""A data type and a transport of their own, so that data ports are tested without an ORB."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from muros.findings import Finding
from muros.rtc.codes import PeerLostError, PortStatus, ReturnCode
from muros.rtc.data import (
    Connection,
    ConnectorEvent,
    DataError,
    DataEvent,
    DataInPort,
    DataOutPort,
    DataPort,
    TransportError,
)
from muros.rtc.profiles import ConnectorProfile, PropertyValue


@dataclass
class Time:
    sec: int = 0
    nsec: int = 0


@dataclass
class TimedLong:
    tm: Time
    data: int


class TimedLongType:
    """Three words, as the wire has them; counts how often it is asked."""

    repository_id = "IDL:RTC/TimedLong:1.0"
    python_class = TimedLong

    def __init__(self) -> None:
        self.encoded = 0
        self.decoded = 0

    def default(self) -> TimedLong:
        return TimedLong(Time(), 0)

    def encode(self, value: TimedLong, little: bool) -> bytes:
        self.encoded += 1
        try:
            return struct.pack("<IIi" if little else ">IIi", value.tm.sec, value.tm.nsec, value.data)
        except struct.error as error:
            raise DataError(f"TimedLong: {error}") from None

    def decode(self, octets: bytes, little: bool) -> TimedLong:
        self.decoded += 1
        if len(octets) != 12:
            raise DataError(f"TimedLong: {len(octets)} octets instead of 12")
        sec, nsec, data = struct.unpack("<IIi" if little else ">IIi", octets)
        return TimedLong(Time(sec, nsec), data)


def long(data: int) -> TimedLong:
    return TimedLong(Time(), data)


@dataclass
class Ends:
    """What stands at one end of the memory transport."""

    call: Callable[..., object] | None
    properties: Mapping[str, PropertyValue]
    faults: list[Exception | PortStatus] = field(default_factory=list)
    """What the next calls meet instead of the other side."""

    def close(self) -> None:
        self.call = None

    def put(self, octets: bytes) -> PortStatus:
        answer = self._call(octets)
        assert isinstance(answer, PortStatus)
        return answer

    def get(self) -> tuple[PortStatus, bytes]:
        answer = self._call()
        if isinstance(answer, PortStatus):
            return answer, b""
        assert isinstance(answer, tuple)
        return answer

    def _call(self, *arguments: object) -> object:
        if self.faults:
            fault = self.faults.pop(0)
            if isinstance(fault, Exception):
                raise fault
            return fault
        if self.call is None:
            raise PeerLostError("nobody there")
        return self.call(*arguments)


class MemoryTransport:
    """Octets inside this process, under the property names of `corba_cdr`."""

    IN = "dataport.corba_cdr.inport_ref"
    OUT = "dataport.corba_cdr.outport_ref"

    def offer_inlet(self, connection: Connection, put: Callable[[bytes], PortStatus]) -> Ends:
        return self._offer(self.IN, put)

    def offer_outlet(self, connection: Connection, get: Callable[[], tuple[PortStatus, bytes]]) -> Ends:
        return self._offer(self.OUT, get)

    def reach_inlet(self, connection: Connection) -> Ends:
        return self._reach(connection, self.IN)

    def reach_outlet(self, connection: Connection) -> Ends:
        return self._reach(connection, self.OUT)

    @staticmethod
    def _offer(name: str, call: Callable[..., object]) -> Ends:
        ends = Ends(call, {})
        ends.properties = {name: ends}
        return ends

    @staticmethod
    def _reach(connection: Connection, name: str) -> Ends:
        ends = connection.profile.properties.get(name)
        if not isinstance(ends, Ends):
            raise TransportError(f"{name} is missing")
        # Closing this end is not the other one's end.
        return Ends(ends._call, {})


class Pair:
    """An OutPort and an InPort, with all that their listeners hear."""

    def __init__(self, *, configuration: Mapping[str, str] = {}) -> None:
        self.heard: list[str] = []
        self.findings: list[Finding] = []
        self.codec = TimedLongType()
        self.out: DataOutPort[TimedLong] = DataOutPort("out", self.codec, report=self.findings.append)
        self.in_: DataInPort[TimedLong] = DataInPort(
            "in", self.codec, report=self.findings.append, initial=long(-1)
        )
        self.in_.configuration = configuration

    def listen(self) -> None:
        """Hear everything."""
        for name, port in (("OutPort", self.out), ("InPort", self.in_)):
            for event in DataEvent:
                port.add_listener(event, self._hear(f"{name}.{event.value}"))
            for moment in ConnectorEvent:
                port.add_listener(moment, self._hear(f"{name}.{moment.value}"))

    def connect(self, properties: Mapping[str, str] = {}, in_first: bool = False) -> ConnectorProfile:
        """Connect them; the profile agreed on."""
        code, profile = self.ask(properties, in_first)
        assert code is ReturnCode.RTC_OK, [finding.format() for finding in self.findings]
        return profile

    def ask(
        self, properties: Mapping[str, str] = {}, in_first: bool = False
    ) -> tuple[ReturnCode, ConnectorProfile]:
        """Ask the first of them for a connection."""
        ports: tuple[DataPort[TimedLong], ...] = (self.in_, self.out) if in_first else (self.out, self.in_)
        asked = {
            "dataport.interface_type": "corba_cdr",
            "dataport.dataflow_type": "push",
            "dataport.subscription_type": "flush",
            **properties,
        }
        request = ConnectorProfile("wire", "", ports, {key: text for key, text in asked.items() if text})
        return ports[0].connect(request)

    def codes(self) -> list[str]:
        """Codes of the findings."""
        return [finding.code for finding in self.findings]

    def _hear(self, label: str) -> Callable[..., None]:
        def hear(info: object, value: TimedLong | None = None) -> None:
            self.heard.append(f"{label}({value.data if value else None})")

        return hear
