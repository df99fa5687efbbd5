"""CREATE and READ_DATA payloads as a client writes them, in the binary representation (DDS-XRCE 1.0, 7.7.3).

Every function returns the ObjectVariant of a CREATE, that is its payload behind the request id and the object id.
Ids are integers: ``index << 4 | kind``. Padding is zero. The XML and reference formats are in ``create_text``.
"""

from struct import pack

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Protocol

    class EndpointQos(Protocol):
        """What a writer or a reader asks of the agent's middleware."""

        flags: int
        depth: int
        deadline: int
        lifespan: int


_IN_BINARY = const(3)
_KIND_PARTICIPANT = const(1)
_KIND_TOPIC = const(2)
_KIND_DATAWRITER = const(5)


def participant(name: str, domain: int) -> bytes:
    """A participant with a name, in a domain."""
    blob = _string(b"\0\1", name)
    return _variant(_KIND_PARTICIPANT, blob, bytes(len(blob) & 1) + pack("<h", domain))


def topic(name: str, type_name: str, parent: int) -> bytes:
    """A topic of a participant, by its names in DDS (``rt/chatter``, ``std_msgs::msg::dds_::String_``)."""
    return _variant(_KIND_TOPIC, _string(_string(b"", name) + b"\0\1", type_name), pack(">H", parent))


def group(kind: int, parent: int) -> bytes:
    """A publisher or a subscriber (``kind`` 3 or 4) of a participant."""
    return _variant(kind, b"\0\0", pack(">H", parent))


def endpoint(
    kind: int, topic_id: int, qos: "EndpointQos", parent: int, name: str = "", type_name: str = ""
) -> bytes:
    """A datawriter or a datareader (``kind`` 5 or 6) of a publisher or subscriber.

    A depth, a deadline or a lifespan (both in ms) of 0 is left to the agent. The names of the topic are needed by
    the other formats only.
    """
    blob = pack("<BBBxH", topic_id >> 8, topic_id & 255, 1, qos.flags)
    blob += pack("<BxH", 1, qos.depth) if qos.depth else b"\0"
    blob = _optional(_optional(blob, qos.deadline), qos.lifespan)
    return _variant(kind, blob + bytes(2 if kind == _KIND_DATAWRITER else 3), pack(">H", parent))


def service(
    kind: int,
    name: str,
    request_type: str,
    reply_type: str,
    request_topic: str,
    reply_topic: str,
    parent: int,
) -> bytes:
    """A requester or a replier (``kind`` 7 or 8) of a participant, by the names of its types and topics in DDS."""
    blob = _string(_string(_string(b"", name), request_type), reply_type)
    blob = _string(_string(blob + b"\1", request_topic) + b"\1", reply_topic)
    return _variant(kind, blob, pack(">H", parent))


def read_data(stream_id: int, samples: int, seconds: int, bytes_per_second: int, pace: int) -> bytes:
    """What follows the ids in a READ_DATA: DATA on ``stream_id``, with delivery control (DDS-XRCE 1.0, 7.8.5.4)."""
    return pack("<BBBBHHHH", stream_id, 0, 0, 1, samples, seconds, bytes_per_second, pace)


def _string(before: bytes, text: str) -> bytes:
    data = text.encode()
    return before + bytes(-len(before) & 3) + pack("<I", len(data) + 1) + data + b"\0"


def _optional(before: bytes, value: int) -> bytes:
    if not value:
        return before + b"\0"
    before += b"\1"
    return before + bytes(-len(before) & 3) + pack("<I", value)


def _variant(kind: int, blob: bytes, tail: bytes) -> bytes:
    return pack("<BBxxI", kind, _IN_BINARY, len(blob)) + blob + tail
