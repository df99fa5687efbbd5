"""The numbers of DDSI-RTPS 2.3 that this room needs, by name."""

from enum import IntEnum, IntFlag
from typing import Final

from muros.rtps._values import EntityId

__all__ = [
    "BUILTIN_ENDPOINTS",
    "DEFAULT_LEASE",
    "DEFAULT_MULTICAST",
    "MAX_DOMAIN",
    "MAX_PARTICIPANT_INDEX",
    "PROTOCOL_VERSION",
    "VENDOR_CYCLONE",
    "VENDOR_EPROSIMA",
    "VENDOR_OURS",
    "BuiltinEndpoint",
    "EntityKind",
    "Pid",
    "Ports",
    "Representation",
    "Submessage",
    "entity_kind",
    "is_builtin",
    "is_reader",
    "is_writer",
    "keyed",
    "vendor_name",
]

PROTOCOL_VERSION: Final = (2, 3)

VENDOR_OURS: Final = b"\0\0"
"""VENDORID_UNKNOWN (8.3.3.1.3): no number is assigned to this implementation.

Peers infer dialects from those of others (`VENDOR_EPROSIMA`, `VENDOR_CYCLONE`), so none of them may be borrowed.
"""

VENDOR_EPROSIMA: Final = b"\x01\x0f"
VENDOR_CYCLONE: Final = b"\x01\x10"

_VENDORS: Final = {
    b"\x01\x01": "RTI Connext",
    b"\x01\x02": "OpenSplice",
    b"\x01\x03": "OpenDDS",
    b"\x01\x0a": "RTI Connext Micro",
    b"\x01\x0b": "Vortex Cafe",
    VENDOR_EPROSIMA: "Fast DDS",
    VENDOR_CYCLONE: "Cyclone DDS",
    b"\x01\x11": "GurumDDS",
    b"\x01\x12": "RustDDS",
    b"\x01\x14": "Dust DDS",
}


def vendor_name(vendor: bytes) -> str:
    """The name of the product with this vendor id, "vendor 01 2a" when unknown."""
    return _VENDORS.get(vendor) or f"vendor {vendor.hex(' ')}"


class Submessage(IntEnum):
    """SubmessageId (9.4.5.1.1)."""

    PAD = 0x01
    ACKNACK = 0x06
    HEARTBEAT = 0x07
    GAP = 0x08
    INFO_TS = 0x09
    INFO_SRC = 0x0C
    INFO_REPLY_IP4 = 0x0D
    INFO_DST = 0x0E
    INFO_REPLY = 0x0F
    NACK_FRAG = 0x12
    HEARTBEAT_FRAG = 0x13
    DATA = 0x15
    DATA_FRAG = 0x16


class Representation(IntEnum):
    """Representation identifiers of serialized payloads (10.2; XTypes 1.3, 7.6.3.1.2)."""

    CDR_BE = 0x0000
    CDR_LE = 0x0001
    PL_CDR_BE = 0x0002
    PL_CDR_LE = 0x0003
    CDR2_BE = 0x0006
    CDR2_LE = 0x0007
    D_CDR2_BE = 0x0008
    D_CDR2_LE = 0x0009
    PL_CDR2_BE = 0x000A
    PL_CDR2_LE = 0x000B


# --- Entities (9.3.1.2, table 9.1 and 9.3.1.3) -----------------------------------------------------------

ENTITYID_UNKNOWN: Final = 0
ENTITYID_PARTICIPANT: Final = 0x000001C1
ENTITYID_SEDP_PUBLICATIONS_WRITER: Final = 0x000003C2
ENTITYID_SEDP_PUBLICATIONS_READER: Final = 0x000003C7
ENTITYID_SEDP_SUBSCRIPTIONS_WRITER: Final = 0x000004C2
ENTITYID_SEDP_SUBSCRIPTIONS_READER: Final = 0x000004C7
ENTITYID_SPDP_WRITER: Final = 0x000100C2
ENTITYID_SPDP_READER: Final = 0x000100C7
ENTITYID_PARTICIPANT_MESSAGE_WRITER: Final = 0x000200C2
ENTITYID_PARTICIPANT_MESSAGE_READER: Final = 0x000200C7


class EntityKind(IntEnum):
    """The last octet of an entity id, without the two bits that say whose it is."""

    UNKNOWN = 0x00
    PARTICIPANT = 0x01
    WRITER_KEYED = 0x02
    WRITER = 0x03
    READER = 0x04
    READER_KEYED = 0x07
    WRITER_GROUP = 0x08
    READER_GROUP = 0x09


_WRITERS: Final = (EntityKind.WRITER, EntityKind.WRITER_KEYED)
_READERS: Final = (EntityKind.READER, EntityKind.READER_KEYED)
_KEYED: Final = (EntityKind.WRITER_KEYED, EntityKind.READER_KEYED)
_BUILTIN_BITS: Final = 0xC0


def entity_kind(entity: EntityId) -> int:
    """An `EntityKind`, or another number from a peer that invents kinds."""
    return entity & 0x3F


def is_builtin(entity: EntityId) -> bool:
    """Whether the specification itself (and not a user) made this entity."""
    return entity & _BUILTIN_BITS == _BUILTIN_BITS


def is_writer(entity: EntityId) -> bool:
    """Whether this is a writer's id."""
    return entity & 0x3F in _WRITERS


def is_reader(entity: EntityId) -> bool:
    """Whether this is a reader's id."""
    return entity & 0x3F in _READERS


def keyed(entity: EntityId) -> bool:
    """Whether the entity's topic has a key."""
    return entity & 0x3F in _KEYED


class BuiltinEndpoint(IntFlag):
    """Which of the builtin endpoints a participant has (9.3.2, BuiltinEndpointSet_t)."""

    PARTICIPANT_ANNOUNCER = 1 << 0
    PARTICIPANT_DETECTOR = 1 << 1
    PUBLICATIONS_ANNOUNCER = 1 << 2
    PUBLICATIONS_DETECTOR = 1 << 3
    SUBSCRIPTIONS_ANNOUNCER = 1 << 4
    SUBSCRIPTIONS_DETECTOR = 1 << 5
    PARTICIPANT_MESSAGE_WRITER = 1 << 10
    PARTICIPANT_MESSAGE_READER = 1 << 11
    TOPICS_ANNOUNCER = 1 << 28
    TOPICS_DETECTOR = 1 << 29


BUILTIN_ENDPOINTS: Final = (
    BuiltinEndpoint.PARTICIPANT_ANNOUNCER
    | BuiltinEndpoint.PARTICIPANT_DETECTOR
    | BuiltinEndpoint.PUBLICATIONS_ANNOUNCER
    | BuiltinEndpoint.PUBLICATIONS_DETECTOR
    | BuiltinEndpoint.SUBSCRIPTIONS_ANNOUNCER
    | BuiltinEndpoint.SUBSCRIPTIONS_DETECTOR
    | BuiltinEndpoint.PARTICIPANT_MESSAGE_WRITER
    | BuiltinEndpoint.PARTICIPANT_MESSAGE_READER
)
"""What a participant of ours has."""

# --- Discovery (9.6.1, 9.6.2.2 to 9.6.2.4) ---------------------------------------------------------------

DEFAULT_MULTICAST: Final = "239.255.0.1"
"""Group of participant discovery."""

DEFAULT_LEASE: Final = 100 * 10**9
"""ns after which a silent participant that did not say its lease is gone."""

MAX_DOMAIN: Final = 232
"""Largest domain id whose ports fit 16 bits."""

MAX_PARTICIPANT_INDEX: Final = 119
"""Largest index whose unicast ports lie before those of the next domain."""


class Ports:
    """The well-known ports of a domain (9.6.1.1): PB 7400, DG 250, PG 2, d0 0, d1 10, d2 1, d3 11.

    ValueError unless `domain` is from 0 to `MAX_DOMAIN`.
    """

    __slots__ = ("base",)

    def __init__(self, domain: int) -> None:
        if not 0 <= domain <= MAX_DOMAIN:
            raise ValueError(f"domain id {domain} is not from 0 to {MAX_DOMAIN}")
        self.base: Final = 7400 + 250 * domain

    @property
    def multicast(self) -> int:
        """Discovery, by multicast."""
        return self.base

    @property
    def user_multicast(self) -> int:
        """User data, by multicast."""
        return self.base + 1

    def unicast(self, index: int) -> int:
        """Discovery with the participant `index` (from 0) of a host; ValueError when there is no such port."""
        return self.base + 10 + 2 * self._checked(index)

    def user_unicast(self, index: int) -> int:
        """User data of the participant `index` of a host."""
        return self.base + 11 + 2 * self._checked(index)

    def _checked(self, index: int) -> int:
        if not 0 <= index <= MAX_PARTICIPANT_INDEX or self.base + 11 + 2 * index > 0xFFFF:
            raise ValueError(
                f"there is no port for participant {index} in domain {(self.base - 7400) // 250}: "
                "use a smaller domain id, or end some participants"
            )
        return index


class Pid(IntEnum):
    """ParameterId (9.6.2.2.2, tables 9.13 and 9.14), with the vendors' and the later ones that peers send."""

    PAD = 0x0000
    SENTINEL = 0x0001
    PARTICIPANT_LEASE_DURATION = 0x0002
    TIME_BASED_FILTER = 0x0004
    TOPIC_NAME = 0x0005
    OWNERSHIP_STRENGTH = 0x0006
    TYPE_NAME = 0x0007
    METATRAFFIC_MULTICAST_IPADDRESS = 0x000B
    DEFAULT_UNICAST_IPADDRESS = 0x000C
    METATRAFFIC_UNICAST_PORT = 0x000D
    DEFAULT_UNICAST_PORT = 0x000E
    DOMAIN_ID = 0x000F
    PROTOCOL_VERSION = 0x0015
    VENDORID = 0x0016
    RELIABILITY = 0x001A
    LIVELINESS = 0x001B
    DURABILITY = 0x001D
    DURABILITY_SERVICE = 0x001E
    OWNERSHIP = 0x001F
    PRESENTATION = 0x0021
    DEADLINE = 0x0023
    DESTINATION_ORDER = 0x0025
    LATENCY_BUDGET = 0x0027
    PARTITION = 0x0029
    LIFESPAN = 0x002B
    USER_DATA = 0x002C
    GROUP_DATA = 0x002D
    TOPIC_DATA = 0x002E
    UNICAST_LOCATOR = 0x002F
    MULTICAST_LOCATOR = 0x0030
    DEFAULT_UNICAST_LOCATOR = 0x0031
    METATRAFFIC_UNICAST_LOCATOR = 0x0032
    METATRAFFIC_MULTICAST_LOCATOR = 0x0033
    PARTICIPANT_MANUAL_LIVELINESS_COUNT = 0x0034
    CONTENT_FILTER_PROPERTY = 0x0035
    HISTORY = 0x0040
    RESOURCE_LIMITS = 0x0041
    EXPECTS_INLINE_QOS = 0x0043
    DEFAULT_MULTICAST_LOCATOR = 0x0048
    TRANSPORT_PRIORITY = 0x0049
    PARTICIPANT_GUID = 0x0050
    GROUP_GUID = 0x0052
    CONTENT_FILTER_INFO = 0x0055
    COHERENT_SET = 0x0056
    DIRECTED_WRITE = 0x0057
    BUILTIN_ENDPOINT_SET = 0x0058
    PROPERTY_LIST = 0x0059
    ENDPOINT_GUID = 0x005A
    TYPE_MAX_SIZE_SERIALIZED = 0x0060
    ORIGINAL_WRITER_INFO = 0x0061
    ENTITY_NAME = 0x0062
    KEY_HASH = 0x0070
    STATUS_INFO = 0x0071
    DATA_REPRESENTATION = 0x0073
    TYPE_CONSISTENCY = 0x0074
    TYPE_INFORMATION = 0x0075
    BUILTIN_ENDPOINT_QOS = 0x0077
    RELATED_SAMPLE_IDENTITY = 0x0083
    DOMAIN_TAG = 0x4014
    VENDOR_RELATED_SAMPLE_IDENTITY = 0x800F
    """Fast DDS's own number for the same, from before there was a standard one."""


class StatusInfo(IntFlag):
    """What a DATA says about its instance (9.6.3.9)."""

    DISPOSED = 1
    UNREGISTERED = 2
    FILTERED = 4
