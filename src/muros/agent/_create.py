"""From what a client describes to a proxy in the data space: parents, topics and QoS are resolved here."""

from muros.agent._events_proxy import TOPIC as EVENTS
from muros.agent._events_proxy import EventsProxy, subject
from muros.agent._graph_proxy import TOPIC as GRAPH
from muros.agent._graph_proxy import GraphProxy
from muros.agent._limits import Limits
from muros.agent._proxies import (
    GroupProxy,
    ParticipantProxy,
    Proxy,
    ReaderProxy,
    ReplierProxy,
    RequesterProxy,
    TopicProxy,
    WriterProxy,
)
from muros.agent.profiles import References, UnknownReference
from muros.agent.xml import parse_document_untrusted
from muros.space import Durability as SpaceDurability
from muros.space import History, Ownership, Qos, Reliability, Service, Space, SpaceError, Topic
from muros.xrce.constants import (
    STATUS_ERR_DDS_ERROR,
    STATUS_ERR_INVALID_DATA,
    STATUS_ERR_UNKNOWN_REFERENCE,
)
from muros.xrce.representation import (
    DataReaderEntity,
    DataWriterEntity,
    Durability,
    Entity,
    Format,
    InvalidRepresentation,
    Kind,
    ParticipantEntity,
    PublisherEntity,
    ReplierEntity,
    RequesterEntity,
    SubscriberEntity,
    TopicEntity,
    Variant,
)

__all__ = ["DEFAULT_PARTICIPANT", "Refused", "build", "resolve", "same"]

DEFAULT_PARTICIPANT = "MicroXRCEParticipant"
"""Name of a participant whose description gives none; it is no node."""
PROFILE_DOMAIN = 255
"""The domain id with which a client leaves the choice to the profile or to the agent."""
_MS = 1_000_000

_DURABILITY = {
    Durability.VOLATILE: SpaceDurability.VOLATILE,
    Durability.TRANSIENT_LOCAL: SpaceDurability.TRANSIENT_LOCAL,
    Durability.TRANSIENT: SpaceDurability.TRANSIENT,
    Durability.PERSISTENT: SpaceDurability.PERSISTENT,
}


class Refused(Exception):  # noqa: N818
    """An entity is not made; ``status`` is what the client is told, the text why and what to do."""

    def __init__(self, status: int, why: str, remedy: str = "") -> None:
        super().__init__(why)
        self.status = status
        self.remedy = remedy


def resolve(variant: Variant, references: References) -> Entity | None:
    """The entity that a variant describes, in whichever format. Raises Refused."""
    if variant.format is Format.BINARY:
        return variant.entity
    text = variant.text or ""
    try:
        if variant.format is Format.XML:
            if not text and variant.kind in (Kind.PUBLISHER, Kind.SUBSCRIBER):
                return PublisherEntity() if variant.kind is Kind.PUBLISHER else SubscriberEntity()
            return parse_document_untrusted(variant.kind, text).entity
        return references.lookup(variant.kind, text)
    except UnknownReference as error:
        raise Refused(
            STATUS_ERR_DDS_ERROR, str(error), "Add the profile to the file, or create in binary."
        ) from None
    except InvalidRepresentation as error:
        raise Refused(STATUS_ERR_DDS_ERROR, f"its XML is refused: {error}", "Correct the document.") from None


def same(
    proxy: Proxy, entity: Entity | None, domain: int | None, objects: dict[int, Proxy], default_domain: int
) -> bool:
    """Whether ``entity`` describes what ``proxy`` already is, so that it may be used again."""
    if isinstance(proxy, ParticipantProxy) and isinstance(entity, ParticipantEntity):
        old = proxy.entity
        if not isinstance(old, ParticipantEntity) or old.name != entity.name:
            return False
        return proxy.domain == _domain(domain, entity, default_domain)
    if isinstance(proxy, TopicProxy) and isinstance(entity, TopicEntity):
        return proxy.topic == Topic(entity.name, entity.type_name or "")
    if isinstance(proxy, GroupProxy):
        return entity is not None
    if isinstance(proxy, (WriterProxy, ReaderProxy)) and isinstance(
        entity, (DataWriterEntity, DataReaderEntity)
    ):
        old = proxy.entity
        assert isinstance(old, (DataWriterEntity, DataReaderEntity))
        if old.effective_qos != entity.effective_qos:
            return False
        if entity.topic_id is not None:
            topic = objects.get(entity.topic_id)
            return isinstance(topic, TopicProxy) and topic.topic == proxy.topic
        return entity.topic_name == proxy.topic.name
    return proxy.entity == entity


def build(
    variant: Variant,
    entity: Entity | None,
    object_id: int,
    objects: dict[int, Proxy],
    space: Space,
    *,
    client: str,
    client_key: bytes,
    default_domain: int,
    limits: Limits,
) -> Proxy:
    """The proxy for ``entity``, in the space. Raises Refused."""
    try:
        if isinstance(entity, ParticipantEntity):
            return _participant(variant, entity, object_id, space, client, client_key, default_domain)
        parent = objects.get(variant.parent_id or 0)
        if parent is None:
            raise Refused(
                STATUS_ERR_UNKNOWN_REFERENCE,
                f"its parent 0x{variant.parent_id or 0:04X} does not exist",
                "Create the parent first.",
            )
        participant = parent if isinstance(parent, ParticipantProxy) else parent.parent
        assert participant is not None
        if participant.participant.closed:
            raise Refused(
                STATUS_ERR_DDS_ERROR,
                "its participant was deleted",
                "Create the participant and what is in it anew.",
            )
        if isinstance(entity, TopicEntity):
            return TopicProxy(object_id, entity, participant, Topic(entity.name, entity.type_name or ""))
        if isinstance(entity, (PublisherEntity, SubscriberEntity)):
            return GroupProxy(object_id, entity, participant, variant.kind)
        if isinstance(entity, DataWriterEntity):
            topic = _topic(entity, participant, objects)
            return WriterProxy(object_id, entity, participant, topic, _qos(entity, parent))
        if isinstance(entity, DataReaderEntity):
            topic = _topic(entity, participant, objects)
            if topic.name == GRAPH:
                return GraphProxy(object_id, entity, participant, topic)
            if topic.name.startswith(EVENTS):
                return _events(entity, object_id, participant, topic, objects, space)
            return ReaderProxy(object_id, entity, participant, topic, _qos(entity, parent))
        if isinstance(entity, RequesterEntity):
            return RequesterProxy(
                object_id,
                entity,
                participant,
                _service(entity),
                _services(limits),
                limits.outstanding_requests,
            )
        if isinstance(entity, ReplierEntity):
            return ReplierProxy(object_id, entity, participant, _service(entity), _services(limits))
    except (SpaceError, ValueError) as error:
        raise Refused(STATUS_ERR_DDS_ERROR, str(error)) from None
    raise Refused(STATUS_ERR_INVALID_DATA, "its representation describes nothing")


def _participant(
    variant: Variant,
    entity: ParticipantEntity,
    object_id: int,
    space: Space,
    client: str,
    client_key: bytes,
    default_domain: int,
) -> ParticipantProxy:
    domain = _domain(variant.domain, entity, default_domain)
    name = entity.name or DEFAULT_PARTICIPANT
    namespace, _, node = name.rpartition("/")
    key = client_key + object_id.to_bytes(2, "big")
    options = {"namespace": "/" + namespace.strip("/"), "domain": domain, "owner": client}
    node = "" if entity.name is None else node
    try:
        participant = space.participant(node, key=key, **options)  # type: ignore[arg-type]
    except ValueError:  # the old one of this id lives on for its endpoints
        participant = space.participant(node, **options)  # type: ignore[arg-type]
    return ParticipantProxy(object_id, entity, participant, domain, name)


def _events(
    entity: DataReaderEntity,
    object_id: int,
    participant: ParticipantProxy,
    topic: Topic,
    objects: dict[int, Proxy],
    space: Space,
) -> EventsProxy:
    of = subject(topic.name, objects)
    if of is None or of.parent is None or of.parent.domain != participant.domain:
        raise Refused(
            STATUS_ERR_UNKNOWN_REFERENCE,
            f"{topic.name!r} names no writer or reader of this client",
            "Create it first.",
        )
    return EventsProxy(object_id, entity, participant, topic, of, objects, space)


def _domain(asked: int | None, entity: ParticipantEntity, default_domain: int) -> int:
    if asked != PROFILE_DOMAIN:
        return asked or 0
    return default_domain if entity.domain is None else entity.domain


def _topic(
    entity: DataWriterEntity | DataReaderEntity, participant: ParticipantProxy, objects: dict[int, Proxy]
) -> Topic:
    if entity.topic_id is not None:
        proxy = objects.get(entity.topic_id)
        if isinstance(proxy, TopicProxy):
            return proxy.topic
        raise Refused(
            STATUS_ERR_DDS_ERROR,
            f"its topic 0x{entity.topic_id:04X} does not exist",
            "Create the topic first.",
        )
    for known in participant.topics:
        if known.topic.name == entity.topic_name:
            return known.topic
    raise Refused(
        STATUS_ERR_DDS_ERROR,
        f"its participant has no topic named {entity.topic_name!r}",
        "Create the topic first.",
    )


def _service(entity: RequesterEntity | ReplierEntity) -> Service:
    return Service(
        entity.service_name,
        entity.request_topic_name,
        entity.reply_topic_name,
        entity.request_type,
        entity.reply_type,
    )


def _services(limits: Limits) -> Qos:
    return Qos.preset("services_default").replace(depth=limits.request_history)


def _qos(entity: DataWriterEntity | DataReaderEntity, parent: Proxy) -> Qos:
    qos = entity.effective_qos
    group = parent.entity
    grouped = group.partitions if isinstance(group, PublisherEntity | SubscriberEntity) else ()
    return Qos(
        reliability=Reliability.RELIABLE if qos.reliable else Reliability.BEST_EFFORT,
        durability=_DURABILITY[qos.durability],
        history=History.KEEP_LAST if qos.keep_last else History.KEEP_ALL,
        depth=qos.depth or 1,
        deadline=(qos.deadline_ms or 0) * _MS,
        lifespan=(qos.lifespan_ms or 0) * _MS,
        ownership=Ownership.EXCLUSIVE if qos.exclusive else Ownership.SHARED,
        strength=(entity.ownership_strength or 0) if isinstance(entity, DataWriterEntity) else 0,
        partitions=qos.partitions or grouped,
    )
