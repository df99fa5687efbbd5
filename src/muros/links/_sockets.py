"""Binding an Internet socket, with errors that say who is in the way; naming and listing its addresses."""

from __future__ import annotations

import errno
import socket
from ipaddress import ip_address
from typing import TypeAlias

from muros.links._door import LinkError, Locator
from muros.links._hosts import interface_addresses, port_holder

SocketAddress: TypeAlias = tuple[str, int] | tuple[str, int, int, int]
"""What the socket functions use: (host, port), for IPv6 with flow label and scope."""

FAMILIES = {4: socket.AF_INET, 6: socket.AF_INET6}
ANY = {4: "0.0.0.0", 6: "::"}


def bound_socket(
    kind: str, family: int, protocol: str, host: str, port: int, *, share: bool = False
) -> socket.socket:
    """A non-blocking socket bound to ``host`` and ``port``; ``protocol`` is ``udp`` or ``tcp``. Raises `LinkError`."""
    where = f"{kind} {join(host, port)}"
    sort = socket.SOCK_DGRAM if protocol == "udp" else socket.SOCK_STREAM
    try:
        sock = socket.socket(FAMILIES[family], sort | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)
    except OSError as error:
        remedy = f"This system offers no IPv{family}: choose {kind[:-1]}{10 - family}."
        raise LinkError(where, error.strerror or str(error), remedy) from error
    try:
        if share or protocol == "tcp":
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family == 6:
            sock.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)  # leaves the port free for IPv4
        sock.bind((host, port))
        if protocol == "tcp":
            sock.listen(socket.SOMAXCONN)
    except (OSError, OverflowError) as error:
        sock.close()
        raise _bind_error(where, protocol, family, host, port, error) from error
    return sock


def join(host: str, port: int) -> str:
    """``host:port``, an IPv6 address in brackets."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def socket_locators(family: int, host: str, port: int) -> list[Locator]:
    """Where a socket bound to ``host`` can be reached: there, or at each address of the host if it is bound to any."""
    bound = ip_address(host.partition("%")[0])
    if bound.is_unspecified:
        return [
            Locator(family, entry.address.packed, port)
            for entry in interface_addresses(family)
            if family == 4 or not entry.address.is_link_local  # without its scope no peer could use it
        ]
    return [Locator(family, bound.packed, port)]


def _bind_error(where: str, protocol: str, family: int, host: str, port: int, error: Exception) -> LinkError:
    number = error.errno if isinstance(error, OSError) else None
    if isinstance(error, OverflowError):
        return LinkError(where, "there is no such port", "Ports go from 0 (any free one) to 65535.")
    if number == errno.EADDRINUSE:
        holder = port_holder(protocol, port)
        by = f" by {holder}" if holder else ""
        find = "" if holder else f" See who has it: sudo ss -lnp 'sport = :{port}'."
        return LinkError(where, f"address in use{by}", f"Stop it or choose another port.{find}")
    if number in (errno.EACCES, errno.EPERM):
        return LinkError(where, "permission denied", "Ports below 1024 belong to root: choose a higher one.")
    if number == errno.EADDRNOTAVAIL or isinstance(error, socket.gaierror):
        own = ", ".join(str(entry.address) for entry in interface_addresses(family)) or "none"
        return LinkError(
            where, "this host has no such address", f"Choose one of its own ({own}) or {ANY[family]}."
        )
    return LinkError(where, str(getattr(error, "strerror", None) or error), "Check the address and the port.")
