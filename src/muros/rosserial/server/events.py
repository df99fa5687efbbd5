"""What happens at a rosserial server, as values: who came, who left, what was set up. ``text()`` says it for people.

What went wrong is not an event but a finding.
"""

from dataclasses import dataclass

from muros.links import voice

__all__ = [
    "BoardBack",
    "BoardGone",
    "BoardHeard",
    "BoardLog",
    "BoardLost",
    "BoardReady",
    "BoardReset",
    "BufferKnown",
    "EndpointSetUp",
    "Event",
    "LineDown",
    "LineUp",
]

LEVELS = ("DEBUG", "INFO", "WARN", "ERROR", "FATAL")
"""The levels of logs, by their numbers."""

_VERSIONS = {0xFE: "hydro or later", 0xFF: "groovy or earlier"}


@dataclass(frozen=True, slots=True)
class Event(voice.Event):
    """Something that happened to ``board``, which is named by its line; ``severity`` is 1 info or 2 warning."""

    severity = 1
    board: str


@dataclass(frozen=True, slots=True)
class LineUp(Event):
    """A line can be used: a port was opened, or a connection came. The server asks for topics."""

    words = "{e.board} is up. Requesting topics..."


@dataclass(frozen=True, slots=True)
class LineDown(Event):
    """A line or a whole link is gone; the server waits for it."""

    severity = 2
    reason: str

    def text(self) -> str:
        """One line for people."""
        return self.reason or f"{self.board} is down"


@dataclass(frozen=True, slots=True)
class BoardHeard(Event):
    """The first good frame of a board; ``version`` is the second byte of its frames."""

    version: int
    baud: int = 0
    """The rate of its line in bits per second; 0 if it has none, or its own."""

    def text(self) -> str:
        """One line for people."""
        rate = f" at {self.baud} baud" if self.baud else ""
        return f"board {self.board} speaks rosserial{rate} ({_VERSIONS.get(self.version, hex(self.version))})"


@dataclass(frozen=True, slots=True)
class BufferKnown(Event):
    """A board has said how much it can send (``publish``) or take (``subscribe``) at once, in bytes."""

    words = "Note: {e.way} buffer size is {e.size} bytes"
    way: str
    size: int


@dataclass(frozen=True, slots=True)
class EndpointSetUp(Event):
    """A board's topic or service is in the graph. The texts are those that rosserial users know."""

    words = "Setup {e.kind} on {e.name} [{e.type_name}]"
    kind: str
    """``publisher``, ``subscriber``, ``service server`` or ``service client``."""
    name: str
    type_name: str
    buffer_size: int


@dataclass(frozen=True, slots=True)
class BoardReady(Event):
    """A board has said what it has, and nothing more for a while."""

    node: str
    publishers: int
    subscribers: int
    servers: int
    clients: int
    seconds: float
    """Since it was asked first."""

    def text(self) -> str:
        """One line for people."""
        parts = voice.counted(
            publisher=self.publishers,
            subscriber=self.subscribers,
            service=self.servers,
            service_client=self.clients,
        )
        return f"board {self.board}: node {self.node}: {parts or 'no topics'}"


@dataclass(frozen=True, slots=True)
class BoardReset(Event):
    """A board has started again, or believes itself unconnected; it was asked for its topics anew."""

    severity = 2
    words = "board {e.board} started again. Requesting topics..."


@dataclass(frozen=True, slots=True)
class BoardLost(Event):
    """A board is silent or its line is gone; its endpoints stay for ``kept`` seconds."""

    severity = 2
    words = "Lost sync with device, restarting: board {e.board} ({e.reason}), kept for {e.kept:.0f} s"
    reason: str
    kept: float


@dataclass(frozen=True, slots=True)
class BoardBack(Event):
    """A lost board is heard again; ``away`` is in seconds."""

    words = "board {e.board} back after {e.away:.1f} s"
    away: float


@dataclass(frozen=True, slots=True)
class BoardGone(Event):
    """A board and its endpoints were removed."""

    words = "board {e.board} gone: {e.reason}"
    reason: str


@dataclass(frozen=True, slots=True)
class BoardLog(Event):
    """A board says something; ``level`` is 0 debug to 4 fatal."""

    level: int
    message: str

    def text(self) -> str:
        """One line for people."""
        level = LEVELS[self.level] if self.level < len(LEVELS) else str(self.level)
        shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in self.message)
        return f"[{level}] {self.board}: {shown}"
