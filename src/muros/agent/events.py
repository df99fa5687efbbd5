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
class ClientConnected(Event):
    """A session was made for a client that has none."""

    key: int
    session_id: int
    address: str

    def text(self) -> str:
        """One line for people."""
        return f"{client_name(self.key)} connected from {self.address}"


@dataclass(frozen=True, slots=True)
class ClientReady(Event):
    """A client has made its entities: a summary, once it is quiet after creating some."""

    key: int
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
        return f"{client_name(self.key)}: {node}: {parts or 'no endpoints'}"


@dataclass(frozen=True, slots=True)
class ClientBack(Event):
    """A known client began again or was heard again: its entities were kept. ``away`` is in seconds."""

    key: int
    session_id: int
    address: str
    away: float
    restarted: bool
    """It sent CREATE_CLIENT: its streams began again. False: it goes on where it was, nothing was lost."""

    def text(self) -> str:
        """One line for people."""
        how = "its session began again" if self.restarted else "nothing acknowledged was lost"
        return f"{client_name(self.key)} back after {self.away:.1f} s from {self.address}, {how}"


@dataclass(frozen=True, slots=True)
class ClientLost(Event):
    """The way to a client is gone; the agent keeps its entities for ``kept`` seconds."""

    key: int
    reason: str
    kept: float | None

    def text(self) -> str:
        """One line for people."""
        kept = "kept until it is back" if self.kept is None else f"kept for {self.kept:.0f} s"
        return f"{client_name(self.key)} lost ({self.reason}), {kept}"


@dataclass(frozen=True, slots=True)
class ClientSilent(Event):
    """A client owes acknowledgements and has not been heard for so many seconds; samples for it pile up."""

    key: int
    silence: float

    def text(self) -> str:
        """One line for people."""
        return f"{client_name(self.key)} silent for {self.silence:.0f} s: what it reads is not acknowledged"


@dataclass(frozen=True, slots=True)
class ClientGone(Event):
    """A session and all its entities were removed."""

    key: int
    session_id: int
    reason: str

    def text(self) -> str:
        """One line for people."""
        return f"{client_name(self.key)} gone: {self.reason}"


@dataclass(frozen=True, slots=True)
class EntityCreated(Event):
    """A client made an entity. ``object_id`` is the whole 16-bit ObjectId."""

    key: int
    kind: int
    object_id: int
    participant_id: int
    detail: str

    def text(self) -> str:
        """One line for people."""
        return (
            f"{client_name(self.key)}: {KIND_NAMES[self.kind]} 0x{self.object_id:04X} created: {self.detail}"
        )


@dataclass(frozen=True, slots=True)
class EntityDeleted(Event):
    """A client deleted an entity."""

    key: int
    kind: int
    object_id: int
    detail: str

    def text(self) -> str:
        """One line for people."""
        return (
            f"{client_name(self.key)}: {KIND_NAMES[self.kind]} 0x{self.object_id:04X} deleted: {self.detail}"
        )
