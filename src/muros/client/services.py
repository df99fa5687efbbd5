"""Requesters and repliers, the two sides of a service (DDS-XRCE 1.0, 7.7.3.9, and the reference agent's data formats).

A request is a WRITE_DATA on the requester; its reply comes as DATA that begins with the request id and the object id
of that WRITE_DATA. At the replier a request begins with the identity of its sample in DDS, 24 bytes, and the reply
has to begin with the same.
"""

from struct import pack_into

from muros.client.session import Entity
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client._types import Message
    from muros.xrce._types import Buffer

    OnReply = Callable[[int, Buffer, int, int], object]
    OnRequest = Callable[[bytes, Buffer, int, int], object]

_CONNECTED = const(2)
_IDENTITY = const(24)


class Service(Entity):
    """What both sides share."""

    def __init__(self, callback: "Any") -> None:
        self.callback = callback

    def room(self) -> bool:
        """Whether a sample that is written now can go out."""
        session = self.session
        stream = self.stream
        return (
            session.state == _CONNECTED
            and session.backlog is None
            and self.todo == 0
            and stream.next - stream.first & 0xFFFF < stream.history
        )


class Requester(Service):
    """The client's side. ``callback(number, buf, off, n)`` gets replies, with the number that ``send`` gave."""

    def send(self, request: "Message") -> int:
        """Sends a request; its number, or 0 when it was not taken."""
        return self.session.request if self.publish(request) else 0

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a reply."""
        if n >= 4:
            self.callback(buf[off] << 8 | buf[off + 1], buf, off + 4, n - 4)


class Replier(Service):
    """The server's side. ``callback(identity, buf, off, n)`` gets requests; ``reply`` answers them, at any time.

    What it publishes is itself: the reply behind the identity of the request.
    """

    if TYPE_CHECKING:
        _identity: bytes
        _reply: "Message"

    def reply(self, identity: bytes, reply: "Message") -> bool:
        """Answers the request of that identity; False when it was not taken."""
        self._identity = identity
        self._reply = reply
        return self.publish(self)

    def size(self) -> int:
        """Bytes of the body."""
        return _IDENTITY + self._reply.size()

    def write(self, buf: bytearray, off: int) -> int:
        """Writes the body at ``off`` and returns its end."""
        pack_into("24s", buf, off, self._identity)
        return self._reply.write(buf, off + _IDENTITY)

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a request."""
        if n >= _IDENTITY:
            self.callback(bytes(buf[off : off + _IDENTITY]), buf, off + _IDENTITY, n - _IDENTITY)
