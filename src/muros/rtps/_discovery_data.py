"""What participants say of themselves and their endpoints, as values and as the payloads that carry it.

`ParticipantData` travels through the participant discovery protocol (DDSI-RTPS 2.3, 8.5.3 and 9.6.2.2),
`EndpointData` through the endpoint discovery protocol (8.5.4), `Assertion` through the participant message topic
(8.4.13). Payloads are ours to write little endian, and theirs to send in either byte order. Ours tell neither
TypeInformation nor TypeObject: peers that got it would compare types bit by bit, and refuse what they cannot.

When one leaves, a DATA says so that holds its key or the hash of it: `departure` and `key_untrusted`.
"""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, NamedTuple

from muros.rtps import _parameters
from muros.rtps._constants import (
    BUILTIN_ENDPOINTS,
    DEFAULT_LEASE,
    ENTITYID_PARTICIPANT,
    PROTOCOL_VERSION,
    VENDOR_OURS,
    BuiltinEndpoint,
    Pid,
    Representation,
    StatusInfo,
    is_reader,
    is_writer,
)
from muros.rtps._parameters import InvalidParameters, ParameterBuilder, Parameters
from muros.rtps._qos import EndpointQos, read_qos, write_qos
from muros.rtps._values import Guid, GuidPrefix, Locator, guid_of, split_guid

__all__ = [
    "Assertion",
    "EndpointData",
    "InvalidDiscoveryData",
    "ParticipantData",
    "departure",
    "key_untrusted",
    "user_values",
]

MAX_PAYLOAD: Final = 64 * 1024
"""Bytes of discovery data read; what is larger is refused. Real ones have some hundreds."""

MAX_LOCATORS: Final = 16
"""Locators of one kind that are kept; a list without bound would have us send to all of them."""

MAX_NAME: Final = 1024
"""Characters of a topic's or type's name; what is longer is refused."""


class InvalidDiscoveryData(ValueError):  # noqa: N818
    """Foreign bytes that describe no participant, endpoint or assertion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParticipantData:
    """A participant (8.5.3.2)."""

    prefix: GuidPrefix
    version: tuple[int, int] = PROTOCOL_VERSION
    vendor: bytes = VENDOR_OURS
    lease: int = DEFAULT_LEASE
    """ns after which it is gone, if silent."""
    builtin_endpoints: BuiltinEndpoint = BUILTIN_ENDPOINTS
    metatraffic_unicast: tuple[Locator, ...] = ()
    """Where discovery is to be sent."""
    metatraffic_multicast: tuple[Locator, ...] = ()
    """Groups in which it listens for discovery; none = not said."""
    default_unicast: tuple[Locator, ...] = ()
    """Where user data is to be sent to endpoints that do not name locators of their own."""
    default_multicast: tuple[Locator, ...] = ()
    name: str = ""
    user_data: bytes = b""
    """ROS 2 writes "enclave=/;" here; `user_values` reads it."""
    properties: tuple[tuple[str, str], ...] = ()
    """Names and values, such as of host and process."""
    domain: int | None = None
    """None = not said."""
    domain_tag: str = ""
    """Participants meet only those with the same tag."""
    expects_inline_qos: bool = False
    manual_liveliness_count: int = 0

    @property
    def guid(self) -> Guid:
        """Its GUID."""
        return guid_of(self.prefix, ENTITYID_PARTICIPANT)

    def payload(self) -> bytes:
        """The data as a serialized payload, encapsulation included."""
        builder = ParameterBuilder()
        builder.add(Pid.PROTOCOL_VERSION, bytes(self.version))
        builder.add(Pid.VENDORID, self.vendor)
        builder.add(Pid.PARTICIPANT_GUID, self.guid)
        if self.domain is not None:
            builder.uint32(Pid.DOMAIN_ID, self.domain)
        if self.domain_tag:
            builder.text(Pid.DOMAIN_TAG, self.domain_tag)
        for pid, locators in (
            (Pid.METATRAFFIC_UNICAST_LOCATOR, self.metatraffic_unicast),
            (Pid.METATRAFFIC_MULTICAST_LOCATOR, self.metatraffic_multicast),
            (Pid.DEFAULT_UNICAST_LOCATOR, self.default_unicast),
            (Pid.DEFAULT_MULTICAST_LOCATOR, self.default_multicast),
        ):
            builder.locators(pid, locators)
        if self.expects_inline_qos:
            builder.flag(Pid.EXPECTS_INLINE_QOS, True)
        builder.duration(Pid.PARTICIPANT_LEASE_DURATION, self.lease)
        if self.manual_liveliness_count:
            builder.uint32(Pid.PARTICIPANT_MANUAL_LIVELINESS_COUNT, self.manual_liveliness_count)
        builder.uint32(Pid.BUILTIN_ENDPOINT_SET, self.builtin_endpoints)
        if self.name:
            builder.text(Pid.ENTITY_NAME, self.name)
        if self.user_data:
            builder.octets(Pid.USER_DATA, self.user_data)
        if self.properties:
            builder.properties(self.properties)
        return _PL_CDR_LE + builder.build()

    @classmethod
    def parse_untrusted(cls, payload: bytes) -> "ParticipantData":
        """The participant in a serialized payload. `InvalidDiscoveryData` when there is none."""
        with _refused("a participant"):
            parameters = _open(payload)
            prefix, entity = split_guid(_required(parameters.guid(Pid.PARTICIPANT_GUID), "GUID"))
            if entity != ENTITYID_PARTICIPANT:
                raise InvalidParameters(f"the GUID has entity id 0x{entity:08x}")
            version = parameters.first(Pid.PROTOCOL_VERSION, 2) or bytes(PROTOCOL_VERSION)
            vendor = parameters.first(Pid.VENDORID, 2) or VENDOR_OURS
            lease = parameters.duration(Pid.PARTICIPANT_LEASE_DURATION)
            return cls(
                prefix=prefix,
                version=(version[0], version[1]),
                vendor=vendor[:2],
                lease=DEFAULT_LEASE if lease is None else lease,
                builtin_endpoints=BuiltinEndpoint(parameters.uint32(Pid.BUILTIN_ENDPOINT_SET) or 0),
                metatraffic_unicast=parameters.locators(Pid.METATRAFFIC_UNICAST_LOCATOR)[:MAX_LOCATORS],
                metatraffic_multicast=parameters.locators(Pid.METATRAFFIC_MULTICAST_LOCATOR)[:MAX_LOCATORS],
                default_unicast=parameters.locators(Pid.DEFAULT_UNICAST_LOCATOR)[:MAX_LOCATORS],
                default_multicast=parameters.locators(Pid.DEFAULT_MULTICAST_LOCATOR)[:MAX_LOCATORS],
                name=parameters.text(Pid.ENTITY_NAME) or "",
                user_data=parameters.octets(Pid.USER_DATA),
                properties=parameters.properties(),
                domain=parameters.uint32(Pid.DOMAIN_ID),
                domain_tag=parameters.text(Pid.DOMAIN_TAG) or "",
                expects_inline_qos=parameters.flag(Pid.EXPECTS_INLINE_QOS),
                manual_liveliness_count=parameters.uint32(Pid.PARTICIPANT_MANUAL_LIVELINESS_COUNT) or 0,
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class EndpointData:
    """A writer or reader (8.5.4.4); which one, its GUID says."""

    guid: Guid
    topic: str
    type_name: str
    qos: EndpointQos
    participant: Guid = b""
    """GUID of its participant; empty when made = the one with the GUID's prefix."""
    user_data: bytes = b""
    """ROS 2 writes "typehash=RIHS01_...;" here; `user_values` reads it."""
    topic_data: bytes = b""
    group_data: bytes = b""
    unicast: tuple[Locator, ...] = ()
    """Where to send to it; none = to its participant's default locators."""
    multicast: tuple[Locator, ...] = ()
    expects_inline_qos: bool = False
    """Whether a reader wants the writer's QoS with each sample."""

    def __post_init__(self) -> None:
        if not self.participant:
            object.__setattr__(self, "participant", guid_of(self.guid[:12], ENTITYID_PARTICIPANT))

    @property
    def is_writer(self) -> bool:
        """Whether it is a writer."""
        return is_writer(split_guid(self.guid)[1])

    def payload(self) -> bytes:
        """The data as a serialized payload, encapsulation included."""
        builder = ParameterBuilder()
        builder.add(Pid.ENDPOINT_GUID, self.guid)
        # Without it, ROS 2 shows the endpoint but not whose it is.
        builder.add(Pid.PARTICIPANT_GUID, self.participant)
        builder.text(Pid.TOPIC_NAME, self.topic)
        builder.text(Pid.TYPE_NAME, self.type_name)
        builder.add(Pid.KEY_HASH, self.guid)
        builder.add(Pid.PROTOCOL_VERSION, bytes(PROTOCOL_VERSION))
        builder.add(Pid.VENDORID, VENDOR_OURS)
        builder.locators(Pid.UNICAST_LOCATOR, self.unicast)
        builder.locators(Pid.MULTICAST_LOCATOR, self.multicast)
        if self.expects_inline_qos:
            builder.flag(Pid.EXPECTS_INLINE_QOS, True)
        write_qos(builder, self.qos)
        for pid, octets in (
            (Pid.USER_DATA, self.user_data),
            (Pid.TOPIC_DATA, self.topic_data),
            (Pid.GROUP_DATA, self.group_data),
        ):
            if octets:
                builder.octets(pid, octets)
        return _PL_CDR_LE + builder.build()

    @classmethod
    def parse_untrusted(cls, payload: bytes) -> "EndpointData":
        """The endpoint in a serialized payload. `InvalidDiscoveryData` when there is none."""
        with _refused("an endpoint"):
            parameters = _open(payload)
            guid = _required(parameters.guid(Pid.ENDPOINT_GUID), "GUID")
            entity = split_guid(guid)[1]
            if not (is_writer(entity) or is_reader(entity)):
                raise InvalidParameters(f"entity id 0x{entity:08x} is neither a writer's nor a reader's")
            return cls(
                guid=guid,
                participant=parameters.guid(Pid.PARTICIPANT_GUID) or b"",
                topic=_name(parameters, Pid.TOPIC_NAME, "topic name"),
                type_name=_name(parameters, Pid.TYPE_NAME, "type name"),
                qos=read_qos(parameters, writer=is_writer(entity)),
                user_data=parameters.octets(Pid.USER_DATA),
                topic_data=parameters.octets(Pid.TOPIC_DATA),
                group_data=parameters.octets(Pid.GROUP_DATA),
                unicast=parameters.locators(Pid.UNICAST_LOCATOR)[:MAX_LOCATORS],
                multicast=parameters.locators(Pid.MULTICAST_LOCATOR)[:MAX_LOCATORS],
                expects_inline_qos=parameters.flag(Pid.EXPECTS_INLINE_QOS),
            )


class Assertion(NamedTuple):
    """A participant says that it, or what it asserts by hand, is alive (8.4.13.5, ParticipantMessageData)."""

    prefix: GuidPrefix
    manual: bool
    """Whether it speaks for its writers with MANUAL_BY_PARTICIPANT liveliness, or those with AUTOMATIC."""

    def payload(self) -> bytes:
        """The data as a serialized payload, encapsulation included."""
        return _CDR_LE + self.prefix + (_MANUAL if self.manual else _AUTOMATIC) + bytes(4)

    @classmethod
    def parse_untrusted(cls, payload: bytes) -> "Assertion | None":
        """The assertion in a serialized payload; None when it says something else.

        `InvalidDiscoveryData` when it is too short or not CDR.
        """
        if len(payload) < 20 or payload[0] or payload[1] > Representation.CDR_LE:
            raise InvalidDiscoveryData(f"{len(payload)} bytes are no participant message")
        kind = payload[16:20]
        if kind not in (_AUTOMATIC, _MANUAL):
            return None
        return cls(payload[4:16], kind == _MANUAL)


def departure(guid: Guid) -> bytes:
    """Inline QoS of the DATA, without payload, by which a participant or endpoint of ours leaves.

    A key hash and not the key itself (9.6.3.8): both are allowed, but Fast DDS leaves alone what holds a key of
    more than 16 bytes, and a parameter list does.
    """
    return _parameters.inline_qos(key_hash=guid, status=StatusInfo.DISPOSED | StatusInfo.UNREGISTERED)


def key_untrusted(payload: bytes, inline_qos: Parameters | None) -> Guid:
    """Whom a DATA of discovery is about that says no more than that it is gone.

    By its payload's key, else the key hash in its inline QoS. `InvalidDiscoveryData` when there is neither.
    """
    with _refused("a participant or endpoint"):
        guid: Guid | None = None
        if payload:
            parameters = _open(payload)
            # An endpoint may name its participant as well.
            guid = parameters.guid(Pid.ENDPOINT_GUID) or parameters.guid(Pid.PARTICIPANT_GUID)
        return _required(guid or _parameters.key_hash(inline_qos), "key")


def user_values(user_data: bytes) -> dict[str, str]:
    """The pairs in user data as ROS 2 writes it: "name=value;name=value;". What is none is left out."""
    text = user_data.partition(b"\0")[0].decode("utf-8", "backslashreplace")
    pairs = (part.partition("=") for part in text.split(";"))
    return {name: value for name, equals, value in pairs if name and equals}


_PL_CDR_LE: Final = struct.pack(">HH", Representation.PL_CDR_LE, 0)
_CDR_LE: Final = struct.pack(">HH", Representation.CDR_LE, 0)
_AUTOMATIC: Final = b"\0\0\0\1"
_MANUAL: Final = b"\0\0\0\2"
_ORDERS: Final[dict[int, str]] = {Representation.PL_CDR_BE: ">", Representation.PL_CDR_LE: "<"}


@contextmanager
def _refused(what: str) -> Iterator[None]:
    try:
        yield
    except InvalidParameters as error:
        raise InvalidDiscoveryData(f"the data of {what} is refused: {error}") from None


def _open(payload: bytes) -> Parameters:
    """The parameter list in a payload."""
    if not 4 <= len(payload) <= MAX_PAYLOAD:
        raise InvalidParameters(f"it has {len(payload)} bytes, not 4 to {MAX_PAYLOAD}")
    order = _ORDERS.get(payload[0] << 8 | payload[1])
    if order is None:
        raise InvalidParameters(f"representation 0x{payload[0] << 8 | payload[1]:04x} is no parameter list")
    return _parameters.parse_untrusted(payload, 4, order=order)[0]


def _required(guid: Guid | None, what: str) -> Guid:
    if guid is None:
        raise InvalidParameters(f"it has no {what}")
    return guid


def _name(parameters: Parameters, pid: int, what: str) -> str:
    text = parameters.text(pid)
    if not text:
        raise InvalidParameters(f"it has no {what}")
    if len(text) > MAX_NAME:
        raise InvalidParameters(f"the {what} has {len(text)} characters, more than {MAX_NAME}")
    return text
