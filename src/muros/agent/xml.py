"""XML descriptions of entities: the documents clients send, and the files of profiles.

Both are the profile subset of Fast DDS. A client sends one entity rooted at ``<dds>``; a profiles file holds many
in ``<profiles>``, each with a ``profile_name``. Elements may come in any order and at most once; an element that
is not known refuses the document, with the reason. What Fast DDS knows but has no meaning here (sockets, memory,
threads) is passed over and named in `Description.ignored`, so that nobody believes it took effect.

The text is foreign. A document type declaration is refused before anything in it is read, so entities can neither
expand nor fetch; size and depth are bounded; every function here raises XmlError and nothing else.

Clients built on Micro XRCE-DDS write requesters and repliers without blanks between the attributes
(``profile_name="r"service_name="s"``), which is not well-formed; they are everywhere, so that text is repaired.
"""

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import Final, NoReturn, TypeVar
from xml.parsers import expat

from muros.xrce.representation import (
    READER_DEFAULTS,
    WRITER_DEFAULTS,
    DataReaderEntity,
    DataWriterEntity,
    Durability,
    EndpointQos,
    Entity,
    InvalidRepresentation,
    Kind,
    ParticipantEntity,
    PublisherEntity,
    ReplierEntity,
    RequesterEntity,
    SubscriberEntity,
    TopicEntity,
)

MAX_DOCUMENT: Final = 65536
"""Longest document of a client, in bytes: nothing longer fits a submessage."""
MAX_PROFILES: Final = 4 * 1024 * 1024
"""Longest profiles file, in bytes."""
MAX_DEPTH: Final = 32
"""Deepest nesting of elements; the deepest known one stands at 8."""


class XmlError(InvalidRepresentation):
    """The text does not describe an entity. The message is one line; `line` counts from 1 (0: the whole text)."""

    def __init__(self, reason: str, line: int = 0) -> None:
        super().__init__(reason)
        self.line = line


@dataclass(frozen=True, slots=True)
class Description:
    """One entity as XML describes it: its `profile_name` or None, the line it starts on, what was passed over."""

    kind: Kind
    entity: Entity
    name: str | None
    line: int
    ignored: tuple[str, ...] = ()


def parse_document_untrusted(kind: int, text: str, max_bytes: int = MAX_DOCUMENT) -> Description:
    """Read the document a client sent for an object of `kind`.

    The empty text describes publishers and subscribers with nothing special about them. Raises XmlError.
    """
    if kind not in _ENTITIES:
        raise XmlError(f"object kind 0x{kind:02X} cannot be described in XML")
    if not text.strip():
        if kind == Kind.PUBLISHER:
            return Description(Kind.PUBLISHER, PublisherEntity(), None, 1)
        if kind == Kind.SUBSCRIBER:
            return Description(Kind.SUBSCRIBER, SubscriberEntity(), None, 1)
        raise XmlError(f"empty document for a {Kind(kind).name.lower()}")
    try:
        data = text.strip().encode()
    except UnicodeEncodeError:
        raise XmlError("the text is not Unicode") from None
    names = _ENTITIES[Kind(kind)].names
    root = _tree_untrusted(data, max_bytes, "UTF-8")
    found = [node for node in _profile_nodes(root) if node.tag not in _PASSED_PROFILES]
    if len(found) != 1:
        raise XmlError(f"{len(found)} entities in the document, one is wanted")
    if found[0].tag not in names:
        raise XmlError(f"the document describes a <{_shown(found[0].tag)}>, the object is a {names[0]}")
    return _describe(Kind(kind), found[0])


def parse_profiles_untrusted(data: bytes, max_bytes: int = MAX_PROFILES) -> tuple[Description, ...]:
    """Read a file of profiles, rooted at ``<profiles>`` or ``<dds>``; every one needs its `profile_name`.

    As in Fast DDS, ``<publisher>`` and ``<subscriber>`` are old names of datawriters and datareaders here.
    Raises XmlError.
    """
    descriptions: dict[tuple[Kind, str], Description] = {}
    for node in _profile_nodes(_tree_untrusted(data, max_bytes)):
        if node.tag in _PASSED_PROFILES:
            continue
        kind = _PROFILE_KINDS.get(node.tag)
        if kind is None:
            _refuse(node, f"unknown profile <{_shown(node.tag)}>", _PROFILE_KINDS)
        description = _describe(kind, node)
        if not description.name:
            _refuse(node, f"<{node.tag}> has no profile_name: nothing could refer to it")
        first = descriptions.setdefault((kind, description.name), description)
        if first is not description:
            _refuse(node, f"{node.tag} {_shown(description.name)!r} is there already, on line {first.line}")
    return tuple(descriptions.values())


_T = TypeVar("_T")


class _Node:
    """One element."""

    __slots__ = ("attributes", "children", "line", "parts", "tag")

    def __init__(self, tag: str, attributes: dict[str, str], line: int) -> None:
        self.tag = tag
        self.attributes = attributes
        self.line = line
        self.children: list[_Node] = []
        self.parts: list[str] = []

    @property
    def text(self) -> str:
        return "".join(self.parts).strip()


def _tree_untrusted(data: bytes, max_bytes: int, encoding: str | None = None) -> _Node:
    if len(data) > max_bytes:
        raise XmlError(f"{len(data)} bytes of XML, at most {max_bytes} are taken")
    try:
        return _parse(data, encoding)
    except XmlError:
        raise
    except (expat.ExpatError, LookupError, ValueError) as error:
        repaired = _repair(data)
        if repaired != data:
            try:
                return _parse(repaired, encoding)
            except XmlError:
                raise
            except (expat.ExpatError, LookupError, ValueError):
                pass
        line = getattr(error, "lineno", 1)
        why = expat.ErrorString(error.code) if isinstance(error, expat.ExpatError) else str(error)
        raise XmlError(f"not well-formed: {_shown(why)}", line) from None


def _parse(data: bytes, encoding: str | None) -> _Node:
    """The root element; `encoding` overrides what the text says of itself."""
    top = _Node("", {}, 1)
    stack = [top]
    parser = expat.ParserCreate(encoding)
    parser.buffer_text = True

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(stack) > MAX_DEPTH:
            raise XmlError(f"elements nested more than {MAX_DEPTH} deep", parser.CurrentLineNumber)
        node = _Node(tag, attributes, parser.CurrentLineNumber)
        stack[-1].children.append(node)
        stack.append(node)

    def end(_tag: str) -> None:
        stack.pop()

    def characters(text: str) -> None:
        stack[-1].parts.append(text)

    def doctype(*_ignored: object) -> NoReturn:
        raise XmlError("a document type declaration (<!DOCTYPE>) is not allowed", parser.CurrentLineNumber)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = characters
    parser.StartDoctypeDeclHandler = doctype
    parser.Parse(data, True)
    return top.children[0]


_TAG = re.compile(rb"""<[A-Za-z][^\s<>"'/=]*(?:\s*[^\s<>"'/=]+\s*=\s*(?:"[^"<]*"|'[^'<]*'))*""")
_VALUE = re.compile(rb"""("[^"<]*"|'[^'<]*')(?=([^\s/>?])?)""")


def _repair(data: bytes) -> bytes:
    """The text with a blank behind every attribute that is followed by another one at once."""
    return _TAG.sub(lambda tag: _VALUE.sub(_spaced, tag[0]), data)


def _spaced(value: re.Match[bytes]) -> bytes:
    return value[1] + b" " if value[2] else value[1]


def _profile_nodes(root: _Node) -> Iterator[_Node]:
    """The entities of a document: children of <dds>, of <profiles>, or of <profiles> in <dds>."""
    if root.tag not in ("dds", "profiles"):
        _refuse(root, f"the document is rooted at <{_shown(root.tag)}>", ("dds", "profiles"))
    _no_text(root)
    for node in root.children:
        if node.tag == "profiles" and root.tag == "dds":
            _no_text(node)
            yield from node.children
        else:
            yield node


@dataclass(slots=True)
class _Reading:
    """One entity being read: collects what was passed over."""

    ignored: dict[str, None] = field(default_factory=dict)

    def children(self, node: _Node, known: Collection[str], passed: Collection[str] = ()) -> dict[str, _Node]:
        """The known children of `node` by tag. Unknown ones and doubles refuse the document."""
        _no_text(node)
        found: dict[str, _Node] = {}
        for child in node.children:
            if child.tag in known:
                if found.setdefault(child.tag, child) is not child:
                    _refuse(child, f"<{child.tag}> stands twice in <{node.tag}>")
            elif child.tag in passed:
                self.ignored[f"{node.tag}/{child.tag}"] = None
            else:
                _refuse(child, f"unknown element <{_shown(child.tag)}> in <{node.tag}>", known)
        return found


def _describe(kind: Kind, node: _Node) -> Description:
    reading = _Reading()
    entity = _ENTITIES[kind].read(reading, node)
    return Description(kind, entity, node.attributes.get("profile_name"), node.line, tuple(reading.ignored))


def _participant(reading: _Reading, node: _Node) -> ParticipantEntity:
    parts = reading.children(node, ("rtps", "domainId"))
    domain = _optional_number(parts, "domainId")
    if "rtps" not in parts:
        return ParticipantEntity(domain=domain)
    rtps = reading.children(parts["rtps"], ("name", "userData", "builtin"), _PASSED_RTPS)
    if "builtin" in rtps:
        # Old profiles name the domain here; the rest is discovery, which is not the client's business.
        for child in rtps["builtin"].children:
            if child.tag == "domainId" and domain is None:
                domain = _number(child)
            elif child.tag != "domainId":
                reading.ignored[f"builtin/{_shown(child.tag)}"] = None
    name = _text(rtps["name"]) if "name" in rtps else None
    return ParticipantEntity(name, domain=domain, user_data=_octets(reading, rtps.get("userData")))


def _topic(reading: _Reading, node: _Node) -> tuple[TopicEntity, bool, int | None]:
    """A topic, whether it keeps the last samples only, and how many."""
    parts = reading.children(node, ("kind", "name", "dataType", "historyQos"), ("resourceLimitsQos",))
    if "name" not in parts:
        _refuse(node, "the <topic> has no <name>")
    with_key = _choice(parts["kind"], _KEYED) if "kind" in parts else False
    type_name = _text(parts["dataType"]) if "dataType" in parts else None
    entity = TopicEntity(_text(parts["name"]), type_name, with_key=with_key)
    if "historyQos" not in parts:
        return entity, True, None
    history = reading.children(parts["historyQos"], ("kind", "depth"))
    keep_last = _choice(history["kind"], _KEEP_LAST) if "kind" in history else True
    return entity, keep_last, _optional_number(history, "depth")


def _topic_alone(reading: _Reading, node: _Node) -> TopicEntity:
    return _topic(reading, node)[0]


def _qos(
    reading: _Reading, parts: dict[str, _Node], keep_last: bool, depth: int | None, defaults: EndpointQos
) -> EndpointQos:
    """The QoS of an endpoint; `parts` are the children of its <qos>."""

    def inner(name: str, *known: str, passed: Collection[str] = ()) -> dict[str, _Node]:
        return reading.children(parts[name], known, passed) if name in parts else {}

    reliability = inner("reliability", "kind", passed=("max_blocking_time",))
    durability = inner("durability", "kind")
    ownership = inner("ownership", "kind")
    partitions: tuple[str, ...] = ()
    if names := inner("partition", "names"):
        _no_text(names["names"])
        for child in names["names"].children:
            if child.tag != "name":
                _refuse(child, f"unknown element <{_shown(child.tag)}> in <names>", ("name",))
        partitions = tuple(_text(child) for child in names["names"].children)
    return EndpointQos(
        reliable=_choice(reliability["kind"], _RELIABLE) if "kind" in reliability else defaults.reliable,
        durability=_choice(durability["kind"], _DURABILITY) if "kind" in durability else defaults.durability,
        exclusive=_choice(ownership["kind"], _EXCLUSIVE) if "kind" in ownership else False,
        keep_last=keep_last,
        depth=depth,
        deadline_ms=_duration(reading, inner("deadline", "period").get("period")),
        lifespan_ms=_duration(reading, inner("lifespan", "duration").get("duration")),
        user_data=_octets(reading, parts.get("userData")),
        partitions=partitions,
    )


def _datawriter(reading: _Reading, node: _Node) -> DataWriterEntity:
    parts = reading.children(node, ("topic", "qos"), _PASSED_ENDPOINT)
    if "topic" not in parts:
        _refuse(node, f"the <{node.tag}> has no <topic>")
    topic, keep_last, depth = _topic(reading, parts["topic"])
    known = (*_ENDPOINT_QOS, "ownershipStrength")
    asked = reading.children(parts["qos"], known, _PASSED_QOS) if "qos" in parts else {}
    strength = None
    if "ownershipStrength" in asked:
        strength = _optional_number(reading.children(asked["ownershipStrength"], ("value",)), "value")
    qos = _qos(reading, asked, keep_last, depth, WRITER_DEFAULTS)
    return DataWriterEntity(
        topic_name=topic.name, type_name=topic.type_name, qos=qos, ownership_strength=strength
    )


def _datareader(reading: _Reading, node: _Node) -> DataReaderEntity:
    parts = reading.children(node, ("topic", "qos"), _PASSED_ENDPOINT)
    if "topic" not in parts:
        _refuse(node, f"the <{node.tag}> has no <topic>")
    topic, keep_last, depth = _topic(reading, parts["topic"])
    known = (*_ENDPOINT_QOS, "timeBasedFilter")
    asked = reading.children(parts["qos"], known, _PASSED_QOS) if "qos" in parts else {}
    separation = None
    if "timeBasedFilter" in asked:
        within = reading.children(asked["timeBasedFilter"], ("minimum_separation",))
        separation = _duration(reading, within.get("minimum_separation"))
    qos = _qos(reading, asked, keep_last, depth, READER_DEFAULTS)
    return DataReaderEntity(
        topic_name=topic.name, type_name=topic.type_name, qos=qos, timebasedfilter_msec=separation
    )


def _group(reading: _Reading, node: _Node) -> tuple[str | None, tuple[str, ...]]:
    parts = reading.children(node, ("name", "qos"))
    asked = reading.children(parts["qos"], ("partition",), ("groupData",)) if "qos" in parts else {}
    name = _text(parts["name"]) if "name" in parts else node.attributes.get("name")
    return name, _qos(reading, asked, True, None, WRITER_DEFAULTS).partitions


def _publisher(reading: _Reading, node: _Node) -> PublisherEntity:
    return PublisherEntity(*_group(reading, node))


def _subscriber(reading: _Reading, node: _Node) -> SubscriberEntity:
    return SubscriberEntity(*_group(reading, node))


def _service(reading: _Reading, node: _Node) -> tuple[str, str, str, str | None, str | None]:
    topics = ("request_topic_name", "reply_topic_name")
    parts = reading.children(node, topics, ("publisher", "subscriber", "data_writer", "data_reader"))
    for name in ("service_name", "request_type", "reply_type"):
        if not node.attributes.get(name):
            _refuse(node, f'the <{node.tag}> has no {name}="..."')
    request, reply = (_text(parts[name]) if name in parts else None for name in topics)
    attributes = node.attributes
    return attributes["service_name"], attributes["request_type"], attributes["reply_type"], request, reply


def _requester(reading: _Reading, node: _Node) -> RequesterEntity:
    return RequesterEntity(*_service(reading, node))


def _replier(reading: _Reading, node: _Node) -> ReplierEntity:
    return ReplierEntity(*_service(reading, node))


@dataclass(frozen=True, slots=True)
class _Element:
    """How the entity of a kind is written: the tags of its element, the usual one first, and its reader."""

    names: tuple[str, ...]
    read: Callable[[_Reading, _Node], Entity]


_ENTITIES: Final = {
    Kind.PARTICIPANT: _Element(("participant",), _participant),
    Kind.TOPIC: _Element(("topic",), _topic_alone),
    Kind.PUBLISHER: _Element(("publisher",), _publisher),
    Kind.SUBSCRIBER: _Element(("subscriber",), _subscriber),
    Kind.DATAWRITER: _Element(("data_writer", "publisher"), _datawriter),
    Kind.DATAREADER: _Element(("data_reader", "subscriber"), _datareader),
    Kind.REQUESTER: _Element(("requester",), _requester),
    Kind.REPLIER: _Element(("replier",), _replier),
}
_PROFILE_KINDS: Final = {
    "participant": Kind.PARTICIPANT,
    "topic": Kind.TOPIC,
    "data_writer": Kind.DATAWRITER,
    "publisher": Kind.DATAWRITER,
    "data_reader": Kind.DATAREADER,
    "subscriber": Kind.DATAREADER,
    "requester": Kind.REQUESTER,
    "replier": Kind.REPLIER,
}
_KEYED: Final = {"NO_KEY": False, "WITH_KEY": True}
_KEEP_LAST: Final = {"KEEP_LAST": True, "KEEP_ALL": False}
_RELIABLE: Final = {"RELIABLE": True, "BEST_EFFORT": False}
_EXCLUSIVE: Final = {"SHARED": False, "EXCLUSIVE": True}
_DURABILITY: Final = {value.name: value for value in Durability}
_INFINITE: Final = frozenset(
    {"DURATION_INFINITY", "DURATION_INFINITE_SEC", "DURATION_INFINITE_NSEC", "INFINITE"}
)


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_ENDPOINT_QOS: Final = (
    "reliability",
    "durability",
    "deadline",
    "lifespan",
    "ownership",
    "partition",
    "userData",
)
# Elements of Fast DDS profiles that have no meaning here, by where they stand.
_PASSED_PROFILES: Final = frozenset(
    {"domainparticipant_factory", "library_settings", "log", "transport_descriptors", "types"}
)
_PASSED_RTPS: Final = _words(
    """allocation builtinTransports builtin_controllers_sender_thread builtin_transports_reception_threads
    defaultMulticastLocatorList defaultUnicastLocatorList default_external_unicast_locators
    discovery_server_thread easy_mode_ip flow_controller_descriptor_list ignore_non_matching_locators
    listenSocketBufferSize netmask_filter participantID port prefix propertiesPolicy security_log_thread
    sendSocketBufferSize throughputController timed_events_thread typelookup_service_thread
    useBuiltinTransports userTransports"""
)
_PASSED_ENDPOINT: Final = _words(
    """entityID expectsInlineQos expects_inline_qos external_unicast_locators historyMemoryPolicy
    ignore_non_matching_locators matchedPublishersAllocation matchedSubscribersAllocation
    multicastLocatorList propertiesPolicy throughputController times unicastLocatorList
    userDefinedID"""
)
_PASSED_QOS: Final = _words(
    """data_sharing destinationOrder disablePositiveAcks disable_heartbeat_piggyback durabilityService
    groupData latencyBudget liveliness presentation publishMode readerDataLifecycle representation
    resourceLimits topicData transportPriority typeConsistency writerDataLifecycle"""
)


def _text(node: _Node) -> str:
    """The text of an element that holds nothing else, not empty."""
    if node.children:
        _refuse(node.children[0], f"unknown element <{_shown(node.children[0].tag)}> in <{node.tag}>")
    if not node.text:
        _refuse(node, f"<{node.tag}> is empty")
    return node.text


def _number(node: _Node) -> int:
    text = _text(node)
    if not (text.isascii() and text.isdigit() and len(text) <= 10 and int(text) <= 0xFFFFFFFF):
        _refuse(node, f"<{node.tag}> is {_shown(text)!r}, not a number from 0 to 4294967295")
    return int(text)


def _optional_number(parts: dict[str, _Node], name: str) -> int | None:
    return _number(parts[name]) if name in parts else None


def _choice(node: _Node, choices: dict[str, _T]) -> _T:
    text = _text(node)
    if text not in choices:
        _refuse(node, f"<{node.tag}> is {_shown(text)!r}", choices)
    return choices[text]


def _duration(reading: _Reading, node: _Node | None) -> int | None:
    """A duration in milliseconds; None for infinite and for one that is not there."""
    if node is None or (not node.children and node.text in _INFINITE):
        return None
    parts = reading.children(node, ("sec", "nanosec"))
    if any(part.text in _INFINITE for part in parts.values()):
        return None
    seconds = _optional_number(parts, "sec") or 0
    return seconds * 1000 + (_optional_number(parts, "nanosec") or 0) // 1_000_000


def _octets(reading: _Reading, node: _Node | None) -> bytes | None:
    """Octets in hexadecimal with dots between them, as Fast DDS writes user data."""
    if node is None:
        return None
    value = reading.children(node, ("value",)).get("value")
    if value is None or not value.text:
        return b""
    parts = value.text.split(".")
    if not all(re.fullmatch("[0-9A-Fa-f]{1,2}", part) for part in parts):
        _refuse(value, f"<value> is {_shown(value.text)!r}, not octets like 4a.0.ff")
    return bytes(int(part, 16) for part in parts)


def _no_text(node: _Node) -> None:
    if node.text:
        _refuse(node, f"text {_shown(node.text)!r} between the elements of <{_shown(node.tag)}>")


def _shown(text: str, width: int = 40) -> str:
    """Foreign text fit for one line of a message."""
    shown = "".join(c if c.isprintable() else "?" for c in text[:width])
    return shown if len(text) <= width else shown + "..."


def _refuse(node: _Node, reason: str, known: Collection[str] = ()) -> NoReturn:
    if known:
        reason += f"; known here: {', '.join(known)}"
    raise XmlError(reason, node.line)
