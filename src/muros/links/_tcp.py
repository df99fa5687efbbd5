"""TCP: a 16-bit length before each message, many connections, each with its own bounded queue."""

from __future__ import annotations

import asyncio
import errno
import socket
from contextlib import suppress
from functools import partial
from typing import ClassVar

from muros.links._door import NO_PEER, QUEUE_FULL, Address, Cause, Link, Locator
from muros.links._framing import MESSAGE_BYTES, LengthFraming, MakeFraming
from muros.links._sockets import ANY, bound_socket, join, socket_locators
from muros.links._stream import READ_BYTES, Channel
from muros.links._udp import AGENT_PORT

CONNECTIONS = 100
"""Connections held at the same time, as upstream agents have it."""
QUEUE_BYTES = 256 * 1024
"""Bytes that may wait for one slow connection, beyond what the kernel buffers."""
KEEPALIVE_S = 10
"""Silence in seconds after which a connection is probed; it is given up after three more of a third of that."""
UNACKNOWLEDGED_MS = 30_000
"""A connection whose data nobody acknowledges for so long is given up."""

_ACCEPTS = 16
_FULL_PAUSE_S = 1.0


class TcpLink(Link):
    """Connections to ``port`` (0: any free one) of ``host`` (default: every address); ``family`` is 4 or 6.

    An address is the far end's ``(host, port)``. At most ``connections`` are held, further ones are closed at once.
    ``queue_bytes`` bounds what waits for each, ``read_bytes`` what is read from one before the others have their turn.
    ``make_framing`` cuts the streams: XRCE's by default.
    """

    kind: ClassVar[str] = "tcp"
    mtu = MESSAGE_BYTES

    def __init__(
        self,
        port: int = AGENT_PORT,
        host: str | None = None,
        *,
        family: int = 4,
        connections: int = CONNECTIONS,
        queue_bytes: int = QUEUE_BYTES,
        keepalive: int = KEEPALIVE_S,
        read_bytes: int = READ_BYTES,
        make_framing: MakeFraming = LengthFraming,
    ) -> None:
        super().__init__()
        self.port = port
        self.host = ANY[family] if host is None else host
        self.family = family
        self._limit = connections
        self._queue_bytes = queue_bytes
        self._keepalive = keepalive
        self._read_bytes = read_bytes
        self._make_framing = make_framing
        self._listener: socket.socket | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._resume: asyncio.TimerHandle | None = None
        self._connections: dict[Address, _Connection] = {}

    @property
    def name(self) -> str:
        return f"{self.kind}{self.family} {join(self.host, self.port)}"

    @property
    def peers(self) -> list[Address]:
        """The addresses that are connected now."""
        return list(self._connections)

    def backlog(self, address: Address) -> int:
        connection = self._connections.get(address)
        return 0 if connection is None else connection.channel.queued

    def describe(self, address: Address) -> str:
        return join(str(address[0]), int(address[1])) if isinstance(address, tuple) else str(address)

    def locators(self) -> list[Locator]:
        return socket_locators(self.family, self.host, self.port)

    def _send(self, message: bytes, address: Address) -> Cause | None:
        connection = self._connections.get(address)
        if connection is None:
            return NO_PEER
        return None if connection.channel.send(message, 0) else QUEUE_FULL

    def _open(self) -> None:
        kind = f"{self.kind}{self.family}"
        self._listener = bound_socket(kind, self.family, "tcp", self.host, self.port)
        self.host, self.port = self._listener.getsockname()[:2]
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._listener, self._accept)
        self._up(self.name)

    def _close(self) -> None:
        if self._resume is not None:
            self._resume.cancel()
            self._resume = None
        if self._listener is not None and self._loop is not None:
            self._loop.remove_reader(self._listener)
            self._listener.close()
            self._listener = None
        for connection in self._connections.values():
            connection.channel.stop()
            connection.sock.close()
        self._connections.clear()

    def _accept(self) -> None:
        for _ in range(_ACCEPTS):
            if self._listener is None:
                return
            try:
                sock, address = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno not in (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM):
                    continue  # that one connection has failed already
                self._pause(error)
                return
            old = self._connections.get(address)
            if old is not None:  # it came to another address of this host
                old.channel.stop()
                self._ended(old, "replaced by a new one")
            if self._listener is None:  # a handler has closed the link
                sock.close()
            elif len(self._connections) >= self._limit:
                sock.close()
                self._refuse(address)
            else:
                self._connections[address] = _Connection(self, sock, address)
                self._peer(address)

    def _refuse(self, address: Address) -> None:
        self.counters.dropped["too-many-connections"] += 1
        cause = Cause(
            "too-many-connections",
            f"{self._limit} clients are connected, and no more are allowed",
            "Allow more with the argument connections (muros agent tcp4: --connections).",
        )
        self._problem(cause, f"connection from {self.describe(address)} refused")

    def _pause(self, error: OSError) -> None:
        """Without this, a connection that cannot be accepted would wake the loop for ever."""
        if self._listener is None or self._loop is None:
            return
        self._loop.remove_reader(self._listener)
        self._resume = self._loop.call_later(
            _FULL_PAUSE_S, self._loop.add_reader, self._listener, self._accept
        )
        cause = Cause(
            "cannot-accept", error.strerror or str(error), "Raise the limit of open files: ulimit -n."
        )
        self._problem(cause, f"new connections to {self.name} wait")

    def _messages(self, connection: _Connection, messages: list[tuple[bytes, int]]) -> None:
        for message, _ in messages:
            self._deliver(message, connection.address)

    def _damaged(self, connection: _Connection, errors: dict[str, int]) -> None:
        self.counters.framing.update(errors)
        cause = Cause(
            "bad-frames",
            "a length of 0, or longer than is taken, stood before a message",
            "Check that the peer speaks DDS-XRCE over TCP.",
        )
        self._problem(
            cause, f"bytes from {self.describe(connection.address)} passed over", sum(errors.values())
        )

    def _ended(self, connection: _Connection, reason: str) -> None:
        connection.sock.close()
        del self._connections[connection.address]
        known = reason.startswith(("closed", "replaced"))
        self._gone(connection.address, f"connection {reason}" if known else f"connection lost ({reason})")


class _Connection:
    def __init__(self, link: TcpLink, sock: socket.socket, address: Address) -> None:
        self.sock = sock
        self.address = address
        sock.setblocking(False)
        with suppress(OSError):  # reset already: the first read will tell
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            _keep_alive(sock, link._keepalive)
        self.channel = Channel(
            sock.fileno(),
            link._make_framing(),
            link._queue_bytes,
            partial(link._messages, self),
            partial(link._damaged, self),
            partial(link._ended, self),
            link._read_bytes,
            partial(link._room, address),
        )


def _keep_alive(sock: socket.socket, idle: int) -> None:
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, idle)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, max(1, idle // 3))
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS)
