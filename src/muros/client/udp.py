"""UDP to an agent, over IPv4 or IPv6. MicroPython allocates each received datagram; nothing else is allocated."""

import errno
import socket

from muros.client.stream import Stream
from muros.compat import MPY, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client._types import Deliver
    from muros.xrce._types import Buffer

_MTU = const(512)
_AT_ONCE = const(16)
_LARGEST = const(65535)


class Udp(Stream):
    """Datagrams to ``host`` (a name or an address of either family), which is resolved once.

    The socket, and with it our address at the agent, lasts until ``close``, also while the agent is away.
    """

    def __init__(self, host: str, port: int = 8888, mtu: int = _MTU) -> None:
        self.mtu = mtu
        self._host = host
        self._port = port
        self._error: "int | None" = None

    def open(self) -> bool:
        """Opens the socket; OSError when the host's name is unknown."""
        if self._file is None:
            info = socket.getaddrinfo(self._host, self._port, 0, socket.SOCK_DGRAM)[0]
            made: "Any" = socket.socket(info[0], socket.SOCK_DGRAM)
            try:
                made.setblocking(False)
                made.connect(info[-1])
            except OSError:
                made.close()
                raise
            self._attach(made, made.recv, made.write if MPY else made.send)
        return True

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends a datagram; one that the system has no room for is lost like any other."""
        if self._file is None:
            return
        try:
            if MPY:
                self._put(buf, off, n)
            else:
                self._put(memoryview(buf)[off : off + n])
        except OSError as error:
            if error.errno != errno.EAGAIN:
                self._error = error.errno

    def receive(self, deliver: "Deliver") -> int:
        """Delivers up to 16 datagrams."""
        if self._error is not None:
            error_number, self._error = self._error, None
            raise OSError(error_number)
        taken = 0
        try:
            while taken < _AT_ONCE and self._file is not None:
                if MPY and not self._readable(0):
                    break  # asking costs no memory, an exception does
                data = self._get(self.mtu if MPY else _LARGEST)
                taken += 1
                deliver(data, 0, len(data))
        except OSError as error:
            if error.errno != errno.EAGAIN:
                raise
        return taken
