"""The IPv4 network interfaces of this host, which of them are meant, and when they come and go."""

import asyncio
import fcntl
import socket
import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Final

from muros.links._hosts import interface_addresses
from muros.rtps.net._environment import NetworkError

__all__ = ["Interface", "Watch", "chosen", "interfaces", "require"]

POLL_PERIOD: Final = 3.0
"""Seconds between two looks at the interfaces where the kernel does not tell of changes."""
SETTLING: Final = 0.05
"""Seconds after a change until they are looked at: changes come in swarms."""

_SIOCGIFFLAGS = 0x8913
_UP_AND_RUNNING = 0x1 | 0x40
_LOOPBACK = 0x8
_MULTICAST = 0x1000
_IFREQ = struct.Struct("16sH22x")

_NETLINK_GROUPS = 0x1 | 0x10
"""RTMGRP_LINK and RTMGRP_IPV4_IFADDR."""


@dataclass(frozen=True, slots=True)
class Interface:
    """A network interface that is up and running, with its IPv4 addresses."""

    name: str
    index: int
    """The kernel's number for it; one that went and came has another."""
    addresses: tuple[str, ...]
    loopback: bool
    multicast: bool
    """Whether multicast may be sent through it. Loopback does so whatever it says of itself."""


def interfaces() -> tuple[Interface, ...]:
    """All that are up, run (the cable is in) and have an IPv4 address; loopback last."""
    addresses: dict[str, list[str]] = {}
    for entry in interface_addresses(4):
        addresses.setdefault(entry.interface.partition(":")[0], []).append(str(entry.address))
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for name, own in addresses.items():
            try:
                answer = fcntl.ioctl(probe, _SIOCGIFFLAGS, _IFREQ.pack(name.encode(), 0))
                index = socket.if_nametoindex(name)
            except OSError:  # gone since
                continue
            flags = _IFREQ.unpack(answer)[1]
            if flags & _UP_AND_RUNNING == _UP_AND_RUNNING:
                loopback = bool(flags & _LOOPBACK)
                found.append(
                    Interface(name, index, tuple(sorted(own)), loopback, loopback or bool(flags & _MULTICAST))
                )
    return tuple(sorted(found, key=lambda interface: (interface.loopback, interface.index)))


def chosen(present: Iterable[Interface], names: tuple[str, ...], *, secluded: bool) -> tuple[Interface, ...]:
    """Those of `present` that are meant by `names` (all if there are none); loopback only if `secluded`.

    Of an interface that is named by an address, only that address is kept.
    """
    meant = []
    for interface in present:
        own = interface.addresses
        if names and interface.name not in names:
            own = tuple(address for address in own if address in names)
        if own and (interface.loopback or not secluded):
            meant.append(replace(interface, addresses=own))
    return tuple(meant)


def require(names: tuple[str, ...]) -> tuple[str, ...]:
    """Those of `names` that are not there now. NetworkError when none is and none can come up."""
    present = interfaces()
    known = {interface.name for interface in present} | {a for i in present for a in i.addresses}
    existing = {name for _, name in socket.if_nameindex()}
    missing = tuple(name for name in names if name not in known)
    if names and len(missing) == len(names) and not existing.intersection(names):
        those = ", ".join(f"{interface.name} ({', '.join(interface.addresses)})" for interface in present)
        why = "this host has no such network interface or address"
        raise NetworkError(", ".join(names), why, f"Choose one of: {those or 'none is up now'}.")
    return missing


class Watch:
    """Calls `changed` when interfaces or addresses have come or gone: told by the kernel (Linux), else by looking.

    `changed` may be called without a change.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, changed: Callable[[], object]) -> None:
        self._loop = loop
        self._changed = changed
        self._timer: asyncio.TimerHandle | None = None
        self._socket = _netlink()
        if self._socket is None:
            self._timer = loop.call_later(POLL_PERIOD, self._look)
        else:
            loop.add_reader(self._socket, self._told)

    @property
    def fileno(self) -> int | None:
        """The kernel's channel; None where there is none."""
        return None if self._socket is None else self._socket.fileno()

    def close(self) -> None:
        """Ends it."""
        if self._timer is not None:
            self._timer.cancel()
        if self._socket is not None:
            if not self._loop.is_closed():
                self._loop.remove_reader(self._socket)
            self._socket.close()

    def abandon(self) -> None:
        """Lets go of what a forked child has inherited, without touching what it shares with its parent."""
        if self._socket is not None:
            self._socket.close()

    def _told(self) -> None:
        assert self._socket is not None
        try:
            while self._socket.recv(65536):
                pass
        except BlockingIOError:
            pass
        except OSError:  # told more than fits the buffer
            pass
        if self._timer is None:
            self._timer = self._loop.call_later(SETTLING, self._look)

    def _look(self) -> None:
        self._timer = None
        if self._socket is None:
            self._timer = self._loop.call_later(POLL_PERIOD, self._look)
        self._changed()


def _netlink() -> socket.socket | None:
    """A socket that becomes readable when links or IPv4 addresses change; None where there is no such thing."""
    if not hasattr(socket, "AF_NETLINK"):
        return None
    try:
        channel = socket.socket(
            socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK, 0
        )
    except OSError:
        return None
    try:
        channel.bind((0, _NETLINK_GROUPS))
    except OSError:
        channel.close()
        return None
    return channel
