"""CREATE payloads in XML and by reference, in place of the binary ones (DDS-XRCE 1.0, 7.7.3.1 and 7.7.3.2).

The functions have the names and arguments of those in ``create``. The XML is the subset of Fast DDS profiles that
agents read; a reference names a profile that the agent knows: ``chatter__t`` for a topic, ``chatter__dw`` and
``chatter__dr`` for its writer and reader.
"""

from struct import pack

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce.create import Asked

_BY_REFERENCE = const(1)
_AS_XML = const(2)
_KIND_PARTICIPANT = const(1)
_KIND_TOPIC = const(2)
_KIND_DATAWRITER = const(5)
_KIND_REQUESTER = const(7)
_QOS_RELIABLE = const(0x01)
_QOS_KEEP_LAST = const(0x02)
_QOS_TRANSIENT_LOCAL = const(0x08)
_MILLION = const(1000000)
_DURABILITIES = ("TRANSIENT_LOCAL", "TRANSIENT", "PERSISTENT")  # flags 8, 16 and 32


class Xml:
    """Writes entities as XML."""

    def of_participant(self, name: str, domain: int) -> bytes:
        """A participant with a name, in a domain."""
        text = _tag("dds", _tag("participant", _tag("rtps", _tag("name", name))))
        return participant_by_text(_AS_XML, text, domain)

    def of_topic(self, name: str, type_name: str, parent: int) -> bytes:
        """A topic of a participant."""
        text = _tag("dds", _tag("topic", _names(name, type_name)))
        return by_text(_KIND_TOPIC, _AS_XML, text, parent)

    def of_group(self, kind: int, parent: int) -> bytes:
        """A publisher or a subscriber: the defaults."""
        return by_text(kind, _AS_XML, "", parent)

    def of_endpoint(
        self, kind: int, topic_id: int, qos: "Asked", parent: int, name: str, type_name: str
    ) -> bytes:
        """A datawriter or a datareader."""
        flags, depth, deadline, lifespan = qos
        qualities = _kind("reliability", "RELIABLE" if flags & _QOS_RELIABLE else "BEST_EFFORT")
        durability = flags // _QOS_TRANSIENT_LOCAL & 7
        if durability:
            qualities += _kind("durability", _DURABILITIES[durability >> 1])
        if deadline:
            qualities += _tag("deadline", _time("period", deadline))
        if lifespan:
            qualities += _tag("lifespan", _time("duration", lifespan))
        history = _tag("kind", "KEEP_LAST" if flags & _QOS_KEEP_LAST else "KEEP_ALL")
        if flags & _QOS_KEEP_LAST and depth:
            history += _tag("depth", str(depth))
        text = (
            _tag("historyMemoryPolicy", "PREALLOCATED_WITH_REALLOC")
            + _tag("qos", qualities)
            + _tag("topic", _tag("kind", "NO_KEY") + _names(name, type_name) + _tag("historyQos", history))
        )
        text = _tag("data_writer" if kind == _KIND_DATAWRITER else "data_reader", text)
        return by_text(kind, _AS_XML, _tag("dds", text), parent)

    def of_service(
        self,
        kind: int,
        name: str,
        request_type: str,
        reply_type: str,
        request_topic: str,
        reply_topic: str,
        parent: int,
    ) -> bytes:
        """A requester or a replier."""
        tag = "requester" if kind == _KIND_REQUESTER else "replier"
        text = '<dds><%s profile_name="%d_%d" service_name="%s" request_type="%s" reply_type="%s">' % (
            tag,
            parent >> 4,
            kind,
            name,
            request_type,
            reply_type,
        )
        text += _tag("request_topic_name", request_topic) + _tag("reply_topic_name", reply_topic)
        return by_text(kind, _AS_XML, text + "</" + tag + "></dds>", parent)


class Reference(Xml):
    """Writes entities as references to profiles of the agent; services, which have none of their own, as XML."""

    def __init__(self, profile: str) -> None:
        self.profile = profile

    def of_participant(self, name: str, domain: int) -> bytes:
        """A participant by its profile."""
        return participant_by_text(_BY_REFERENCE, self.profile, domain)

    def of_topic(self, name: str, type_name: str, parent: int) -> bytes:
        """A topic by its profile, ``chatter__t``."""
        return by_text(_KIND_TOPIC, _BY_REFERENCE, _profile(name) + "__t", parent)

    def of_endpoint(
        self, kind: int, topic_id: int, qos: "Asked", parent: int, name: str, type_name: str
    ) -> bytes:
        """A datawriter or a datareader by its profile, ``chatter__dw`` or ``chatter__dr``."""
        suffix = "__dw" if kind == _KIND_DATAWRITER else "__dr"
        return by_text(kind, _BY_REFERENCE, _profile(name) + suffix, parent)


def _profile(topic_name: str) -> str:
    return topic_name[3:] if topic_name.startswith("rt/") else topic_name


def _tag(name: str, inner: str) -> str:
    return "<" + name + ">" + inner + "</" + name + ">"


def _kind(name: str, kind: str) -> str:
    return _tag(name, _tag("kind", kind))


def _time(name: str, ms: int) -> str:
    return _tag(name, _tag("sec", str(ms // 1000)) + _tag("nanosec", str(ms % 1000 * _MILLION)))


def _names(name: str, type_name: str) -> str:
    return _tag("name", name) + _tag("dataType", type_name)


def participant_by_text(form: int, text: str, domain: int) -> bytes:
    """The variant of a participant from its XML or reference (``form`` 2 or 1)."""
    variant = _text(_KIND_PARTICIPANT, form, text)
    return variant + bytes(len(variant) & 1) + pack("<h", domain)


def by_text(kind: int, form: int, text: str, parent: int) -> bytes:
    """The variant of any other object from its XML or reference (``form`` 2 or 1)."""
    return _text(kind, form, text) + pack(">H", parent)


def _text(kind: int, form: int, text: str) -> bytes:
    data = text.encode()
    return pack("<BBxxI", kind, form, len(data) + 1) + data + b"\0"
