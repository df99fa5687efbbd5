"""UDP to an agent, over IPv4 or IPv6. MicroPython allocates each received datagram; nothing else is allocated."""

import errno
import select
import socket

from muros.compat import MPY, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client._types import Deliver
    from muros.xrce._types import Buffer

_MTU = const(512)
_AT_ONCE = const(16)
_LARGEST = const(65535)


class Udp:
    """Datagrams to ``host`` (a name or an address of either family), which is resolved once.

    The socket, and with it our address at the agent, lasts until ``close``, also while the agent is away.
    """

    def __init__(self, host: str, port: int = 8888, mtu: int = _MTU) -> None:
        self.mtu = mtu
        self._host = host
        self._port = port
        self._socket: "Any" = None
        self._error: "int | None" = None

    def open(self) -> bool:
        """Opens the socket; OSError when the host's name is unknown."""
        if self._socket is None:
            info = socket.getaddrinfo(self._host, self._port, 0, socket.SOCK_DGRAM)[0]
            made: "Any" = socket.socket(info[0], socket.SOCK_DGRAM)
            try:
                made.setblocking(False)
                made.connect(info[-1])
            except OSError:
                made.close()
                raise
            self._poll = select.poll()
            self._poll.register(made, select.POLLIN)
            self._write = made.write if MPY else None
            self._socket = made
        return True

    def close(self) -> None:
        """Closes the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends a datagram; one that the system has no room for is lost like any other."""
        try:
            if self._write is not None:
                self._write(buf, off, n)
            else:
                self._socket.send(memoryview(buf)[off : off + n])
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
            while taken < _AT_ONCE:
                if MPY and not self._readable(0):
                    break  # asking costs no memory, an exception does
                data = self._socket.recv(self.mtu if MPY else _LARGEST)
                taken += 1
                deliver(data, 0, len(data))
        except OSError as error:
            if error.errno != errno.EAGAIN:
                raise
        return taken

    def wait(self, timeout: int) -> None:
        """Waits until a datagram is there, at most ``timeout`` ms."""
        self._readable(timeout)

    def _readable(self, timeout: int) -> bool:
        if not MPY:
            return bool(self._poll.poll(timeout))
        for _ in self._poll.ipoll(timeout):
            return True
        return False
