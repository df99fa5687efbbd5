"""TCP to an agent, over IPv4 or IPv6: every message behind its length, u16 little endian."""

import errno
import select
import socket

from muros.compat import MPY, const, copy, ticks_diff, ticks_ms

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client._types import Deliver
    from muros.xrce._types import Buffer

_MTU = const(512)
_AT_ONCE = const(16)
_HEAD = const(2)
_PATIENCE = const(2000)  # ms that the system may take none of our bytes
_TCP_NODELAY = const(1)
_IPPROTO_TCP = const(6)
_POLLOUT = const(4)


class Tcp:
    """A TCP connection to ``host`` (a name or an address of either family), which is resolved once.

    Connecting does not block; a connection that breaks is made again by ``open``. Longer messages than ``mtu`` are
    passed over and counted in ``too_long``.
    """

    def __init__(self, host: str, port: int = 8888, mtu: int = _MTU) -> None:
        self.mtu = mtu
        self.too_long = 0
        self._host = host
        self._port = port
        self._info: "Any" = None
        self._socket: "Any" = None
        self._connected = False
        self._head = bytearray(_HEAD)
        self._rx = bytearray(_HEAD + mtu)
        self._have = 0  # bytes of the next message, and its length, that are here
        self._skip = 0  # bytes of a too long message to pass over

    def open(self) -> bool:
        """Begins to connect, or tells whether that is done; OSError when it failed."""
        if self._socket is None:
            if self._info is None:
                self._info = socket.getaddrinfo(self._host, self._port, 0, socket.SOCK_STREAM)[0]
            made: "Any" = socket.socket(self._info[0], socket.SOCK_STREAM)
            made.setblocking(False)
            self._socket = made
            self._have = self._skip = 0
            self._poll = select.poll()
            self._poll.register(made, select.POLLIN)
            try:
                made.connect(self._info[-1])
            except OSError as error:
                if error.errno not in (errno.EINPROGRESS, errno.EAGAIN):
                    self.close()
                    raise
        if not self._connected:
            self._poll.modify(self._socket, _POLLOUT)
            ready = self._poll.poll(0)
            self._poll.modify(self._socket, select.POLLIN)
            if not ready:
                return False
            if ready[0][1] & ~_POLLOUT:
                self.close()
                raise OSError(errno.ECONNREFUSED)
            self._connected = True
            try:
                self._socket.setsockopt(_IPPROTO_TCP, _TCP_NODELAY, 1)
            except (OSError, AttributeError):  # a board whose network stack has no such option
                pass
        return True

    def close(self) -> None:
        """Closes the connection."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
            self._connected = False

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends a message whole. A connection that takes nothing for two seconds is closed."""
        if self._socket is None:
            return
        head = self._head
        head[0] = n & 255
        head[1] = n >> 8
        if self._write(head, 0, _HEAD):
            self._write(buf, off, n)

    def receive(self, deliver: "Deliver") -> int:
        """Delivers up to 16 messages; OSError when the connection is gone."""
        if self._socket is None:
            raise OSError(errno.ECONNRESET)
        taken = 0
        while taken < _AT_ONCE:
            want = _HEAD if self._have < _HEAD else _HEAD + (self._rx[0] | self._rx[1] << 8)
            if self._have >= _HEAD and (want == _HEAD or want > len(self._rx)):
                self.too_long += 1
                self._skip = want - _HEAD
                self._have = 0
                continue
            got = self._read(self._skip or want - self._have)
            if got == 0:
                break
            if self._skip:
                self._skip -= got
                continue
            self._have += got
            if self._have == want and want > _HEAD:
                self._have = 0
                taken += 1
                deliver(self._rx, _HEAD, want - _HEAD)
        return taken

    def wait(self, timeout: int) -> None:
        """Waits until bytes are there, at most ``timeout`` ms."""
        self._readable(timeout)

    def _readable(self, timeout: int) -> bool:
        if not MPY:
            return bool(self._poll.poll(timeout))
        for _ in self._poll.ipoll(timeout):
            return True
        return False

    def _read(self, n: int) -> int:
        """Reads up to ``n`` bytes behind those that are here, or over them when they are to be skipped."""
        at = 0 if self._skip else self._have
        if n > len(self._rx) - at:
            n = len(self._rx) - at
        if not self._readable(0):
            return 0
        data = self._socket.recv(n)
        if not data:
            self.close()
            raise OSError(errno.ECONNRESET)
        copy(self._rx, at, data, 0, len(data))
        return len(data)

    def _write(self, buf: "Buffer", off: int, n: int) -> bool:
        start = ticks_ms()
        while n:
            try:
                if MPY:
                    done = self._socket.write(buf, off, n)
                else:
                    done = self._socket.send(memoryview(buf)[off : off + n])
            except OSError as error:
                if error.errno != errno.EAGAIN:
                    self.close()
                    return False
                done = 0
            if not done:
                if ticks_diff(ticks_ms(), start) > _PATIENCE:
                    self.close()
                    return False
                self._poll.modify(self._socket, _POLLOUT)
                self._poll.poll(10)
                self._poll.modify(self._socket, select.POLLIN)
                continue
            off += done
            n -= done
        return True
