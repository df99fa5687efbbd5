"""What this host can say about itself: its addresses, and which process holds a port or a device.

All of it is read from the kernel's own tables (Linux); where they are missing the answer is empty, never an error.
"""

from __future__ import annotations

import fcntl
import os
import socket
import struct
from array import array
from ipaddress import IPv4Address, IPv6Address
from pathlib import Path
from typing import NamedTuple

_SIOCGIFCONF = 0x8912
_IFNAMSIZ = 16
_IFREQ_BYTES = _IFNAMSIZ + (24 if struct.calcsize("P") == 8 else 16)
_IFREQ_START = 32
_IFREQ_MOST = 8192


class InterfaceAddress(NamedTuple):
    """An address of a network interface that is up."""

    interface: str
    address: IPv4Address | IPv6Address


def interface_addresses(family: int) -> list[InterfaceAddress]:
    """The addresses of this host for ``family`` 4 or 6: those of other hosts' use first, loopback last."""
    found = _ipv4_addresses() if family == 4 else _ipv6_addresses()
    return sorted(found, key=lambda entry: (entry.address.is_loopback, entry.address.is_link_local))


def port_holder(protocol: str, port: int) -> str | None:
    """The process that has ``port`` of ``protocol`` (``udp`` or ``tcp``) bound: ``name (pid 4711)``, or None."""
    inodes = set()
    for table in (protocol, protocol + "6"):
        for line in _lines(Path("/proc/net") / table)[1:]:
            words = line.split()
            if len(words) > 9 and words[1].endswith(f":{port:04X}") and words[3] in ("07", "0A"):
                inodes.add(f"socket:[{words[9]}]")
    return _holder_of(inodes)


def file_holder(path: str) -> str | None:
    """A process that has the device ``path`` open: ``name (pid 4711)``, or None."""
    return _holder_of({os.path.realpath(path)})


def _ipv4_addresses() -> list[InterfaceAddress]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        entries = _IFREQ_START
        while True:
            buffer = array("B", bytes(entries * _IFREQ_BYTES))
            address, size = buffer.buffer_info()
            try:
                answer = fcntl.ioctl(probe, _SIOCGIFCONF, struct.pack("iP", size, address))
            except OSError:
                return []
            used = struct.unpack("iP", answer)[0]
            if used < size or entries >= _IFREQ_MOST:
                break
            entries *= 2  # the kernel cuts its list short without a word
    found = []
    for start in range(0, used, _IFREQ_BYTES):
        name = bytes(buffer[start : start + _IFNAMSIZ]).split(b"\0")[0].decode(errors="replace")
        found.append(InterfaceAddress(name, IPv4Address(bytes(buffer[start + 20 : start + 24]))))
    return found


def _ipv6_addresses() -> list[InterfaceAddress]:
    found = []
    for line in _lines(Path("/proc/net/if_inet6")):
        words = line.split()
        found.append(InterfaceAddress(words[5], IPv6Address(bytes.fromhex(words[0]))))
    return found


def _holder_of(targets: set[str]) -> str | None:
    if not targets:
        return None
    for process in sorted(int(name) for name in os.listdir("/proc") if name.isdecimal()):
        folder = f"/proc/{process}/fd"
        try:
            if any(_points_to(f"{folder}/{number}", targets) for number in os.listdir(folder)):
                return f"{Path(f'/proc/{process}/comm').read_text().strip()} (pid {process})"
        except OSError:  # gone meanwhile, or another user's
            continue
    return None


def _points_to(link: str, targets: set[str]) -> bool:
    try:
        return os.readlink(link) in targets
    except OSError:
        return False


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text().splitlines()
    except OSError:
        return []
