"""What happens at an agent, as values: who came, who left, what was made. ``text()`` says it for people.

Keys are client keys as integers, ``0xBA5EBA11`` in the texts. What went wrong is not an event but a finding.
"""

from dataclasses import dataclass

from muros.links.voice import Event, counted
from muros.xrce.constants import KIND_NAMES

__all__ = [
    "ClientBack",
    "ClientConnected",
    "ClientGone",
    "ClientLost",
    "ClientReady",
    "ClientSilent",
    "EntityCreated",
    "EntityDeleted",
    "Event",
    "LinkDown",
    "LinkUp",
    "client_name",
]


def client_name(key: int) -> str:
    """How a client is called everywhere: ``client 0xBA5EBA11``."""
    return f"client 0x{key:08X}"


@dataclass(frozen=True, slots=True)
class LinkUp(Event):
    """A link, or the port of it that ``detail`` names, can be used."""

    link: str
    detail: str

    def text(self) -> str:
        """One line for people."""
        return f"{self.detail or self.link} is up"


@dataclass(frozen=True, slots=True)
class LinkDown(Event):
    """A link or a port of it is gone; the agent waits for it."""

    link: str
    reason: str

    def text(self) -> str:
        """One line for people."""
        return self.reason or f"{self.link} is down"


@dataclass(frozen=True, slots=True)
class _ClientEvent(Event):
    """Something that happened to the client with this ``key``."""

    key: int

    @property
    def client(self) -> str:
        """The client in words."""
        return client_name(self.key)


@dataclass(frozen=True, slots=True)
class _EntityEvent(_ClientEvent):
    """Something that happened to an entity of a client. ``object_id`` is the whole 16-bit ObjectId."""

    kind: int
    object_id: int

    @property
    def entity(self) -> str:
        """The entity in words."""
        return f"{self.client}: {KIND_NAMES[self.kind]} 0x{self.object_id:04X}"


@dataclass(frozen=True, slots=True)
class ClientConnected(_ClientEvent):
    """A session was made for a client that has none."""

    words = "{e.client} connected from {e.address}"
    session_id: int
    address: str


@dataclass(frozen=True, slots=True)
class ClientReady(_ClientEvent):
    """A client has made its entities: a summary, once it is quiet after creating some."""

    nodes: tuple[str, ...]
    writers: int
    readers: int
    requesters: int
    repliers: int

    def text(self) -> str:
        """One line for people."""
        parts = counted(
            writer=self.writers, reader=self.readers, service_client=self.requesters, service=self.repliers
        )
        node = "node " + ", ".join(self.nodes) if self.nodes else "no node"
        return f"{self.client}: {node}: {parts or 'no endpoints'}"


@dataclass(frozen=True, slots=True)
class ClientBack(_ClientEvent):
    """A known client began again or was heard again: its entities were kept. ``away`` is in seconds."""

    session_id: int
    address: str
    away: float
    restarted: bool
    """It sent CREATE_CLIENT: its streams began again. False: it goes on where it was, nothing was lost."""

    def text(self) -> str:
        """One line for people."""
        how = "its session began again" if self.restarted else "nothing acknowledged was lost"
        return f"{self.client} back after {self.away:.1f} s from {self.address}, {how}"


@dataclass(frozen=True, slots=True)
class ClientLost(_ClientEvent):
    """The way to a client is gone; the agent keeps its entities for ``kept`` seconds."""

    reason: str
    kept: float | None

    def text(self) -> str:
        """One line for people."""
        kept = "kept until it is back" if self.kept is None else f"kept for {self.kept:.0f} s"
        return f"{self.client} lost ({self.reason}), {kept}"


@dataclass(frozen=True, slots=True)
class ClientSilent(_ClientEvent):
    """A client owes acknowledgements and has not been heard for so many seconds; samples for it pile up."""

    words = "{e.client} silent for {e.silence:.0f} s: what it reads is not acknowledged"
    silence: float


@dataclass(frozen=True, slots=True)
class ClientGone(_ClientEvent):
    """A session and all its entities were removed."""

    words = "{e.client} gone: {e.reason}"
    session_id: int
    reason: str


@dataclass(frozen=True, slots=True)
class EntityCreated(_EntityEvent):
    """A client made an entity."""

    words = "{e.entity} created: {e.detail}"
    participant_id: int
    detail: str


@dataclass(frozen=True, slots=True)
class EntityDeleted(_EntityEvent):
    """A client deleted an entity."""

    words = "{e.entity} deleted: {e.detail}"
    detail: str
