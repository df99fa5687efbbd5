"""UDP: one message in a datagram, any number of peers on one socket; and the socket that answers discovery."""

from __future__ import annotations

import asyncio
import errno
import socket
import struct
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, ClassVar

from muros.links._datagram import DRAIN, QUEUE_BYTES, DatagramLink
from muros.links._door import Address, Cause, LinkError, Locator
from muros.links._hosts import interface_addresses
from muros.links._sockets import ANY, bound_socket, join, socket_locators

if TYPE_CHECKING:
    from muros.links._sockets import SocketAddress

AGENT_PORT = 8888
"""The port that examples of XRCE agents use."""
DISCOVERY_PORT = 7400
DISCOVERY_GROUP = "239.255.0.2"
"""Where clients, those of micro-ROS among them, look for agents."""
RECEIVE_BUFFER_BYTES = 4 << 20
"""Wanted receive buffer of the socket; the kernel grants at most net.core.rmem_max."""
JOIN_PERIOD_S = 5.0
"""How often a discovery link looks for network interfaces that have come up, in seconds."""

OVERFLOW = Cause(
    "receive-buffer-full",
    "they came faster than they could be handled, and the socket's buffer was full",
    "Allow a larger buffer: sudo sysctl net.core.rmem_max=8388608; or send less often.",
)

_SO_RCVBUFFORCE = 33
_SO_MEMINFO = 55
_MEMINFO = struct.Struct("=9I")
_MEMINFO_DROPS = 8
_LARGEST = {4: 65507, 6: 65527}
_RECEIVE_BYTES = 65536


class UdpLink(DatagramLink):
    """Datagrams on ``port`` (0: any free one, `port` then tells it) of ``host`` (default: every address).

    ``family`` is 4 or 6. An address is what the socket gives: ``(host, port)``, with flow label and scope for IPv6;
    hosts in it are numeric. ``drain`` is the number of datagrams taken in one wake-up, ``queue_bytes`` bounds what
    waits when the socket is full, ``receive_buffer`` is asked of the kernel in bytes.
    """

    kind: ClassVar[str] = "udp"

    def __init__(
        self,
        port: int = AGENT_PORT,
        host: str | None = None,
        *,
        family: int = 4,
        drain: int = DRAIN,
        queue_bytes: int = QUEUE_BYTES,
        receive_buffer: int = RECEIVE_BUFFER_BYTES,
    ) -> None:
        super().__init__(drain, queue_bytes)
        self.port = port
        self.host = ANY[family] if host is None else host
        self.family = family
        self.mtu = _LARGEST[family]
        self._receive_buffer = receive_buffer
        self._overflown = 0

    @property
    def name(self) -> str:
        return f"{self.kind}{self.family} {join(self.host, self.port)}"

    def describe(self, address: Address) -> str:
        return _describe(address)

    def locators(self) -> list[Locator]:
        return socket_locators(self.family, self.host, self.port)

    def _open(self) -> None:
        sock = self._bind()
        _enlarge(sock, self._receive_buffer)
        self._overflown = 0
        self.host, self.port = sock.getsockname()[:2]
        self._start(sock)
        self._up(self.name)

    def _bind(self) -> socket.socket:
        return bound_socket(f"{self.kind}{self.family}", self.family, "udp", self.host, self.port)

    def _readable(self) -> None:
        super()._readable()
        if self._socket is not None:
            overflown = _overflown(self._socket)
            if overflown != self._overflown:
                n = (overflown - self._overflown) & 0xFFFF_FFFF
                self._overflown = overflown
                self.counters.dropped[OVERFLOW.code] += n
                self._problem(OVERFLOW, f"messages to {self.name} lost", n)

    def _receive(self, sock: socket.socket) -> tuple[bytes, SocketAddress]:
        return sock.recvfrom(_RECEIVE_BYTES)

    def _transmit(self, sock: socket.socket, message: bytes, address: Address) -> None:
        sock.sendto(message, address)  # type: ignore[call-overload]


class DiscoveryLink(UdpLink):
    """Hears clients that look for an agent, by multicast to ``group`` or directly to ``port``; `discovery_only`.

    ``interface`` is the name or the address of the one interface whose multicast is heard; default all, also those
    that come up later. Other programs, DDS participants among them, may have the same port: what is sent to it
    directly reaches only one of them, multicast reaches all.
    """

    kind: ClassVar[str] = "discovery"
    discovery_only = True

    def __init__(
        self,
        port: int = DISCOVERY_PORT,
        *,
        group: str = DISCOVERY_GROUP,
        interface: str | None = None,
        drain: int = DRAIN,
    ) -> None:
        super().__init__(port, family=4, drain=drain)
        self.group = group
        self.interface = interface
        self._joined: set[int] = set()
        self._timer: asyncio.TimerHandle | None = None

    @property
    def name(self) -> str:
        return f"{self.kind} {join(self.group, self.port)}"

    def locators(self) -> list[Locator]:
        return []

    def _open(self) -> None:
        super()._open()
        if self.interface is not None and self._named_interface() is None:
            known = ", ".join(sorted({entry.interface for entry in interface_addresses(4)})) or "none"
            why = f"no interface {self.interface} that is up and has an IPv4 address"
            raise LinkError(self.name, why, f"Choose one of: {known}.")
        self._join()
        if not self._joined:
            cause = Cause(
                "no-multicast",
                "no network interface takes part in multicast now",
                "Nothing if the network comes up later; else `ip link set <interface> multicast on`.",
            )
            self._problem(cause, f"clients cannot discover this agent through {self.group}")

    def _bind(self) -> socket.socket:
        return bound_socket(self.kind, 4, "udp", self.host, self.port, share=True)

    def _close(self) -> None:
        super()._close()
        self._joined.clear()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _join(self) -> None:
        """Joins the group on interfaces that are new, and comes back for those still to come."""
        if self._socket is None or self._loop is None:
            return
        present = self._interfaces()
        self._joined &= present  # a new index is a new interface, even under an old name
        for index in sorted(present - self._joined):
            request = struct.pack("4s4si", IPv4Address(self.group).packed, bytes(4), index)
            try:
                self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, request)
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    continue
            self._joined.add(index)
        self._timer = self._loop.call_later(JOIN_PERIOD_S, self._join)

    def _interfaces(self) -> set[int]:
        if self.interface is not None:
            names = {self._named_interface()}
        else:
            names = {entry.interface for entry in interface_addresses(4)}
        present = set()
        for name in names - {None}:
            try:
                present.add(socket.if_nametoindex(str(name).partition(":")[0]))
            except OSError:  # gone since
                continue
        return present

    def _named_interface(self) -> str | None:
        for entry in interface_addresses(4):
            if self.interface in (entry.interface, str(entry.address)):
                return entry.interface
        return None


def _describe(address: Address) -> str:
    if isinstance(address, tuple) and len(address) >= 2:
        return join(str(address[0]), int(address[1]))
    return str(address)


def _enlarge(sock: socket.socket, size: int) -> None:
    try:
        sock.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, size)  # beyond net.core.rmem_max, for root
    except OSError:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)


def _overflown(sock: socket.socket) -> int:
    """Datagrams that the kernel has thrown away because the socket's buffer was full; counts modulo 2**32."""
    try:
        return int(
            _MEMINFO.unpack(sock.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMINFO.size))[_MEMINFO_DROPS]
        )
    except (OSError, struct.error):  # a kernel that does not tell
        return 0
