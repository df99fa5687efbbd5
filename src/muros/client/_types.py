"""Types of the client's doors; imported by type checkers only."""

from collections.abc import Callable
from typing import Protocol, TypedDict

from muros.xrce._types import Buffer

OnData = Callable[[Buffer, int, int], object]
"""Takes a sample: ``on_data(buf, off, n)``; the bytes are only lent."""
Deliver = Callable[[Buffer, int, int], object]
"""Takes a message from a transport: ``deliver(buf, off, n)``; the bytes are only lent."""


class Outgoing(Protocol):
    """What can be sent."""

    def size(self) -> int:
        """Bytes of the body."""

    def write(self, buf: bytearray, off: int, /) -> int:
        """Writes the body at ``off`` and returns its end."""


class Message(Outgoing, Protocol):
    """What generated message classes offer."""

    def read(self, buf: Buffer, off: int, n: int, /) -> object:
        """Takes the body ``buf[off:off + n]``; raises ValueError when it is malformed."""


class Transport(Protocol):
    """A way to an agent that carries whole messages."""

    mtu: int

    def open(self) -> bool:
        """Opens the way, or finds it open; False or OSError when that is not possible yet. Does not block for long."""

    def close(self) -> None:
        """Closes the way; ``open`` may be called again."""

    def send(self, buf: Buffer, off: int, n: int) -> object:
        """Sends a message. Never raises: when the way is gone, the next ``receive`` does."""

    def receive(self, deliver: Deliver) -> int:
        """Calls ``deliver`` for each message that has come, up to a bound, and returns their number.

        Raises OSError when the way is gone.
        """

    def wait(self, timeout: int) -> object:
        """Waits until something has come, at most ``timeout`` ms."""


class Options(TypedDict, total=False):
    """The settings of a ``Session``."""

    creation: str
    reference: str
    properties: bool
    hard_liveliness: int
    queue: int
    largest: int
    heartbeat: int
    retry: int
    creation_timeout: int
    destroy_timeout: int
    keepalive: int
    ping_timeout: int
    ping_attempts: int


class SessionOptions(Options, total=False):
    """All that a ``Session`` is told besides its transport and its key."""

    session_id: int
    mtu: int
    history: int
