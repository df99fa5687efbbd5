"""Where to send to a peer: of the addresses it gives, the one that surely works.

A peer with several interfaces gives all their addresses, but each sample shall reach it once. The address from which
its announcement came is known to work. On one host the loopback is quickest and never down, if the peer listens there.
Whether it is one host is told by that address, too, and not by those that are given: machines have addresses of
bridges and containers in common.
"""

from collections.abc import Iterable

from muros.rtps._domain_settings import Addresses
from muros.rtps._values import UDP4, UDP6, Locator

__all__ = ["INSIDE", "Hosts", "is_loopback", "is_multicast"]

INSIDE = Locator(-1, 0, bytes(16))
"""Stands for the participants of this process. LOCATOR_KIND_INVALID: never on the wire (DDSI-RTPS 2.3, 9.3.2)."""

_LOOPBACK6 = bytes(15) + b"\1"


def is_loopback(locator: Locator) -> bool:
    """Whether it is this host's address for itself."""
    if locator.kind == UDP4:
        return locator.address[12] == 127
    return locator.kind == UDP6 and locator.address == _LOOPBACK6


def is_multicast(locator: Locator) -> bool:
    """Whether it names a group."""
    if locator.kind == UDP4:
        return 224 <= locator.address[12] < 240
    return locator.kind == UDP6 and locator.address[0] == 0xFF


class Hosts:
    """The addresses of this process, as needed to choose among those of peers."""

    __slots__ = ("_kinds", "_ours")

    def __init__(self, addresses: Addresses) -> None:
        self._ours = frozenset(
            (at.kind, at.address) for at in (*addresses.metatraffic_unicast, *addresses.default_unicast)
        )
        self._kinds = frozenset({UDP4, *(kind for kind, _ in self._ours)})

    def has(self, at: Locator) -> bool:
        """Whether this is a place on this host."""
        return is_loopback(at) or (at.kind, at.address) in self._ours

    def choose(self, offered: Iterable[Locator], source: Locator | None) -> tuple[Locator, ...]:
        """The one of `offered` to send to, nothing when none can be reached. `source`: where the peer spoke from.

        The loopback is taken only from peers on this host, and there even when this process does not announce it.
        """
        here = source is None or is_loopback(source) or (source.kind, source.address) in self._ours
        usable = []
        for at in offered:
            if at.kind in self._kinds and 0 < at.port < 65536 and any(at.address) and not is_multicast(at):
                if here and is_loopback(at):
                    return (at,)
                if here or not (is_loopback(at) or (at.kind, at.address) in self._ours):
                    usable.append(at)
        if not usable:
            return ()
        return (max(usable, key=lambda at: self._nearness(at, source)),)

    def _nearness(self, at: Locator, source: Locator | None) -> int:
        """How likely it is to work: the peer's source, else the more it has in common with an address of ours."""
        if source is not None and (at.kind, at.address) == (source.kind, source.address):
            return 129
        number = int.from_bytes(at.address, "big")
        return max(
            (
                128 - (number ^ int.from_bytes(address, "big")).bit_length()
                for kind, address in self._ours
                if kind == at.kind
            ),
            default=0,
        )
