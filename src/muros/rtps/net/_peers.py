"""The addresses of static peers: names are looked up without holding anybody up, and again from time to time."""

import asyncio
import socket
from collections.abc import Callable
from typing import Final

from muros.rtps._constants import Ports
from muros.rtps._values import Locator, udp4
from muros.rtps.net._environment import NetworkSettings, split_peer
from muros.rtps.net._outlets import Notice, Tell

__all__ = ["Peers"]

AGAIN: Final = 60.0
"""Seconds until a name that was found is looked up again: its host may have moved."""
RETRY: Final = 5.0
"""Seconds until a name that was not found is looked up again."""
ADDRESSES: Final = 8
"""Addresses of one name that are used."""


class Peers:
    """Looks up the hosts of `settings.peers`; `changed` is called when their addresses have changed."""

    def __init__(self, settings: NetworkSettings, changed: Callable[[], object], tell: Tell) -> None:
        self._settings = settings
        self._changed = changed
        self._tell = tell
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timers: dict[str, asyncio.TimerHandle] = {}
        self._names: list[str] = []
        self._hosts: dict[str, tuple[str, ...]] = {}
        for peer in settings.peers:
            host, _ = split_peer(peer)
            try:
                udp4(host, 0)
            except ValueError:
                if host == "localhost":
                    self._hosts[host] = ("127.0.0.1",)
                elif host not in self._names:
                    self._names.append(host)
            else:
                self._hosts[host] = (host,)

    def locators(self) -> tuple[Locator, ...]:
        """Where they are looked for: the port given with a peer, else the well-known ones of a host."""
        ports = Ports(self._settings.domain)
        well_known = ports_of(ports, self._settings.known_indices)
        found: dict[Locator, None] = {}
        for peer in self._settings.peers:
            host, port = split_peer(peer)
            for address in self._hosts.get(host, ()):
                for number in well_known if port is None else (port,):
                    found[udp4(address, number)] = None
        return tuple(found)

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begins to look up names."""
        self._loop = loop
        for name in self._names:
            self._look_up(name)

    def close(self) -> None:
        """Ends it."""
        self._loop = None
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()

    def _look_up(self, name: str) -> None:
        if self._loop is not None:
            self._loop.run_in_executor(None, _addresses, name).add_done_callback(
                lambda done: self._found(name, () if done.cancelled() else done.result())
            )

    def _found(self, name: str, addresses: tuple[str, ...]) -> None:
        if self._loop is None:  # closed meanwhile
            return
        self._timers[name] = self._loop.call_later(AGAIN if addresses else RETRY, self._look_up, name)
        if not addresses:
            self._tell(_UNKNOWN, name, 1)  # an address it had may still be right
        elif addresses != self._hosts.get(name):
            self._hosts[name] = addresses
            self._changed()


def ports_of(ports: Ports, indices: int) -> tuple[int, ...]:
    """The discovery ports of the first participant indices of a host."""
    numbers = []
    for index in range(indices):
        try:
            numbers.append(ports.unicast(index))
        except ValueError:  # past the last port there is
            break
    return tuple(numbers)


def _addresses(name: str) -> tuple[str, ...]:
    try:
        found = socket.getaddrinfo(name, None, socket.AF_INET, socket.SOCK_DGRAM)
    except (OSError, UnicodeError):
        return ()
    return tuple(sorted({str(entry[4][0]) for entry in found}))[:ADDRESSES]


_UNKNOWN: Final = Notice(
    "dds-peer-unknown",
    "the static peer {subject} has not been found",
    "its name has no IPv4 address now",
    "Check the name in ROS_STATIC_PEERS or the name service; it is tried again by itself.",
)
