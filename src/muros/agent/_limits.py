"""Every limit of an agent, with the reference agent's value as default where it has one."""

from dataclasses import dataclass

from muros.xrce.constants import AGENT_DEAD_TIME_MS, AGENT_HEARTBEAT_MS, AGENT_WINDOW

__all__ = ["Limits"]


_AT_LEAST_ONE = (
    "heartbeat",
    "dead_time",
    "max_clients",
    "max_objects",
    "max_streams",
    "max_sample",
    "max_waiting",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The limits of an agent; times in milliseconds, sizes in bytes. They are checked at use."""

    window: int = AGENT_WINDOW
    """Reliable messages in flight on each stream, either way; a power of two up to 16 (an ACKNACK names 16)."""
    heartbeat: int = AGENT_HEARTBEAT_MS
    """Period of HEARTBEATs while a client has not acknowledged everything."""
    dead_time: int = AGENT_DEAD_TIME_MS
    """Silence of a client after which it gets no more HEARTBEATs until it is heard again."""
    liveliness_tries: int = 3
    """Unanswered probes after which a client with hard liveliness is removed."""
    keep_lost: int | None = 30_000
    """How long a client whose connection or cable is gone is kept; None: until it says goodbye."""
    silent: int = 3_000
    """Silence, while it owes an acknowledgement, after which a client is said to be silent."""
    forget_silent: int | None = None
    """How long a silent client is kept; None: for ever, as the reference agent does."""
    max_clients: int = 10_000
    max_objects: int = 4_096
    """Entities of one client."""
    max_streams: int = 16
    """Input streams of one client, without stream 0."""
    max_sample: int = 1 << 22
    """Longest sample from a client, joined from its fragments."""
    max_joining: int = 1 << 26
    """Bytes in samples of all clients that are being joined."""
    max_sample_to_client: int = 65_527
    """Longest sample to a foreign client; one of muros takes up to ``max_sample``. Beyond 65527 bytes the length field
    of DATA is too short; it is sent as 0 then, which not every client may understand."""
    request_history: int = 16
    """Requests and replies kept for a client that does not read them yet."""
    max_waiting: int = 16_384
    """Messages that wait for the acknowledgements of a client; beyond that its requests wait too. One large sample to
    a client with a tiny MTU makes up to 8200."""
    outstanding_requests: int = 1_024
    """Requests of one requester that may wait for their reply; the oldest is given up."""
    stop_at_failure: bool = False
    """Drop what follows a failed submessage in its message, without a STATUS, as the reference agent does."""

    def __post_init__(self) -> None:
        if self.window not in (1, 2, 4, 8, 16):
            raise ValueError(f"window is {self.window}: it must be 1, 2, 4, 8 or 16 messages")
        for name in _AT_LEAST_ONE:
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}: it must be at least 1")
