"""What the rosserial protocol itself sends: topics and services on offer, parameters, logs, time.

Payloads are ROS 1 serialisation, little endian, without padding: a string is a u32 length and its bytes, an array
a u32 count and its elements. Whoever writes calls ``size()`` first and then ``write(buf, off)``, which returns
the offset behind. Functions named ``*_untrusted`` read foreign bytes and raise `MessageError` only.
"""

import struct

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer

_MAX_VALUES = const(1024)


class MessageError(ValueError):
    """The payload is not what its topic id promises."""

    def __init__(self, text: str) -> None:
        super().__init__(text)


class TopicInfo:
    """What a board offers or wants under one topic id (rosserial_msgs/TopicInfo).

    ``message_type`` is ``package/Type``; for a half of a service it is the service's name and ``md5sum`` that of the
    half. ``buffer_size`` is the board's output buffer for what it publishes, its input buffer for the rest, in bytes.
    """

    def __init__(
        self, topic_id: int, topic_name: str, message_type: str, md5sum: str, buffer_size: int
    ) -> None:
        self.topic_id = topic_id
        self.topic_name = topic_name
        self.message_type = message_type
        self.md5sum = md5sum
        self.buffer_size = buffer_size

    def size(self) -> int:
        """Bytes that ``write`` takes."""
        return (
            18 + len(self.topic_name.encode()) + len(self.message_type.encode()) + len(self.md5sum.encode())
        )

    def write(self, buf: bytearray, off: int) -> int:
        """Writes it at ``off``; returns the offset behind."""
        struct.pack_into("<H", buf, off, self.topic_id)
        off = write_string(buf, off + 2, self.topic_name.encode())
        off = write_string(buf, off, self.message_type.encode())
        off = write_string(buf, off, self.md5sum.encode())
        struct.pack_into("<i", buf, off, self.buffer_size)
        return off + 4


def topic_info_untrusted(buf: "Buffer", off: int, n: int) -> TopicInfo:
    """The TopicInfo in ``buf[off:off + n]``."""
    end = off + n
    if n < 2:
        raise MessageError("a TopicInfo is cut short")
    topic_id = buf[off] | buf[off + 1] << 8
    name, off = _text_untrusted(buf, off + 2, end)
    kind, off = _text_untrusted(buf, off, end)
    md5sum, off = _text_untrusted(buf, off, end)
    if end - off != 4:
        raise MessageError("a TopicInfo ends early or late")
    return TopicInfo(topic_id, name, kind, md5sum, struct.unpack_from("<i", buf, off)[0])


def log_untrusted(buf: "Buffer", off: int, n: int) -> "tuple[int, bytes]":
    """Level and text of a rosserial_msgs/Log."""
    if n < 5:
        raise MessageError("a Log is cut short")
    text, end = _string_untrusted(buf, off + 1, off + n)
    if end != off + n:
        raise MessageError("a Log ends late")
    return buf[off], text


def write_log(buf: bytearray, off: int, level: int, text: bytes) -> int:
    """Writes a rosserial_msgs/Log of 5 + len(text) bytes; returns the offset behind."""
    buf[off] = level
    return write_string(buf, off + 1, text)


def parameter_request_untrusted(buf: "Buffer", off: int, n: int) -> str:
    """The name in a rosserial_msgs/RequestParam."""
    name, end = _text_untrusted(buf, off, off + n)
    if end != off + n:
        raise MessageError("a request for a parameter ends late")
    return name


class Values:
    """The answer to a request for a parameter, or three empty lists (rosserial_msgs/RequestParamResponse)."""

    def __init__(
        self,
        ints: "list[int] | None" = None,
        floats: "list[float] | None" = None,
        strings: "list[bytes] | None" = None,
    ) -> None:
        self.ints = ints or []
        self.floats = floats or []
        self.strings = strings or []

    def size(self) -> int:
        """Bytes that ``write`` takes."""
        n = 12 + 4 * (len(self.ints) + len(self.floats) + len(self.strings))
        for text in self.strings:
            n += len(text)
        return n

    def write(self, buf: bytearray, off: int) -> int:
        """Writes it at ``off``; returns the offset behind. Ints are 32 bit and floats single precision there."""
        struct.pack_into("<I", buf, off, len(self.ints))
        off += 4
        for number in self.ints:
            struct.pack_into("<i", buf, off, number)
            off += 4
        struct.pack_into("<I", buf, off, len(self.floats))
        off += 4
        for value in self.floats:
            struct.pack_into("<f", buf, off, value)
            off += 4
        struct.pack_into("<I", buf, off, len(self.strings))
        off += 4
        for text in self.strings:
            off = write_string(buf, off, text)
        return off


def values_untrusted(buf: "Buffer", off: int, n: int) -> Values:
    """The values in an answer to a request for a parameter."""
    end = off + n
    values = Values()
    count = _count_untrusted(buf, off, end, 4)
    off += 4
    for _ in range(count):
        values.ints.append(struct.unpack_from("<i", buf, off)[0])
        off += 4
    count = _count_untrusted(buf, off, end, 4)
    off += 4
    for _ in range(count):
        values.floats.append(struct.unpack_from("<f", buf, off)[0])
        off += 4
    count = _count_untrusted(buf, off, end, 4)
    off += 4
    for _ in range(count):
        text, off = _string_untrusted(buf, off, end)
        values.strings.append(text)
    if off != end:
        raise MessageError("values of a parameter end late")
    return values


def write_time(buf: bytearray, off: int, seconds: int, nanoseconds: int) -> int:
    """Writes a std_msgs/Time of 8 bytes; returns the offset behind."""
    struct.pack_into("<II", buf, off, seconds, nanoseconds)
    return off + 8


def time_untrusted(buf: "Buffer", off: int, n: int) -> "tuple[int, int]":
    """Seconds and nanoseconds of a std_msgs/Time."""
    if n != 8:
        raise MessageError("a Time has 8 bytes")
    seconds, nanoseconds = struct.unpack_from("<II", buf, off)
    return seconds, nanoseconds


def write_string(buf: bytearray, off: int, text: bytes) -> int:
    """Writes a string; returns the offset behind."""
    n = len(text)
    struct.pack_into("<I", buf, off, n)
    off += 4
    buf[off : off + n] = text
    return off + n


def _string_untrusted(buf: "Buffer", off: int, end: int) -> "tuple[bytes, int]":
    if end - off < 4:
        raise MessageError("a string is cut short")
    n = struct.unpack_from("<I", buf, off)[0]
    off += 4
    if n > end - off:
        raise MessageError("a string of " + str(n) + " bytes where " + str(end - off) + " are left")
    return bytes(buf[off : off + n]), off + n


def _text_untrusted(buf: "Buffer", off: int, end: int) -> "tuple[str, int]":
    text, off = _string_untrusted(buf, off, end)
    try:
        return text.decode(), off
    except ValueError:
        raise MessageError("a name is not UTF-8") from None


def _count_untrusted(buf: "Buffer", off: int, end: int, least: int) -> int:
    """How many elements follow, each of ``least`` bytes or more."""
    if end - off < 4:
        raise MessageError("an array is cut short")
    n: int = struct.unpack_from("<I", buf, off)[0]
    if n > _MAX_VALUES or n * least > end - off - 4:
        raise MessageError(
            "an array of " + str(n) + " elements where " + str(end - off - 4) + " bytes are left"
        )
    return n
