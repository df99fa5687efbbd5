"""What a client asks the agent to make: entity representations as values, to and from the wire.

A CREATE submessage ends in an ObjectVariant (DDS-XRCE 1.0, 7.7.3): the kind of the object, the format of its
description, the description, and the object it belongs to::

    kind u8, format u8, (pad to 4), description, then
        participant:                                   (pad to 2) domain i16
        topic, publisher, subscriber, requester, replier:   ObjectId of the participant
        datawriter:                                    ObjectId of the publisher
        datareader:                                    ObjectId of the subscriber

The description is a string (a reference to a profile of the agent, or an XML document) or a sequence of
octets that holds CDR of its own, aligned from its first octet. An ObjectId is two bytes, high byte first in
every endianness, and never aligned. Alignment outside the octets counts from the start of the message, which
is index 0 of the buffer given here (any multiple of 4 will do).

The values are plain and frozen; the XML and the profiles of the agent yield the same ones, so whoever makes
entities looks at one kind of thing only. Host only: boards write these bytes themselves and never read them.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, TypeAlias, TypeVar

from muros.xrce.entities import (
    KIND_OF,
    PARENT_OF,
    READER_DEFAULTS,
    WRITER_DEFAULTS,
    DataReaderEntity,
    DataWriterEntity,
    Durability,
    EndpointQos,
    Entity,
    Format,
    Kind,
    ParticipantEntity,
    PublisherEntity,
    ReplierEntity,
    RequesterEntity,
    ServiceEntity,
    SubscriberEntity,
    TopicEntity,
    Variant,
)

__all__ = [
    "DEFAULT_LIMITS",
    "KIND_OF",
    "MAX_OCTETS",
    "MAX_PARTITIONS",
    "MAX_STRING",
    "MAX_TEXT",
    "PARENT_OF",
    "READER_DEFAULTS",
    "WRITER_DEFAULTS",
    "Buffer",
    "DataReaderEntity",
    "DataWriterEntity",
    "Durability",
    "EndpointQos",
    "Entity",
    "Format",
    "InvalidRepresentation",
    "Kind",
    "Limits",
    "ParticipantEntity",
    "PublisherEntity",
    "ReplierEntity",
    "RequesterEntity",
    "ServiceEntity",
    "SubscriberEntity",
    "TopicEntity",
    "Variant",
    "encode_binary",
    "encode_variant",
    "parse_binary_untrusted",
    "parse_variant_untrusted",
]

Buffer: TypeAlias = bytes | bytearray | memoryview

MAX_TEXT: Final = 65536
"""Longest XML document or reference taken, in bytes: nothing longer fits a submessage."""
MAX_STRING: Final = 4096
"""Longest name, type name or filter in a binary representation, in bytes without the NUL."""
MAX_OCTETS: Final = 65536
"""Longest user data or group data, in bytes."""
MAX_PARTITIONS: Final = 64
"""Most partitions of one publisher or subscriber."""


class InvalidRepresentation(ValueError):  # noqa: N818
    """The bytes or the text do not describe an entity. The message says what is wrong, in one line."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds on what foreign descriptions may hold; sizes in bytes."""

    text: int = MAX_TEXT
    string: int = MAX_STRING
    octets: int = MAX_OCTETS
    partitions: int = MAX_PARTITIONS


DEFAULT_LIMITS: Final = Limits()


def parse_variant_untrusted(
    data: Buffer, offset: int, end: int, little_endian: bool, limits: Limits = DEFAULT_LIMITS
) -> Variant:
    """Read the ObjectVariant in `data[offset:end]` (DDS-XRCE 1.0, 7.7.3).

    Bytes left over behind it are padding and are ignored. Raises InvalidRepresentation, and nothing else,
    whatever the bytes.
    """
    if not 0 <= offset <= end <= len(data):
        raise InvalidRepresentation(f"cut short: {end} bytes announced, {len(data)} there")
    reader = _Reader(data, 0, offset, end, little_endian, limits)
    kind = _known(Kind, reader.u8("object kind"), "object kind")
    format_ = _known(Format, reader.u8("representation format"), "representation format")
    entity: Entity | None = None
    text: str | None = None
    if format_ is Format.BINARY:
        size = reader.u32("binary representation")
        start = reader.skip(size, "binary representation")
        if kind in _BINARY_PARSERS:
            blob = _Reader(data, start, start, start + size, little_endian, limits)
            entity = _BINARY_PARSERS[kind](blob)
    else:
        text = reader.string("representation", limits.text)
    if kind is Kind.PARTICIPANT:
        return Variant(kind, format_, entity, text, domain=reader.i16("domain"))
    if kind in PARENT_OF:
        return Variant(kind, format_, entity, text, parent_id=reader.object_id("parent", PARENT_OF[kind]))
    return Variant(kind, format_, entity, text)


def parse_binary_untrusted(
    kind: int, blob: Buffer, little_endian: bool, limits: Limits = DEFAULT_LIMITS
) -> Entity:
    """Read the binary representation of an object of `kind`; `blob` holds nothing else.

    Raises InvalidRepresentation, and nothing else, whatever the bytes.
    """
    parser = _BINARY_PARSERS.get(_known(Kind, kind, "object kind"))
    if parser is None:
        raise InvalidRepresentation(f"{Kind(kind).name.lower()}: no binary representation is known")
    return parser(_Reader(blob, 0, 0, len(blob), little_endian, limits))


def encode_variant(variant: Variant, offset: int = 0, little_endian: bool = True) -> bytes:
    """The bytes of an ObjectVariant that stands at `offset` of its message. Padding is zero.

    Raises ValueError if a value does not fit its field, or if a needed one is missing.
    """
    writer = _Writer(offset, little_endian)
    writer.u8(variant.kind)
    writer.u8(variant.format)
    if variant.format is Format.BINARY:
        writer.octets(b"" if variant.entity is None else encode_binary(variant.entity, little_endian))
    elif variant.text is None:
        raise ValueError(f"{variant.format.name} needs a text")
    else:
        writer.string(variant.text)
    if variant.kind is Kind.PARTICIPANT:
        writer.number("h", 2, variant.domain or 0)
    elif variant.kind in PARENT_OF:
        writer.object_id(variant.parent_id)
    return bytes(writer.out)


def encode_binary(entity: Entity, little_endian: bool = True) -> bytes:
    """The binary representation of an entity, the inverse of `parse_binary_untrusted`.

    Raises ValueError if a value does not fit its field, or if binary cannot say it (a topic by name,
    partitions of an endpoint, keyed topics).
    """
    writer = _Writer(0, little_endian)
    match entity:
        case ParticipantEntity():
            _only_in_text(entity, domain=entity.domain, user_data=entity.user_data)
            writer.optional_string(entity.domain_reference)
            writer.optional_string(entity.name)
        case TopicEntity():
            _only_in_text(entity, with_key=entity.with_key or None)
            writer.string(entity.name)
            writer.optional_string(entity.type_reference)
            writer.optional_string(entity.type_name)
        case PublisherEntity() | SubscriberEntity():
            _encode_group(writer, entity)
        case DataWriterEntity() | DataReaderEntity():
            _encode_endpoint(writer, entity)
        case RequesterEntity() | ReplierEntity():
            writer.string(entity.service_name)
            writer.string(entity.request_type)
            writer.string(entity.reply_type)
            writer.optional_string(entity.request_topic)
            writer.optional_string(entity.reply_topic)
    return bytes(writer.out)


_E = TypeVar("_E", bound=IntEnum)

# Bits of qos_flags (DDS-XRCE 1.0, 7.7.3.7). None of the three durability bits means volatile.
_RELIABLE = 0x01
_KEEP_LAST = 0x02
_EXCLUSIVE = 0x04
_DURABILITY_BITS = (
    (0x20, Durability.PERSISTENT),
    (0x10, Durability.TRANSIENT),
    (0x08, Durability.TRANSIENT_LOCAL),
)


class _Reader:
    """A bounded look at CDR; alignment counts from `base`. Every check comes before the slice it guards,
    because a slice past the end would be short without a word."""

    __slots__ = ("_base", "_data", "_end", "_limits", "_order", "_pos")

    def __init__(
        self, data: Buffer, base: int, pos: int, end: int, little_endian: bool, limits: Limits
    ) -> None:
        self._data = data
        self._base = base
        self._pos = pos
        self._end = end
        self._order = "<" if little_endian else ">"
        self._limits = limits

    def skip(self, size: int, what: str) -> int:
        """Step over `size` bytes; where they start."""
        start = self._pos
        if size > self._end - start:
            raise InvalidRepresentation(
                f"{what}: cut short, {size} bytes needed, {max(0, self._end - start)} there"
            )
        self._pos = start + size
        return start

    def _number(self, code: str, size: int, what: str) -> int:
        self._pos += (self._base - self._pos) % size
        value: int = struct.unpack_from(self._order + code, self._data, self.skip(size, what))[0]
        return value

    def u8(self, what: str) -> int:
        return self._data[self.skip(1, what)]

    def u16(self, what: str) -> int:
        return self._number("H", 2, what)

    def i16(self, what: str) -> int:
        return self._number("h", 2, what)

    def u32(self, what: str) -> int:
        return self._number("I", 4, what)

    def present(self, what: str) -> bool:
        """The flag in front of an optional value."""
        flag = self.u8(what)
        if flag > 1:
            raise InvalidRepresentation(f"{what}: {flag} is no boolean")
        return flag == 1

    def object_id(self, what: str, kind: Kind) -> int:
        start = self.skip(2, what)
        return (self._data[start] << 8 | self._data[start + 1] & 0xF0) | kind

    def string(self, what: str, limit: int | None = None) -> str:
        """A CDR string. One without its NUL, or of length 0, is taken as the reference agent takes it."""
        size = self.u32(what)
        raw = bytes(self._data[(start := self.skip(size, what)) : start + size]).removesuffix(b"\0")
        limit = self._limits.string if limit is None else limit
        if len(raw) > limit:
            raise InvalidRepresentation(f"{what}: {len(raw)} bytes, at most {limit} are taken")
        if b"\0" in raw:
            raise InvalidRepresentation(f"{what}: a NUL in the middle of the text")
        try:
            return raw.decode()
        except UnicodeDecodeError as error:
            raise InvalidRepresentation(f"{what}: not UTF-8 (byte {error.start})") from None

    def octets(self, what: str) -> bytes:
        size = self.u32(what)
        start = self.skip(size, what)
        if size > self._limits.octets:
            raise InvalidRepresentation(f"{what}: {size} bytes, at most {self._limits.octets} are taken")
        return bytes(self._data[start : start + size])

    def strings(self, what: str) -> tuple[str, ...]:
        count = self.u32(what)
        if count > self._limits.partitions:
            raise InvalidRepresentation(
                f"{what}: {count} of them, at most {self._limits.partitions} are taken"
            )
        return tuple(self.string(what) for _ in range(count))

    def optional_string(self, what: str) -> str | None:
        return self.string(what) if self.present(what) else None

    def optional_octets(self, what: str) -> bytes | None:
        return self.octets(what) if self.present(what) else None

    def optional_u32(self, what: str) -> int | None:
        return self.u32(what) if self.present(what) else None


def _parse_participant(reader: _Reader) -> ParticipantEntity:
    domain_reference = reader.optional_string("domain reference")
    return ParticipantEntity(reader.optional_string("participant name"), domain_reference)


def _parse_topic(reader: _Reader) -> TopicEntity:
    name = reader.string("topic name")
    type_reference = reader.optional_string("type reference")
    return TopicEntity(name, reader.optional_string("type name"), type_reference)


def _parse_group(reader: _Reader) -> tuple[str | None, tuple[str, ...], bytes | None]:
    name = reader.optional_string("name")
    if not reader.present("qos"):
        return name, (), None
    partitions = reader.strings("partitions") if reader.present("partitions") else ()
    return name, partitions, reader.optional_octets("group data")


def _parse_publisher(reader: _Reader) -> PublisherEntity:
    return PublisherEntity(*_parse_group(reader))


def _parse_subscriber(reader: _Reader) -> SubscriberEntity:
    return SubscriberEntity(*_parse_group(reader))


def _parse_qos(reader: _Reader) -> EndpointQos:
    flags = reader.u16("qos flags")
    durability = next((value for bit, value in _DURABILITY_BITS if flags & bit), Durability.VOLATILE)
    return EndpointQos(
        reliable=bool(flags & _RELIABLE),
        keep_last=bool(flags & _KEEP_LAST),
        exclusive=bool(flags & _EXCLUSIVE),
        durability=durability,
        depth=reader.u16("history depth") if reader.present("history depth") else None,
        deadline_ms=reader.optional_u32("deadline"),
        lifespan_ms=reader.optional_u32("lifespan"),
        user_data=reader.optional_octets("user data"),
    )


def _parse_datawriter(reader: _Reader) -> DataWriterEntity:
    topic_id = reader.object_id("topic id", Kind.TOPIC)
    if not reader.present("qos"):
        return DataWriterEntity(topic_id)
    qos = _parse_qos(reader)
    return DataWriterEntity(topic_id, qos=qos, ownership_strength=reader.optional_u32("ownership strength"))


def _parse_datareader(reader: _Reader) -> DataReaderEntity:
    topic_id = reader.object_id("topic id", Kind.TOPIC)
    if not reader.present("qos"):
        return DataReaderEntity(topic_id)
    return DataReaderEntity(
        topic_id,
        qos=_parse_qos(reader),
        timebasedfilter_msec=reader.optional_u32("time based filter"),
        contentbased_filter=reader.optional_string("content based filter"),
    )


def _parse_service(reader: _Reader) -> tuple[str, str, str, str | None, str | None]:
    return (
        reader.string("service name"),
        reader.string("request type"),
        reader.string("reply type"),
        reader.optional_string("request topic name"),
        reader.optional_string("reply topic name"),
    )


def _parse_requester(reader: _Reader) -> RequesterEntity:
    return RequesterEntity(*_parse_service(reader))


def _parse_replier(reader: _Reader) -> ReplierEntity:
    return ReplierEntity(*_parse_service(reader))


_BINARY_PARSERS: Final[dict[Kind, Callable[[_Reader], Entity]]] = {
    Kind.PARTICIPANT: _parse_participant,
    Kind.TOPIC: _parse_topic,
    Kind.PUBLISHER: _parse_publisher,
    Kind.SUBSCRIBER: _parse_subscriber,
    Kind.DATAWRITER: _parse_datawriter,
    Kind.DATAREADER: _parse_datareader,
    Kind.REQUESTER: _parse_requester,
    Kind.REPLIER: _parse_replier,
}


class _Writer:
    """CDR into a growing buffer whose first byte stands at `offset` of what alignment counts from."""

    __slots__ = ("_offset", "_order", "out")

    def __init__(self, offset: int, little_endian: bool) -> None:
        self.out = bytearray()
        self._offset = offset
        self._order = "<" if little_endian else ">"

    def number(self, code: str, size: int, value: int) -> None:
        self.out += bytes(-(self._offset + len(self.out)) % size)
        try:
            self.out += struct.pack(self._order + code, value)
        except struct.error as error:
            raise ValueError(f"{value} does not fit {size} bytes: {error}") from None

    def u8(self, value: int) -> None:
        self.number("B", 1, value)

    def object_id(self, value: int | None) -> None:
        if value is None or not 0 <= value <= 0xFFFF:
            raise ValueError(f"an object id is needed, not {value!r}")
        self.out += value.to_bytes(2, "big")

    def octets(self, value: bytes) -> None:
        self.number("I", 4, len(value))
        self.out += value

    def string(self, value: str) -> None:
        if "\0" in value:
            raise ValueError("a NUL cannot stand in a string")
        self.octets(value.encode() + b"\0")

    def optional_string(self, value: str | None) -> None:
        self.u8(value is not None)
        if value is not None:
            self.string(value)

    def optional_octets(self, value: bytes | None) -> None:
        self.u8(value is not None)
        if value is not None:
            self.octets(value)

    def optional_number(self, code: str, size: int, value: int | None) -> None:
        self.u8(value is not None)
        if value is not None:
            self.number(code, size, value)


def _encode_group(writer: _Writer, entity: PublisherEntity | SubscriberEntity) -> None:
    writer.optional_string(entity.name)
    has_qos = bool(entity.partitions) or entity.group_data is not None
    writer.u8(has_qos)
    if has_qos:
        writer.u8(bool(entity.partitions))
        if entity.partitions:
            writer.number("I", 4, len(entity.partitions))
            for partition in entity.partitions:
                writer.string(partition)
        writer.optional_octets(entity.group_data)


def _encode_endpoint(writer: _Writer, entity: DataWriterEntity | DataReaderEntity) -> None:
    qos = entity.qos
    _only_in_text(entity, topic_name=entity.topic_name, type_name=entity.type_name)
    writer.object_id(entity.topic_id)
    writer.u8(qos is not None)
    if qos is None:
        return
    _only_in_text(entity, partitions=qos.partitions or None)
    flags = _RELIABLE * qos.reliable | _KEEP_LAST * qos.keep_last | _EXCLUSIVE * qos.exclusive
    flags |= next((bit for bit, value in _DURABILITY_BITS if value is qos.durability), 0)
    writer.number("H", 2, flags)
    writer.optional_number("H", 2, qos.depth)
    writer.optional_number("I", 4, qos.deadline_ms)
    writer.optional_number("I", 4, qos.lifespan_ms)
    writer.optional_octets(qos.user_data)
    if isinstance(entity, DataWriterEntity):
        writer.optional_number("I", 4, entity.ownership_strength)
    else:
        writer.optional_number("I", 4, entity.timebasedfilter_msec)
        writer.optional_string(entity.contentbased_filter)


def _only_in_text(entity: Entity, **fields: object) -> None:
    for name, value in fields.items():
        if value is not None:
            raise ValueError(f"{KIND_OF[type(entity)].name.lower()}: binary cannot say {name}")


def _known(enum: type[_E], value: int, what: str) -> _E:
    try:
        return enum(value)
    except ValueError:
        raise InvalidRepresentation(f"{what} 0x{value:02X} is not known") from None
