"""The graph of a space as values: who is there, what they write and read, what fits and what does not.

An engine keeps its own books and shows them as a `Graph`; everything read from it is a value that does not
change afterwards. Watchers get one event for each change.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from muros.space._qos import Qos

__all__ = [
    "Appeared",
    "Endpoint",
    "Graph",
    "GraphEvent",
    "Incompatible",
    "Matched",
    "ParticipantInfo",
    "Role",
    "ServiceInfo",
    "TopicInfo",
    "Unmatched",
    "Vanished",
]


class Role(Enum):
    """What an endpoint does with its topic."""

    WRITER = "writer"
    READER = "reader"


@dataclass(frozen=True, slots=True)
class ParticipantInfo:
    """A participant, or one node of it: several nodes of one participant share its gid and differ in their names.

    In ROS terms: one node, unless `name` is empty.
    """

    gid: bytes
    name: str
    namespace: str
    domain: int
    enclave: str
    owner: str
    """Whom it belongs to, as findings name it."""
    vendor: str = ""
    """Whose implementation it is, in words; empty for this process or when unknown."""
    host: str = ""
    """The machine it runs on, as far as it tells."""
    pid: str = ""
    """Its process, as far as it tells."""

    @property
    def full_name(self) -> str:
        """Namespace and name: "/greenhouse/thermometer"."""
        return full_name(self.namespace, self.name)


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A writer or reader."""

    gid: bytes
    role: Role
    topic: str
    type_name: str
    qos: Qos
    service: str
    """Name of the service whose requests or replies it carries; empty for a plain topic."""
    participant: ParticipantInfo
    type_hash: str = ""
    """Hash of its type's definition, such as "RIHS01_df668c74..."; empty when unknown."""


@dataclass(frozen=True, slots=True)
class Matched:
    """A writer and a reader met: samples flow."""

    writer: Endpoint
    reader: Endpoint


@dataclass(frozen=True, slots=True)
class Unmatched:
    """A matched pair ended because one of the two has gone."""

    writer: Endpoint
    reader: Endpoint


@dataclass(frozen=True, slots=True)
class Incompatible:
    """A writer and a reader of one topic that do not fit, with the reasons in words."""

    writer: Endpoint
    reader: Endpoint
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Appeared:
    """A participant or endpoint is there."""

    what: ParticipantInfo | Endpoint


@dataclass(frozen=True, slots=True)
class Vanished:
    """A participant or endpoint has gone."""

    what: ParticipantInfo | Endpoint


@dataclass(frozen=True, slots=True)
class Assigned:
    """An endpoint of another process belongs to another node than was known so far: that is told on its own."""

    what: Endpoint


GraphEvent = Appeared | Vanished | Assigned | Matched | Unmatched | Incompatible


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """All of one topic in one domain."""

    name: str
    domain: int
    types: tuple[str, ...]
    """More than one is a mistake somebody made."""
    writers: tuple[Endpoint, ...]
    readers: tuple[Endpoint, ...]
    matches: tuple[tuple[bytes, bytes], ...]
    """Gids of writer and reader."""
    incompatible: tuple[Incompatible, ...]


@dataclass(frozen=True, slots=True)
class ServiceInfo:
    """All of one service in one domain."""

    name: str
    domain: int
    servers: tuple[Endpoint, ...]
    """The readers of its requests."""
    clients: tuple[Endpoint, ...]
    """The writers of its requests."""


class Graph(Protocol):
    """The graph of a space, all domains. Reading it costs time in proportion to what is returned."""

    @property
    def participants(self) -> tuple[ParticipantInfo, ...]:
        """In order of appearance."""

    @property
    def nodes(self) -> tuple[ParticipantInfo, ...]:
        """The participants that have a node name."""

    @property
    def writers(self) -> tuple[Endpoint, ...]:
        """All writers, those of requests and replies too."""

    @property
    def readers(self) -> tuple[Endpoint, ...]:
        """All readers, those of requests and replies too."""

    @property
    def topics(self) -> tuple[TopicInfo, ...]:
        """All topics with a writer or reader."""

    @property
    def services(self) -> tuple[ServiceInfo, ...]:
        """All services with a server or client."""

    def topic(self, name: str, domain: int | None = None) -> TopicInfo | None:
        """One topic, None if nobody writes or reads it. `domain` None = that of the space."""

    def service(self, name: str, domain: int | None = None) -> ServiceInfo | None:
        """One service, None if nobody serves or uses it. `domain` None = that of the space."""

    def endpoint(self, gid: bytes) -> Endpoint | None:
        """The writer or reader with this gid."""

    def watch(self, callback: Callable[[GraphEvent], object]) -> Callable[[], None]:
        """Call `callback` with every change from now on, before the call that made it returns, but never
        inside another event. Returns a function that ends it. A callback that raises becomes a finding."""


def full_name(namespace: str, name: str) -> str:
    """Namespace and name of a node joined by one slash."""
    return f"{namespace.rstrip('/')}/{name}"
