"""The board's side of a rosserial line, without the line: bytes in, bytes out, time handed in.

A board says nothing of itself until it is asked. At the topic request it asks for the time, names everything it
publishes and then everything it wants, and counts as connected; there is no acknowledgement. From then on it asks for
the time every 2.5 s, and as long as answers come it stays connected: 11 s without one and it falls silent until it is
asked again. It may be asked at any moment, and repeats everything. While it is not connected it answers an FF that
begins no frame of its version with a request for the time: so a host learns which version it speaks, and that it has
started anew. All of this is what ros_lib does, byte for byte.
"""

from muros.compat import const, ticks_add, ticks_diff
from muros.rosserial.messages import (
    MessageError,
    TopicInfo,
    time_untrusted,
    values_untrusted,
    write_log,
    write_string,
    write_time,
)
from muros.rosserial.packets import Decoder, finish, head_size

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Protocol

    from muros.rosserial.messages import Values
    from muros.xrce._types import Buffer

    class Writable(Protocol):
        """What has a ROS 1 serialisation."""

        def size(self) -> int: ...

        def write(self, buf: bytearray, off: int) -> int: ...


_BUFFER = const(512)
_SUBSCRIBERS = const(25)
_ANY_VERSION = const(0)
_SYNC = const(0xFF)
_VERSION_HYDRO = const(0xFE)
_VERSION_GROOVY = const(0xFF)
_MAX_PAYLOAD = const(0xFFFF)

_ID_PUBLISHER = const(0)
_ID_SUBSCRIBER = const(1)
_ID_PARAMETER_REQUEST = const(6)
_ID_LOG = const(7)
_ID_TIME = const(10)
_ID_TX_STOP = const(11)
_ID_FIRST_TOPIC = const(100)
_LOG_ERROR = const(3)

_SYNC_PERIOD = const(2500)  # ms between requests for the time
_SYNC_LOST = const(11000)  # ms without an answer until the board takes the host for gone
_SECOND = const(1000000000)


class Device:
    """A board's endpoints, its session with a host, and its idea of the time.

    ``send(buf, off, n)`` takes the bytes for the line. ``input_size`` is the longest payload that is taken,
    ``output_size`` the longest frame that is sent, in bytes; the host is told both. Ids are those of ros_lib:
    subscribers count from 100, publishers from 100 + ``max_subscribers``; a service has one of each. ``version`` is
    that of the frames; with ``ANY_VERSION`` the board speaks as it was last spoken to.

    ``connected`` tells whether the host has asked and still answers. ``values`` is the last answer to a request for a
    parameter. Counters: ``unknown_ids`` and ``malformed`` frames from the host, ``too_large`` messages not sent.
    """

    def __init__(
        self,
        send: "Callable[[Buffer, int, int], object]",
        input_size: int = _BUFFER,
        output_size: int = _BUFFER,
        max_subscribers: int = _SUBSCRIBERS,
        version: int = _VERSION_HYDRO,
    ) -> None:
        self._follow = version == _ANY_VERSION
        first = _VERSION_HYDRO if self._follow else version
        head = head_size(first)
        if input_size > _MAX_PAYLOAD or not 64 <= output_size <= _MAX_PAYLOAD + head + 1:
            raise ValueError("a rosserial buffer has 64 to 65535 bytes")
        self.connected = False
        self.values: "Values | None" = None
        self.unknown_ids = 0
        self.malformed = 0
        self.too_large = 0
        self.decoder = Decoder(input_size, self._on_frame, version)
        self._send = send
        self._input_size = input_size
        self._out = bytearray(output_size)
        self._version = first
        self._head = head
        self._first_publisher = _ID_FIRST_TOPIC + max_subscribers
        self._publishers: "list[tuple[int, TopicInfo]]" = []
        self._subscribers: "list[tuple[int, TopicInfo]]" = []
        self._handlers: "list[Callable[[bytearray, int, int], object]]" = []
        self._sync = False
        self._now = 0
        self._asked = 0
        self._answered = 0
        self._clock = 0
        self._seconds = 0
        self._nanoseconds = 0

    def publisher(self, topic: str, kind: str, md5: str, endpoint: int = _ID_PUBLISHER) -> int:
        """Adds what the board publishes, or the half of a service that it sends; returns its id."""
        topic_id = self._first_publisher + len(self._publishers)
        info = TopicInfo(topic_id, topic, kind, md5, len(self._out))
        self._publishers.append((endpoint, info))
        self._announce(endpoint, info)
        return topic_id

    def subscriber(
        self,
        topic: str,
        kind: str,
        md5: str,
        on_payload: "Callable[[bytearray, int, int], object]",
        endpoint: int = _ID_SUBSCRIBER,
    ) -> int:
        """Adds what the board wants, or the half of a service that it takes; returns its id.

        ``on_payload(buf, off, n)`` gets each payload, which is valid until it returns; it may raise MessageError.
        """
        topic_id = _ID_FIRST_TOPIC + len(self._subscribers)
        if topic_id == self._first_publisher:
            raise ValueError(
                "no more than " + str(len(self._subscribers)) + " subscribers: see max_subscribers"
            )
        info = TopicInfo(topic_id, topic, kind, md5, self._input_size)
        self._subscribers.append((endpoint, info))
        self._handlers.append(on_payload)
        self._announce(endpoint, info)
        return topic_id

    def feed(self, data: "Buffer", n: int, now: int) -> None:
        """Takes ``data[:n]``, which came at ``now`` (ticks in ms)."""
        self._now = now
        decoder = self.decoder
        before = decoder.frames
        decoder.feed(data, n, now)
        if not self.connected and decoder.frames == before:
            self._look_for_sync(data, n)

    def tick(self, now: int) -> int:
        """Does what is due; returns in how many ms to call again at the latest."""
        self._now = now
        due = _SYNC_PERIOD
        if self.connected:
            if ticks_diff(now, self._answered) > _SYNC_LOST:
                self.connected = False
            elif ticks_diff(now, self._asked) > _SYNC_PERIOD:
                self._ask_time()
            else:
                due = _SYNC_PERIOD + 1 - ticks_diff(now, self._asked)
        waiting = self.decoder.tick(now)
        return due if waiting < 0 else min(due, waiting)

    def lost(self) -> None:
        """The line is gone: a host that comes back asks again."""
        self.connected = False
        self.decoder.reset()

    def publish(self, topic_id: int, message: "Writable") -> int:
        """Sends a message; returns the bytes of its frame, 0 while not connected, -1 if the buffer is too small."""
        if not self.connected and topic_id >= _ID_FIRST_TOPIC:
            return 0
        n = message.size()
        if self._head + n + 1 > len(self._out):
            self.too_large += 1
            self.log(_LOG_ERROR, b"Message from device dropped: message larger than buffer.")
            return -1
        message.write(self._out, self._head)
        return self._sent(topic_id, n)

    def log(self, level: int, text: bytes) -> int:
        """Sends a line to the host's log, cut to the buffer; also while not connected."""
        room = len(self._out) - self._head - 6
        if len(text) > room:
            text = text[:room]
        return self._sent(_ID_LOG, write_log(self._out, self._head, level, text) - self._head)

    def request_parameter(self, name: bytes) -> None:
        """Asks for a parameter; ``values`` is None until the answer comes."""
        self.values = None
        if self._head + len(name) + 5 > len(self._out):
            raise ValueError("the name of the parameter is longer than the buffer")
        self._sent(_ID_PARAMETER_REQUEST, write_string(self._out, self._head, name) - self._head)

    def time(self, now: int) -> "tuple[int, int]":
        """Seconds and nanoseconds of the host's clock at ``now``; counts from 0 until the host has told the time."""
        nanoseconds = self._nanoseconds + ticks_diff(now, self._clock) % 1000 * 1000000
        seconds = self._seconds + ticks_diff(now, self._clock) // 1000
        if nanoseconds >= _SECOND:
            return seconds + 1, nanoseconds - _SECOND
        return seconds, nanoseconds

    # ---- the session ----

    def _on_frame(self, topic_id: int, buf: bytearray, off: int, n: int) -> None:
        if self._follow:
            self._version = self.decoder.heard
            self._head = head_size(self._version)
        slot = topic_id - _ID_FIRST_TOPIC
        try:
            if 0 <= slot < len(self._handlers):
                self._handlers[slot](buf, off, n)
            elif topic_id == _ID_PUBLISHER:
                self._on_topic_request()
            elif topic_id == _ID_TIME:
                self._on_time(buf, off, n)
            elif topic_id == _ID_PARAMETER_REQUEST:
                self.values = values_untrusted(buf, off, n)
            elif topic_id == _ID_TX_STOP:
                self.connected = False
            else:
                self.unknown_ids += 1
        except MessageError:
            self.malformed += 1

    def _look_for_sync(self, data: "Buffer", n: int) -> None:
        """Whoever speaks another version, or looks for boards that have started anew, is shown the own version."""
        strange = False
        for i in range(n):
            byte = data[i]
            if self._sync and byte != _VERSION_HYDRO and not (self._follow and byte == _VERSION_GROOVY):
                strange = True
            self._sync = byte == _SYNC and not self._sync
        if strange and self._version == _VERSION_HYDRO:  # ros_lib of Groovy says nothing
            self._ask_time()

    def _on_topic_request(self) -> None:
        self._ask_time()
        for endpoint, info in self._publishers:
            self._say(endpoint, info)
        for endpoint, info in self._subscribers:
            self._say(endpoint, info)
        self.connected = True
        self._answered = self._now

    def _announce(self, endpoint: int, info: TopicInfo) -> None:
        """What is added during a session is told at once; ros_lib would wait to be asked."""
        if self._head + info.size() + 1 > len(self._out):
            raise ValueError(
                "a buffer of " + str(len(self._out)) + " bytes cannot tell of " + info.topic_name
            )
        if self.connected:
            self._say(endpoint, info)

    def _say(self, endpoint: int, info: TopicInfo) -> None:
        self._sent(endpoint, info.write(self._out, self._head) - self._head)

    def _ask_time(self) -> None:
        self._asked = self._now
        self._sent(_ID_TIME, write_time(self._out, self._head, 0, 0) - self._head)

    def _on_time(self, buf: bytearray, off: int, n: int) -> None:
        seconds, nanoseconds = time_untrusted(buf, off, n)
        # The stamp is that of the answer's sending: half of the round trip lies behind it.
        half = ticks_diff(self._now, self._asked) // 2
        self._clock = ticks_add(self._now, -half)
        self._seconds = seconds
        self._nanoseconds = nanoseconds
        self._answered = self._now

    def _sent(self, topic_id: int, n: int) -> int:
        end = finish(self._out, 0, topic_id, n, self._version)
        self._send(self._out, 0, end)
        return end
