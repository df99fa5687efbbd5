"""TCP to an agent, over IPv4 or IPv6: every message behind its length, u16 little endian."""

import errno
import socket

from muros.client.stream import Stream
from muros.compat import MPY, const, copy

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client._types import Deliver
    from muros.xrce._types import Buffer

_MTU = const(512)
_AT_ONCE = const(16)
_HEAD = const(2)
_TCP_NODELAY = const(1)
_IPPROTO_TCP = const(6)
_POLLOUT = const(4)


class Tcp(Stream):
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
        self._connected = False
        self._head = bytearray(_HEAD)
        self._rx = bytearray(_HEAD + mtu)
        self._have = 0  # bytes of the next message, and its length, that are here
        self._skip = 0  # bytes of a too long message to pass over

    def open(self) -> bool:
        """Begins to connect, or tells whether that is done; OSError when it failed."""
        if self._file is None:
            if self._info is None:
                self._info = socket.getaddrinfo(self._host, self._port, 0, socket.SOCK_STREAM)[0]
            made: "Any" = socket.socket(self._info[0], socket.SOCK_STREAM)
            made.setblocking(False)
            self._attach(made, made.recv, made.write if MPY else made.send)
            self._connected = False
            self._have = self._skip = 0
            try:
                made.connect(self._info[-1])
            except OSError as error:
                if error.errno not in (errno.EINPROGRESS, errno.EAGAIN):
                    self.close()
                    raise
        if not self._connected:
            events = self._writable(0)
            if not events:
                return False
            if events & ~_POLLOUT:
                self.close()
                raise OSError(errno.ECONNREFUSED)
            self._connected = True
            try:
                self._file.setsockopt(_IPPROTO_TCP, _TCP_NODELAY, 1)
            except (OSError, AttributeError):  # a board whose network stack has no such option
                pass
        return True

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends a message whole. A connection that takes nothing for two seconds is closed."""
        head = self._head
        head[0] = n & 255
        head[1] = n >> 8
        if self._write(head, 0, _HEAD):
            self._write(buf, off, n)

    def receive(self, deliver: "Deliver") -> int:
        """Delivers up to 16 messages; OSError when the connection is gone."""
        if self._file is None:
            raise OSError(self._gone)
        taken = 0
        while taken < _AT_ONCE:
            want = _HEAD if self._have < _HEAD else _HEAD + (self._rx[0] | self._rx[1] << 8)
            if self._have >= _HEAD and (want == _HEAD or want > len(self._rx)):
                self.too_long += 1
                self._skip = want - _HEAD
                self._have = 0
                continue
            got = self._fill(self._skip or want - self._have)
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

    def _fill(self, n: int) -> int:
        """Reads up to ``n`` bytes behind those that are here, or over them when they are to be skipped."""
        at = 0 if self._skip else self._have
        data = self._read(min(n, len(self._rx) - at))
        if data is None:
            return 0
        copy(self._rx, at, data, 0, len(data))
        return len(data)
