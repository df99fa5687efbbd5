"""Entities as values: what a client asks the agent to make, however it said so.

The binary representation, XML documents and profiles all yield these, so whoever makes entities looks at one kind of
thing only. The values are plain and frozen. Host only: boards write representations and never read them.
"""

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Final, TypeAlias


class Kind(IntEnum):
    """Object kinds (DDS-XRCE 1.0, 7.7.3): the low four bits of an ObjectId."""

    PARTICIPANT = 0x01
    TOPIC = 0x02
    PUBLISHER = 0x03
    SUBSCRIBER = 0x04
    DATAWRITER = 0x05
    DATAREADER = 0x06
    REQUESTER = 0x07
    REPLIER = 0x08
    TYPE = 0x0A
    QOSPROFILE = 0x0B
    APPLICATION = 0x0C


class Format(IntEnum):
    """How an entity is described: by the name of a profile, by an XML document, or in CDR."""

    REFERENCE = 1
    XML = 2
    BINARY = 3


class Durability(StrEnum):
    """What a writer keeps for readers that come late."""

    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"
    TRANSIENT = "transient"
    PERSISTENT = "persistent"


@dataclass(frozen=True, slots=True)
class EndpointQos:
    """Quality of service of a datawriter or datareader. None means: not stated, the middleware's default.

    Times are in milliseconds. `partitions` come only from XML (in binary they belong to the publisher or
    subscriber); `exclusive` is exclusive ownership.
    """

    reliable: bool = True
    keep_last: bool = True
    depth: int | None = None
    deadline_ms: int | None = None
    lifespan_ms: int | None = None
    durability: Durability = Durability.VOLATILE
    exclusive: bool = False
    user_data: bytes | None = None
    partitions: tuple[str, ...] = ()


WRITER_DEFAULTS: Final = EndpointQos(reliable=True)
"""What DDS gives a writer whose QoS is not stated: reliable, volatile, keep last (1)."""
READER_DEFAULTS: Final = EndpointQos(reliable=False)
"""What DDS gives a reader whose QoS is not stated: best effort, volatile, keep last (1)."""


@dataclass(frozen=True, slots=True)
class ParticipantEntity:
    """A participant; `domain` is the profile's own, None where only CREATE names one."""

    name: str | None = None
    domain_reference: str | None = None
    domain: int | None = None
    user_data: bytes | None = None


@dataclass(frozen=True, slots=True)
class TopicEntity:
    """A topic; `type_name` is None where the description names no type."""

    name: str
    type_name: str | None = None
    type_reference: str | None = None
    with_key: bool = False


@dataclass(frozen=True, slots=True)
class PublisherEntity:
    """A publisher: a group of datawriters."""

    name: str | None = None
    partitions: tuple[str, ...] = ()
    group_data: bytes | None = None


@dataclass(frozen=True, slots=True)
class SubscriberEntity:
    """A subscriber: a group of datareaders."""

    name: str | None = None
    partitions: tuple[str, ...] = ()
    group_data: bytes | None = None


@dataclass(frozen=True, slots=True)
class DataWriterEntity:
    """A datawriter. Its topic is named by `topic_id` (binary) or by `topic_name` (XML, reference).

    `topic_id` is a whole ObjectId, its kind bits set to TOPIC whatever the client wrote there.
    """

    topic_id: int | None = None
    topic_name: str | None = None
    type_name: str | None = None
    qos: EndpointQos | None = None
    ownership_strength: int | None = None

    @property
    def effective_qos(self) -> EndpointQos:
        """The QoS asked for, or the defaults of a writer."""
        return WRITER_DEFAULTS if self.qos is None else self.qos


@dataclass(frozen=True, slots=True)
class DataReaderEntity:
    """A datareader. Its topic is named as a datawriter's; `timebasedfilter_msec` is in milliseconds."""

    topic_id: int | None = None
    topic_name: str | None = None
    type_name: str | None = None
    qos: EndpointQos | None = None
    timebasedfilter_msec: int | None = None
    contentbased_filter: str | None = None

    @property
    def effective_qos(self) -> EndpointQos:
        """The QoS asked for, or the defaults of a reader."""
        return READER_DEFAULTS if self.qos is None else self.qos


@dataclass(frozen=True, slots=True)
class ServiceEntity:
    """One side of a service. Topic names that are not given follow from the service's name."""

    service_name: str
    request_type: str
    reply_type: str
    request_topic: str | None = None
    reply_topic: str | None = None

    @property
    def request_topic_name(self) -> str:
        """The topic of requests: as given, else `<service>_Request`."""
        return self.request_topic or self.service_name + "_Request"

    @property
    def reply_topic_name(self) -> str:
        """The topic of replies: as given, else `<service>_Reply`."""
        return self.reply_topic or self.service_name + "_Reply"


@dataclass(frozen=True, slots=True)
class RequesterEntity(ServiceEntity):
    """The calling side of a service."""


@dataclass(frozen=True, slots=True)
class ReplierEntity(ServiceEntity):
    """The answering side of a service."""


Entity: TypeAlias = (
    ParticipantEntity
    | TopicEntity
    | PublisherEntity
    | SubscriberEntity
    | DataWriterEntity
    | DataReaderEntity
    | RequesterEntity
    | ReplierEntity
)

KIND_OF: Final[dict[type, Kind]] = {
    ParticipantEntity: Kind.PARTICIPANT,
    TopicEntity: Kind.TOPIC,
    PublisherEntity: Kind.PUBLISHER,
    SubscriberEntity: Kind.SUBSCRIBER,
    DataWriterEntity: Kind.DATAWRITER,
    DataReaderEntity: Kind.DATAREADER,
    RequesterEntity: Kind.REQUESTER,
    ReplierEntity: Kind.REPLIER,
}
"""The object kind each entity value stands for."""

PARENT_OF: Final[dict[Kind, Kind]] = {
    Kind.TOPIC: Kind.PARTICIPANT,
    Kind.PUBLISHER: Kind.PARTICIPANT,
    Kind.SUBSCRIBER: Kind.PARTICIPANT,
    Kind.DATAWRITER: Kind.PUBLISHER,
    Kind.DATAREADER: Kind.SUBSCRIBER,
    Kind.REQUESTER: Kind.PARTICIPANT,
    Kind.REPLIER: Kind.PARTICIPANT,
}
"""The kind of object an object of a kind is made in; kinds without a line here stand alone."""


@dataclass(frozen=True, slots=True)
class Variant:
    """The ObjectVariant of a CREATE: exactly one of `entity` (BINARY) and `text` (XML, REFERENCE) is set.

    `parent_id` is a whole ObjectId with the kind bits of the parent's kind, whatever the client wrote there
    (None for participants); `domain` is set for participants only. Types, QoS profiles and applications are
    recognised (they are answered, though nothing is made): their binary form has neither entity nor text.
    """

    kind: Kind
    format: Format
    entity: Entity | None = None
    text: str | None = None
    parent_id: int | None = None
    domain: int | None = None
