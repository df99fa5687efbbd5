"""CREATE and READ_DATA payloads as a client writes them, in the binary representation (DDS-XRCE 1.0, 7.7.3).

Functions return the ObjectVariant of something, the payload of its CREATE behind the request id and the object id.
Ids are integers: ``index << 4 | kind``. Padding is zero. The XML and reference formats are in ``create_text``.
"""

from struct import pack

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import TypeAlias

    Asked: TypeAlias = tuple[int, int, int, int]
    """What a writer or a reader asks of the agent's middleware: flags, depth, deadline and lifespan in ms."""


_IN_BINARY = const(3)
_KIND_PARTICIPANT = const(1)
_KIND_TOPIC = const(2)
_KIND_DATAWRITER = const(5)


def of_participant(name: str, domain: int) -> bytes:
    """A participant with a name, in a domain."""
    return _variant(_KIND_PARTICIPANT, domain, b"\0\1", name)


def of_topic(name: str, type_name: str, parent: int) -> bytes:
    """A topic of a participant, by its names in DDS (``rt/chatter``, ``std_msgs::msg::dds_::String_``)."""
    return _variant(_KIND_TOPIC, parent, name, b"\0\1", type_name)


def of_group(kind: int, parent: int) -> bytes:
    """A publisher or a subscriber (``kind`` 3 or 4) of a participant."""
    return _variant(kind, parent, b"\0\0")


def of_endpoint(
    kind: int, topic_id: int, qos: "Asked", parent: int, name: str = "", type_name: str = ""
) -> bytes:
    """A datawriter or a datareader (``kind`` 5 or 6) of a publisher or subscriber.

    A depth, a deadline or a lifespan (both in ms) of 0 is left to the agent. The names of the topic are needed by
    the other formats only.
    """
    flags, depth, deadline, lifespan = qos
    blob = pack(">H", topic_id) + pack("<BxH", 1, flags)
    blob += pack("<BxH", 1, depth) if depth else b"\0"
    for time in (deadline, lifespan):
        blob += b"\1" + bytes(~len(blob) & 3) + pack("<I", time) if time else b"\0"
    return _variant(kind, parent, blob, bytes(2 if kind == _KIND_DATAWRITER else 3))


def of_service(
    kind: int,
    name: str,
    request_type: str,
    reply_type: str,
    request_topic: str,
    reply_topic: str,
    parent: int,
) -> bytes:
    """A requester or a replier (``kind`` 7 or 8) of a participant, by the names of its types and topics in DDS."""
    return _variant(kind, parent, name, request_type, reply_type, b"\1", request_topic, b"\1", reply_topic)


def read_data(stream_id: int, samples: int, seconds: int, bytes_per_second: int, pace: int) -> bytes:
    """What follows the ids in a READ_DATA: DATA on ``stream_id``, with delivery control (DDS-XRCE 1.0, 7.8.5.4)."""
    return pack("<BxxBHHHH", stream_id, 1, samples, seconds, bytes_per_second, pace)


def _variant(kind: int, parent: int, *parts: "str | bytes") -> bytes:
    """A representation that consists of bytes and of strings; for a participant its domain stands for the parent."""
    blob = b""
    for part in parts:
        if isinstance(part, str):
            part = part.encode() + b"\0"
            blob += bytes(-len(blob) & 3) + pack("<I", len(part))
        blob += part
    end = bytes(len(blob) & 1) + pack("<h", parent) if kind == _KIND_PARTICIPANT else pack(">H", parent)
    return pack("<BBxxI", kind, _IN_BINARY, len(blob)) + blob + end
