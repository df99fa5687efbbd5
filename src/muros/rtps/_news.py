"""What a participant tells its owner: who came and went, who matches whom and why not, what was missed.

All are frozen values. They are handed to `on_event` of the participant after the call that caused them has done its
work, never one inside another, so that whoever takes them may call anything of the domain.
"""

from dataclasses import dataclass
from enum import Enum

from muros.rtps._discovery_data import EndpointData, ParticipantData
from muros.rtps._endpoint import Problem
from muros.rtps._values import Guid, GuidPrefix, Locator

__all__ = [
    "DeadlineMissed",
    "DomainProblem",
    "DomainReport",
    "EndpointChanged",
    "EndpointFound",
    "EndpointLost",
    "Incompatible",
    "LivelinessChanged",
    "LivelinessLost",
    "Matched",
    "Mismatch",
    "ParticipantChanged",
    "ParticipantEvent",
    "ParticipantFound",
    "ParticipantLost",
    "Policy",
    "Trouble",
    "Unmatched",
    "Why",
]


class Why(Enum):
    """Why a participant, an endpoint or a match is gone."""

    LEFT = "left"
    """It said so."""
    LEASE = "lease"
    """It was silent for longer than its lease."""
    CHANGED = "changed"
    """Its QoS (or what it says of itself) does not match any more."""
    CLOSED = "closed"
    """The local side was closed."""


class Policy(Enum):
    """What may keep a writer and a reader apart. The values are words for people."""

    TYPE = "type"
    KEY = "key"
    RELIABILITY = "reliability"
    DURABILITY = "durability"
    DEADLINE = "deadline"
    LATENCY_BUDGET = "latency budget"
    LIVELINESS = "liveliness"
    LEASE = "liveliness lease"
    OWNERSHIP = "ownership"
    DESTINATION_ORDER = "destination order"
    PRESENTATION = "presentation"
    PARTITION = "partition"
    REPRESENTATION = "data representation"


@dataclass(frozen=True, slots=True)
class Mismatch:
    """One reason why a writer and a reader do not match."""

    policy: Policy
    text: str
    """What the two say, such as "the writer offers best effort, the reader wants reliable"."""

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class ParticipantFound:
    """Somebody in another process is there. Of those in this process nothing is told: they are known anyway."""

    participant: ParticipantData


@dataclass(frozen=True, slots=True)
class ParticipantChanged:
    """Somebody says something else of itself than before."""

    participant: ParticipantData
    before: ParticipantData


@dataclass(frozen=True, slots=True)
class ParticipantLost:
    """Somebody has gone. Its endpoints were told as lost before."""

    participant: ParticipantData
    why: Why


@dataclass(frozen=True, slots=True)
class EndpointFound:
    """A writer or reader in another process is there."""

    endpoint: EndpointData


@dataclass(frozen=True, slots=True)
class EndpointChanged:
    """A writer or reader of somebody else says something else of itself than before."""

    endpoint: EndpointData
    before: EndpointData


@dataclass(frozen=True, slots=True)
class EndpointLost:
    """A writer or reader of somebody else has gone. Its matches were told as ended before."""

    endpoint: EndpointData
    why: Why


@dataclass(frozen=True, slots=True)
class Matched:
    """A writer or reader of ours and one of somebody else meet."""

    local: Guid
    remote: EndpointData


@dataclass(frozen=True, slots=True)
class Unmatched:
    """They do not meet any more."""

    local: Guid
    remote: EndpointData
    why: Why


@dataclass(frozen=True, slots=True)
class Incompatible:
    """A writer or reader of ours and one of somebody else have the same topic, but do not meet.

    Told once for each pair, and again when one of them has changed and they still do not meet.
    """

    local: Guid
    remote: EndpointData
    mismatches: tuple[Mismatch, ...]

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why, in words."""
        return tuple(mismatch.text for mismatch in self.mismatches)


@dataclass(frozen=True, slots=True)
class DeadlineMissed:
    """Nothing was written by (or came to) this writer or reader within its deadline."""

    local: Guid
    total: int
    """How often so far."""
    instance: bytes = b""
    """Key hash of the instance; empty for a topic without a key."""


@dataclass(frozen=True, slots=True)
class LivelinessLost:
    """A writer of ours with manual liveliness did not say in time that it is alive."""

    local: Guid
    total: int
    """How often so far."""


@dataclass(frozen=True, slots=True)
class LivelinessChanged:
    """A matched writer of somebody else is alive, or is not any more."""

    local: Guid
    """The reader of ours."""
    remote: Guid
    alive: bool


@dataclass(frozen=True, slots=True)
class Trouble:
    """Something went wrong between a writer and a reader; see `Problem`."""

    local: Guid
    remote: Guid
    problem: Problem
    number: int


ParticipantEvent = (
    ParticipantFound
    | ParticipantChanged
    | ParticipantLost
    | EndpointFound
    | EndpointChanged
    | EndpointLost
    | Matched
    | Unmatched
    | Incompatible
    | DeadlineMissed
    | LivelinessLost
    | LivelinessChanged
    | Trouble
)


class DomainProblem(Enum):
    """What went wrong in a domain, with whom not being clear or not of this domain."""

    MALFORMED = "malformed"
    """A datagram that is no RTPS message, or breaks off; the number: such datagrams so far."""
    DISCOVERY_MALFORMED = "discovery-malformed"
    """Discovery data that describe nothing; the number: so far."""
    FOREIGN_DOMAIN = "foreign-domain"
    """A participant of another domain, or with another domain tag; the number: its domain, -1 unknown."""
    PREFIX_MISMATCH = "prefix-mismatch"
    """Somebody speaks of participants or endpoints that are not its own; the number: so far."""
    PREFIX_TAKEN = "prefix-taken"
    """Somebody else uses the GUID prefix of a participant of ours; the number: so far."""
    UNREACHABLE = "unreachable"
    """A participant gives no address that can be reached from here; the number: how many it gives."""
    TOO_MANY_PEERS = "too-many-peers"
    """A participant was ignored; the number: the limit."""
    TOO_MANY_ENDPOINTS = "too-many-endpoints"
    """An endpoint was ignored; the number: the limit of its participant."""
    DISCOVERY_TOO_LARGE = "discovery-too-large"
    """An endpoint was ignored since its participant says too much; the number: the limit in bytes."""
    FLOOD = "flood"
    """A participant changes what it says too often, and is heard with delay; the number: changes per second."""
    QUEUE_FULL = "queue-full"
    """Datagrams among the participants of this process were lost; the number: so far."""


@dataclass(frozen=True, slots=True)
class DomainReport:
    """A `DomainProblem`. The same of the same participant is told again at the earliest after ten seconds."""

    problem: DomainProblem
    prefix: GuidPrefix
    """The participant concerned; empty when not known."""
    source: Locator | None
    """Where the datagram came from."""
    number: int
    text: str = ""
    """More, in words."""
