"""Octets from OutPorts to topics, and from topics to InPorts.

A write is queued and carried out in the hall's thread: OutPorts never wait for a network. What comes is handed to the
InPort by a thread of its own, so that a port that blocks, and listeners that do, hold up nobody else. Both queues are
bounded; what does not fit is counted and told.
"""

from __future__ import annotations

import struct
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, TypeVar

from muros.findings import Finding
from muros.interfaces import InterfaceError, check_node_name, dds_topic, dds_type_name, expand_name
from muros.rtc.codes import PeerLostError, PortStatus
from muros.rtc.data._transports import Connection, Put, TransportError
from muros.rtc.data.space._hall import HALL, Hall, Seat
from muros.rtc.profiles import PropertyValue
from muros.space import ClosedError, Durability, Qos, Reader, Reliability, Topic, Writer

__all__ = ["SpaceTransport"]

BACKLOG: Final = 1000
"""Values that wait for the space, or for the InPort, at most."""

JOIN_TIME: Final = 1.0
"""Seconds that closing waits for an InPort that is taking a value."""

DEFAULT_URL: Final = "dds:"
"""The space of connections that name none: the ROS 2 graph, in the domain of ROS_DOMAIN_ID."""

_HEADER: Final = struct.Struct(">HH")
"""Encapsulation header: representation, options. DDSI-RTPS 2.5, 10.2."""


@dataclass(frozen=True, slots=True)
class Place:
    """Which topic of which space a connection means."""

    url: str
    node: str
    topic: Topic
    qos: Qos


class SpaceTransport:
    """The push transport of `space` and `ros2`."""

    def __init__(self, hall: Hall = HALL) -> None:
        self._hall = hall

    def offer_inlet(self, connection: Connection, put: Put) -> _Subscription:
        return _Subscription(self._hall, place_of(connection), connection, put)

    def reach_inlet(self, connection: Connection) -> _Publication:
        return _Publication(self._hall, place_of(connection), connection)


def place_of(connection: Connection) -> Place:
    """What the connection's properties say. TransportError names the one that makes no sense.

    Keys, each also with `space.` or `ros2.` before it: topic, node.name, domain.id, url, qos (a profile such as
    sensor_data), qos.reliability (reliable, best_effort), qos.durability (volatile, transient_local), qos.depth.
    """
    instance, _, port = connection.port_name.rpartition(".")
    node = _option(connection, "node.name") or _name(instance or "rtc")
    domain = _option(connection, "domain.id")
    url = _option(connection, "url") or DEFAULT_URL
    try:
        check_node_name(node)
        name = expand_name(_option(connection, "topic") or _name(port), node)
        topic = Topic(dds_topic(name), dds_type_name(getattr(connection.codec, "message_type", "")))
        return Place(url + domain if url.endswith(":") else url, node, topic, _qos(connection))
    except (InterfaceError, ValueError) as error:
        raise TransportError(f"{connection.port_name}: {error}") from None


def _option(connection: Connection, key: str) -> str:
    for name in (f"space.{key}", f"ros2.{key}", key):
        if text := connection.options.get(name, "").strip():
            return text
    return ""


def _name(text: str) -> str:
    """A name as ROS allows it."""
    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in text)
    return name if name[:1].isalpha() or name[:1] == "_" else f"_{name}"


E = TypeVar("E", Reliability, Durability)


def _qos(connection: Connection) -> Qos:
    qos = Qos.preset(_option(connection, "qos") or "default")
    changes: dict[str, object] = {}
    if text := _option(connection, "qos.reliability"):
        changes["reliability"] = _member(Reliability, text)
    if text := _option(connection, "qos.durability"):
        changes["durability"] = _member(Durability, text)
    if text := _option(connection, "qos.depth"):
        changes["depth"] = int(text)
    return qos.replace(**changes)


def _member(kind: type[E], text: str) -> E:
    try:
        return kind[text.upper()]
    except KeyError:
        known = ", ".join(one.name.lower() for one in kind)
        raise ValueError(f"qos: {text!r} is unknown; ask for one of {known}") from None


class _Publication:
    """An OutPort's topic."""

    def __init__(self, hall: Hall, place: Place, connection: Connection) -> None:
        self._hall = hall
        self._seat: Final = _seat(hall, place, connection)
        self._waiting: Final[deque[bytes]] = deque()
        self._lock: Final = threading.Lock()
        self._posted = False
        try:
            self._writer: Final[Writer] = hall.run(lambda: self._make(place))
        except BaseException:
            hall.leave(self._seat)
            raise

    def put(self, octets: bytes) -> PortStatus:
        with self._lock:
            if len(self._waiting) >= BACKLOG:
                return PortStatus.BUFFER_FULL
            self._waiting.append(octets)
            if self._posted:
                return PortStatus.PORT_OK
            self._posted = True
        if not self._hall.post(self._write_waiting):
            raise PeerLostError("the space is closed")
        return PortStatus.PORT_OK

    def close(self) -> None:
        self._hall.leave(self._seat, self._end)

    def _end(self) -> None:
        self._write_waiting()
        self._writer.close()

    def _make(self, place: Place) -> Writer:
        writer = self._seat.participant.writer(place.topic, place.qos)
        writer.on_room = self._write_waiting
        return writer

    def _write_waiting(self) -> None:
        """In the hall. A writer that is refused calls it again when there is room."""
        while True:
            with self._lock:
                if not self._waiting:
                    self._posted = False
                    return
                octets = self._waiting[0]
            representation, _ = _HEADER.unpack_from(octets)
            try:
                if not self._writer.write(octets[_HEADER.size :], representation=representation):
                    return
            except ClosedError:
                return
            with self._lock:
                self._waiting.popleft()


class _Subscription:
    """An InPort's topic."""

    def __init__(self, hall: Hall, place: Place, connection: Connection, put: Put) -> None:
        self.properties: Mapping[str, PropertyValue] = {}
        self._hall = hall
        self._put = put
        self._report: Callable[[Finding], object] = connection.report
        self._who: Final = f"port {connection.port_name}"
        self._topic: Final = place.topic
        self._came: Final[deque[bytes]] = deque()
        self._wake: Final = threading.Condition(threading.Lock())
        self._closed = False
        self.dropped = 0
        """Values that the InPort was too slow for."""
        self._reader: Reader | None = None
        self._seat: Final = _seat(hall, place, connection)
        self._thread: Final = threading.Thread(
            target=self._deliver, name=f"{self._who} {place.topic.name}", daemon=True
        )
        self._thread.start()
        try:
            self._reader = hall.run(lambda: self._seat.participant.reader(place.topic, place.qos, self._take))
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        self._hall.leave(self._seat, self._end)
        with self._wake:
            self._closed = True
            self._wake.notify()
        if self._thread is not threading.current_thread():
            self._thread.join(JOIN_TIME)

    def _end(self) -> None:
        if self._reader is not None:
            self._reader.close()

    def _take(self, reader: Reader) -> None:
        """In the hall."""
        lost = 0
        with self._wake:
            while (sample := reader.take()) is not None:
                if len(self._came) >= BACKLOG:
                    self._came.popleft()
                    lost += 1
                self._came.append(_HEADER.pack(sample.representation, 0) + sample.data)
            self._wake.notify()
        if lost:
            self.dropped += lost
            self._report(
                Finding(
                    "values-overwritten",
                    self._who,
                    f"{{n}} value{{s}} of {self._topic.name} dropped",
                    f"the port takes them more slowly than they come, {BACKLOG} wait",
                    "let buffer.write.full_policy be overwrite, and listeners return soon",
                    subject=self._topic.name,
                    new=lost,
                )
            )

    def _deliver(self) -> None:
        while True:
            with self._wake:
                while not self._came and not self._closed:
                    self._wake.wait()
                if self._closed:
                    return
                octets = self._came.popleft()
            self._put(octets)


def _seat(hall: Hall, place: Place, connection: Connection) -> Seat:
    return hall.enter(place.url, place.node, connection.report)
