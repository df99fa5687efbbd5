"""Every limit of a rosserial server, with its default."""

from dataclasses import dataclass

from muros.rosserial.constants import SLOW_FRAME_MS

__all__ = ["Limits"]

_AT_LEAST_ONE = (
    "ask",
    "quiet",
    "settle",
    "lead",
    "backlog",
    "max_boards",
    "max_endpoints",
    "max_requests",
    "max_payload",
    "depth",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The limits of a rosserial server; times in milliseconds, sizes in bytes."""

    ask: int = 1_000
    """Period of topic requests while a board does not answer."""
    settle: int = 300
    """Silence after the last TopicInfo until a board counts as ready; there is no end mark."""
    check: int = 500
    """Period of looking, while a board sends nothing, whether it has started again; 0: never."""
    silent: int = 3_500
    """Silence of a board that asks for the time every 2.5 s, after which it is asked for its topics again."""
    quiet: int = 1_500
    """Silence of a board of Groovy after which it is asked for its topics: nothing else tells of a restart."""
    lost: int = 11_000
    """Silence after which a board counts as lost: ros_lib itself gives the connection up then."""
    keep_lost: int = 30_000
    """How long a lost board's endpoints are kept."""
    answer: int = 1_000
    """How long a board's service may take for an answer, besides the time on the line."""
    lead: int = 20
    """How far the server writes ahead of a line whose rate is known; what is urgent waits so long at most."""
    backlog: int = 10
    """Messages of one topic that wait for a line whose rate is known; older ones make room for newer ones."""
    slow_frame: int = SLOW_FRAME_MS
    """A frame that takes longer on the line is warned about: many boards drop it."""
    diagnostics: int = 1_000
    """Period of diagnostics; 0: none."""
    max_boards: int = 256
    max_endpoints: int = 256
    """Topics and halves of services of one board."""
    max_requests: int = 64
    """Requests of a board's service client that may wait for an answer, and frames that may wait for its line."""
    max_payload: int = 65_535
    """Longest payload taken from a board that has not said how long its buffer is."""
    depth: int = 1_000
    """Messages of a board that the graph keeps for readers that are slower."""
    input_buffer: int = 512
    """The board's input buffer where none was announced: it has no subscriber."""

    def __post_init__(self) -> None:
        for name in _AT_LEAST_ONE:
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}: it must be at least 1")
