"""The sockets of a domain in one process: a pair of unicast ports of its own, and one it shares for multicast.

The well-known ports (DDSI-RTPS 2.3, 9.6.1) give each process a participant index; the first index whose two ports
are both free is taken. All its participants use them. The multicast port belongs to every process of the host that
is in the domain.
"""

import errno
import socket
import struct
from dataclasses import dataclass
from typing import Final

from muros.links._hosts import port_holder
from muros.rtps._constants import Ports
from muros.rtps.net._environment import NetworkError
from muros.rtps.net._interfaces import Interface

__all__ = [
    "Pair",
    "bind_multicast",
    "bind_pair",
    "granted",
    "join",
    "leave",
    "multicast_sender",
    "overflown",
]

HOLDERS_NAMED: Final = 3
"""Processes named when all ports are taken."""

_SO_RCVBUFFORCE = 33
_SO_SNDBUFFORCE = 32
_SO_MEMINFO = 55
_MEMINFO = struct.Struct("=9I")
_MEMINFO_DROPS = 8
_IP_MULTICAST_ALL = 49
_MREQN = struct.Struct("4s4si")


@dataclass(frozen=True, slots=True)
class Pair:
    """The unicast sockets of one participant index."""

    index: int
    metatraffic: socket.socket
    user: socket.socket


def bind_pair(ports: Ports, host: str, indices: int) -> Pair:
    """Binds the two ports of the first free of `indices` participant indices on `host`. Raises `NetworkError`."""
    taken: list[int] = []
    for index in range(indices):
        try:
            numbers = ports.unicast(index), ports.user_unicast(index)
        except ValueError:  # past the last port there is
            break
        bound: list[socket.socket] = []
        try:
            for number in numbers:
                bound.append(_bound(host, number))
        except OSError as error:
            for sock in bound:
                sock.close()
            if error.errno != errno.EADDRINUSE:
                raise _cannot(host, numbers[len(bound)], error) from error
            taken.append(numbers[len(bound)])
            continue
        return Pair(index, *bound)
    raise _all_taken(ports, taken)


def bind_multicast(group: str, port: int) -> socket.socket:
    """A socket for what comes to `group` at `port`, on interfaces that are still to be joined."""
    sock = _socket()
    try:
        for name in ("SO_REUSEADDR", "SO_REUSEPORT"):  # peers set the one or the other: both must agree
            if hasattr(socket, name):
                sock.setsockopt(socket.SOL_SOCKET, getattr(socket, name), 1)
        sock.bind((group, port))
        _option(sock, _IP_MULTICAST_ALL, 0)  # not what others on this host have joined
    except OSError as error:
        sock.close()
        raise _cannot(group, port, error) from error
    return sock


def multicast_sender(interface: Interface, hops: int) -> socket.socket:
    """A socket whose multicast goes out through `interface`, and back to this host. OSError when it is gone."""
    sock = _socket()
    try:
        request = _MREQN.pack(bytes(4), socket.inet_aton(interface.addresses[0]), interface.index)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, request)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, hops)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
    except OSError:
        sock.close()
        raise
    return sock


def join(sock: socket.socket, group: str, interface: Interface) -> bool:
    """Takes part in `group` on `interface`. False when it is not possible."""
    try:
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, _membership(group, interface.index))
    except OSError as error:
        return error.errno == errno.EADDRINUSE
    return True


def leave(sock: socket.socket, group: str, index: int) -> None:
    """Ends what `join` began; the interface may be gone."""
    try:
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_DROP_MEMBERSHIP, _membership(group, index))
    except OSError:
        return


def granted(sock: socket.socket, size: int) -> int:
    """Asks for buffers of `size` bytes, and beyond the system's limit where that is allowed; what it can receive."""
    for forced, option in ((_SO_SNDBUFFORCE, socket.SO_SNDBUF), (_SO_RCVBUFFORCE, socket.SO_RCVBUF)):
        try:
            sock.setsockopt(socket.SOL_SOCKET, forced, size)
        except OSError:
            sock.setsockopt(socket.SOL_SOCKET, option, size)
    return (
        sock.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2
    )  # the kernel doubles it for its own needs


def overflown(sock: socket.socket) -> int:
    """Datagrams that the kernel threw away because the buffer was full, modulo 2**32; 0 where it does not tell."""
    try:
        told = sock.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMINFO.size)
        return int(_MEMINFO.unpack(told)[_MEMINFO_DROPS])
    except (OSError, struct.error):
        return 0


def _socket() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)


def _bound(host: str, port: int) -> socket.socket:
    sock = _socket()
    try:
        sock.bind((host, port))
    except OSError:
        sock.close()
        raise
    return sock


def _option(sock: socket.socket, option: int, value: int) -> None:
    try:
        sock.setsockopt(socket.IPPROTO_IP, option, value)
    except OSError:  # not on this system
        return


def _membership(group: str, index: int) -> bytes:
    return _MREQN.pack(socket.inet_aton(group), bytes(4), index)


def _cannot(host: str, port: int, error: OSError) -> NetworkError:
    where = f"udp {host}:{port}"
    if error.errno == errno.EADDRINUSE:
        holder = port_holder("udp", port)
        why = f"address in use by {holder}" if holder else "address in use"
        return NetworkError(where, why, "End the program that does not share it, or choose another domain.")
    return NetworkError(where, error.strerror or str(error), "Check the interfaces and the domain.")


def _all_taken(ports: Ports, taken: list[int]) -> NetworkError:
    where = f"udp ports {taken[0]} to {taken[-1] + 1}" if taken else f"udp ports from {ports.base}"
    holders = dict.fromkeys(filter(None, (port_holder("udp", port) for port in taken[:HOLDERS_NAMED])))
    by = f" by {', '.join(holders)}" if holders else ""
    more = " and others" if holders and len(taken) > HOLDERS_NAMED else ""
    domain = (ports.base - Ports(0).base) // 250
    why = f"the ports of all {len(taken)} participant indices of domain {domain} are in use{by}{more}"
    return NetworkError(where, why, "End some of them, or choose another domain.")
