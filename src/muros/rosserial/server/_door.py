"""The door between boards and the worlds they are in: topics, services, logs and parameters, in ROS 1 bytes.

A board's endpoints hand over and take whole ROS 1 messages, as they are in rosserial frames. A `World` gives each
board a `Node`; the ROS 2 graph converts there, a ROS 1 graph passes them on. What cannot be made raises
`RefusedError`, and a body that is not of its type `BodyError`; nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

__all__ = [
    "LATCHED",
    "READ_DEPTH",
    "BodyError",
    "Caller",
    "NamedService",
    "Node",
    "OnData",
    "OnReply",
    "Publisher",
    "RefusedError",
    "Server",
    "Shape",
    "Subscriber",
    "World",
]


LATCHED = frozenset({"/tf_static"})
"""Topics whose messages are kept for whoever comes new, without their publishers saying so in all worlds."""
READ_DEPTH = 1_000
"""Messages of one topic that a world keeps for a board while its line has no room; newer ones replace older ones."""


OnData = Callable[[], object]
"""Called when something comes where nothing was; take until None then."""
OnReply = Callable[[int, bytes], object]
"""Called with the number of a call and its answer."""


class NamedService(NamedTuple):
    """A service as a board names it: each half has a sum of its own."""

    name: str
    type_name: str
    request_md5: str
    response_md5: str


class RefusedError(Exception):
    """An endpoint cannot be had in this world: why, and what to do."""

    def __init__(self, why: str, remedy: str) -> None:
        super().__init__(f"{why}. {remedy}")
        self.why = why
        self.remedy = remedy


class BodyError(Exception):
    """The bytes are no message of that type; the text says where they are wrong."""


class Shape(Protocol):
    """What is known of the messages of an endpoint."""

    @property
    def size(self) -> int | None:
        """Bytes of every message in ROS 1, if they are all of one size."""

    @property
    def least_size(self) -> int:
        """Bytes of the shortest message."""

    @property
    def drift(self) -> str:
        """How the board's definition differs from the one of this world, in a sentence; empty if it does not."""


class Publisher(Shape, Protocol):
    """Where a board's messages go."""

    def publish(self, body: bytes) -> None:
        """Gives a message to whoever is there. Raises BodyError."""

    def close(self) -> None:
        """Takes it out of the world."""


class Subscriber(Shape, Protocol):
    """Where messages for a board wait; the oldest are dropped when they become too many."""

    @property
    def latched(self) -> bool:
        """Whether no message replaces another: publishers keep them for whoever comes new, as those of /tf_static."""

    def take(self) -> bytes | None:
        """The oldest message, None if there is none. Raises BodyError for one that cannot be converted."""

    def forget(self) -> None:
        """Drops what waits, but what a subscriber that comes new would be given."""

    def close(self) -> None:
        """Takes it out of the world."""


class Caller(Shape, Protocol):
    """A service that a board calls. The shape is that of responses."""

    def call(self, body: bytes) -> int:
        """Sends a request; returns its number, 0 if it could not be sent. Raises BodyError."""

    @property
    def ready(self) -> bool:
        """Whether a server is there."""

    def close(self) -> None:
        """Takes it out of the world."""


class Server(Shape, Protocol):
    """A service that a board serves. The shape is that of requests."""

    def take(self) -> tuple[Any, bytes] | None:
        """The oldest request with what names it, None if there is none. Raises BodyError."""

    def answer(self, request: Any, body: bytes) -> None:
        """Answers the request. Raises BodyError."""

    def fail(self, request: Any, text: str) -> None:
        """The board does not answer the request, for the reason ``text``; said to the caller where that is possible."""

    def close(self) -> None:
        """Takes it out of the world."""


class Node(Protocol):
    """A board in a world. Names are as the board says them: relative, absolute or private."""

    def publisher(self, name: str, type_name: str, md5: str) -> Publisher:
        """A new publisher. Raises RefusedError."""

    def subscriber(self, name: str, type_name: str, md5: str, on_data: OnData) -> Subscriber:
        """A new subscriber. Raises RefusedError."""

    def caller(self, service: NamedService, on_reply: OnReply) -> Caller:
        """A new client of a service; ``on_reply`` gets the answers. Raises RefusedError."""

    def server(self, service: NamedService, on_data: OnData) -> Server:
        """A new service. Raises RefusedError."""

    def time(self) -> int:
        """The time of this node, in ns: its world's, or another where nodes have one of their own."""

    def log(self, level: int, text: str) -> None:
        """The board says something; levels are 0 debug to 4 fatal."""

    def parameter(self, name: str) -> Any:
        """The value of a parameter: bool, int, float, str, or a list of these; None if it is not set."""

    def diagnose(self, text: str, level: int, values: dict[str, str]) -> None:
        """How the board is: a sentence, 0 good to 2 bad, and figures."""

    def close(self) -> None:
        """The board has left this world."""


class World(Protocol):
    """Where boards are."""

    def node(self, name: str, owner: str) -> Node:
        """A node for a board. ``name`` is full, ``owner`` is whom findings name. Raises RefusedError."""

    def time(self) -> int:
        """The time of this world, in ns: the wall clock's, or a simulation's."""
