"""Types of the doors of rclc; imported by type checkers only."""

from collections.abc import Callable
from typing import Any, Protocol

from muros.client._types import Message
from muros.client.qos import Qos
from muros.client.services import OnReply, OnRequest
from muros.xrce._types import Buffer


class Entity(Protocol):
    """What a middleware has made."""

    def destroy(self) -> None:
        """Takes it away again."""


class Publisher(Entity, Protocol):
    """Writes messages."""

    def publish(self, message: Message, /) -> bool:
        """Sends a message; False when it was not taken."""


class Requester(Entity, Protocol):
    """Sends requests."""

    def room(self) -> bool:
        """Whether a request that is sent now can go out."""

    def send(self, request: Message, /) -> int:
        """Sends a request; its number, 0 when it was not taken."""


class Replier(Entity, Protocol):
    """Answers requests."""

    def room(self) -> bool:
        """Whether an answer can go out now."""

    def reply(self, identity: bytes, reply: Message, /) -> bool:
        """Answers the request of that identity; False when it was not taken."""


class Middleware(Protocol):
    """What carries rclc: a session with an agent, or a data space.

    Topics are named as in DDS, services and types as in ROS.
    """

    state: int
    on_state: Callable[[int], object] | None
    on_problem: Callable[[int, str], object] | None

    def participant(self, name: str, domain: int = 0, /) -> Any:
        """A node."""

    def writer(
        self, participant: Any, topic: str, type_name: str, qos: str | Qos = "default", /
    ) -> Publisher:
        """A writer."""

    def reader(
        self,
        participant: Any,
        topic: str,
        type_name: str,
        qos: str | Qos = "default",
        on_data: Callable[[Buffer, int, int], object] | None = None,
        /,
    ) -> Entity:
        """A reader."""

    def requester(
        self,
        participant: Any,
        name: str,
        type_name: str,
        on_reply: OnReply,
        qos: str | Qos = "services",
        /,
    ) -> Requester:
        """A client of a service."""

    def replier(
        self,
        participant: Any,
        name: str,
        type_name: str,
        on_request: OnRequest,
        qos: str | Qos = "services",
        /,
    ) -> Replier:
        """A server of a service."""

    def spin_once(self, now: int | None = None, /) -> int:
        """Does what is due and takes what has come."""

    def wait(self, timeout: int, /) -> None:
        """Waits until something may have come, at most ``timeout`` ms."""

    def deadline(self, now: int, /) -> int:
        """Milliseconds until ``spin_once`` is wanted."""

    def ping(self, timeout: int, clock: Callable[[], int], /) -> bool:
        """Whether the other side answers within ``timeout`` ms of ``clock``."""

    def close(self) -> None:
        """Ends."""
