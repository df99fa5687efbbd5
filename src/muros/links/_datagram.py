"""What links over datagram sockets share: draining on readiness, and a bounded queue for a socket that is full."""

from __future__ import annotations

import asyncio
import errno
import socket
from abc import abstractmethod
from collections import deque

from muros.links._door import NETWORK, PORT_GONE, QUEUE_FULL, Address, Cause, Link

DRAIN = 64
"""Datagrams taken in one wake-up before other links get their turn."""
QUEUE_BYTES = 1 << 20
"""Bytes that may wait for a socket to become writable."""
RETRY_FULL_S = 0.001
"""Wait after ENOBUFS in seconds: a full device queue does not tell when it has room."""


class DatagramLink(Link):
    """A link on one socket that keeps message boundaries. Subclasses make the socket and know its addresses."""

    def __init__(self, drain: int, queue_bytes: int) -> None:
        super().__init__()
        self._drain = drain
        self._queue_bytes = queue_bytes
        self._queue: deque[tuple[bytes, Address]] = deque()
        self._queued = 0
        self._retry: asyncio.TimerHandle | None = None
        self._socket: socket.socket | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    def _send(self, message: bytes, address: Address) -> Cause | None:
        if self._socket is None:
            return PORT_GONE
        if self._queue:
            return self._enqueue(message, address)
        try:
            self._transmit(self._socket, message, address)
        except BlockingIOError:
            self._wait_writable()
            return self._enqueue(message, address)
        except OSError as error:
            if error.errno != errno.ENOBUFS:
                return _refused(error)
            self._wait_device()
            return self._enqueue(message, address)
        return None

    @abstractmethod
    def _transmit(self, sock: socket.socket, message: bytes, address: Address) -> None:
        """Hands one message to the socket."""

    @abstractmethod
    def _receive(self, sock: socket.socket) -> tuple[bytes, Address] | None:
        """One message from the socket; None for a datagram that is not one (and has been counted)."""

    def _receive_failed(self, error: OSError) -> None:
        """An error other than an empty socket. Most are left over from an earlier send: nothing is lost."""

    def _start(self, sock: socket.socket) -> None:
        self._socket = sock
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock, self._readable)

    def _close(self) -> None:
        sock, self._socket = self._socket, None
        if sock is not None and self._loop is not None:
            self._loop.remove_reader(sock)
            self._loop.remove_writer(sock)
            sock.close()
        if self._retry is not None:
            self._retry.cancel()
            self._retry = None
        self._queue.clear()
        self._queued = 0

    def _readable(self) -> None:
        sock = self._socket
        receive = self._receive
        deliver = self._deliver
        for _ in range(self._drain):
            if sock is None or sock is not self._socket:  # a handler has closed the link
                return
            try:
                got = receive(sock)
            except (BlockingIOError, InterruptedError):
                return
            except OSError as error:
                self._receive_failed(error)
                continue
            if got is not None:
                deliver(*got)

    def _enqueue(self, message: bytes, address: Address) -> Cause | None:
        if self._queue and self._queued + len(message) > self._queue_bytes:
            return QUEUE_FULL
        self._queue.append((message, address))
        self._queued += len(message)
        return None

    def _flush(self) -> None:
        self._retry = None
        for _ in range(self._drain):
            if self._socket is None or not self._queue:
                break
            message, address = self._queue[0]
            try:
                self._transmit(self._socket, message, address)
            except (BlockingIOError, InterruptedError):
                self._wait_writable()
                return
            except OSError as error:
                if error.errno == errno.ENOBUFS:
                    self._wait_device()
                    return
                self.counters.sent -= 1
                self.counters.sent_bytes -= len(message)
                self._drop(_refused(error), len(message), address)
            if self._queue:  # else a handler has closed the link
                self._queue.popleft()
                self._queued -= len(message)
        if self._queue:
            self._wait_writable()
        elif self._socket is not None and self._loop is not None:
            self._loop.remove_writer(self._socket)

    def _wait_writable(self) -> None:
        if self._loop is not None and self._socket is not None:
            self._loop.add_writer(self._socket, self._flush)

    def _wait_device(self) -> None:
        if self._loop is not None and self._socket is not None:
            self._loop.remove_writer(self._socket)
            self._retry = self._loop.call_later(RETRY_FULL_S, self._flush)


def _refused(error: OSError) -> Cause:
    return NETWORK._replace(why=f"the network refused it ({error.strerror or error})")
