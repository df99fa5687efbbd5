"""A core that only notes what the network does with it, in place of `muros.rtps.DomainCore`."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest

from muros.rtps import Addresses, Locator
from muros.rtps.net import _network


class NotingCore:
    """Has the doors of `DomainCore` that the network uses."""

    def __init__(
        self,
        domain: int,
        transmit: Callable[[bytes, Locator], object],
        addresses: Addresses,
        **_: Any,
    ) -> None:
        self.domain = domain
        self.transmit = transmit
        self.addresses = addresses
        self.counters: Counter[str] = Counter()
        self.deadline: int | None = None
        self.received: list[tuple[bytes, Locator, int]] = []
        self.told: list[Addresses] = []
        self.ticks: list[int] = []
        self.closed = 0
        self.on_receive: Callable[[bytes], object] = lambda datagram: None

    def receive(self, datagram: bytes, source: Locator, now: int) -> None:
        if datagram.startswith(b"RTPS"):
            return  # of somebody else on this machine who takes no domain of his own
        self.received.append((datagram, source, now))
        self.on_receive(datagram)

    def set_addresses(self, addresses: Addresses, now: int) -> None:
        self.addresses = addresses
        self.told.append(addresses)

    def tick(self, now: int) -> None:
        self.ticks.append(now)
        self.deadline = None

    def close(self, now: int) -> None:
        self.closed += 1
        for locator in self.addresses.announce_to[:1]:
            self.transmit(b"farewell", locator)


def install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Networks made from now on have a `NotingCore`."""
    monkeypatch.setattr(_network, "DomainCore", NotingCore)
