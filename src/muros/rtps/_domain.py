"""All participants of this process in one domain."""

from collections import Counter
from collections.abc import Callable

from muros.rtps._domain_settings import DOMAIN_DEFAULTS, NOWHERE, Addresses, DomainSettings, Transmit
from muros.rtps._news import DomainReport, ParticipantEvent
from muros.rtps._participant import ParticipantCore
from muros.rtps._values import GuidPrefix, Locator

__all__ = ["DomainCore"]


class DomainCore:
    """All participants of this process in one domain: parses a datagram once and hands its events to those meant."""

    domain: int
    settings: DomainSettings
    addresses: Addresses
    counters: Counter[str]
    """What came and went: ``datagrams``, ``sent``, ``malformed``, ``echoes``, ``foreign``, ``unmatched``, ..."""

    def __init__(
        self,
        domain: int,
        transmit: Transmit,
        addresses: Addresses = NOWHERE,
        *,
        settings: DomainSettings = DOMAIN_DEFAULTS,
        report: Callable[[DomainReport], object] | None = None,
    ) -> None:
        raise NotImplementedError

    @property
    def deadline(self) -> int | None:
        """When `tick` is needed next (ns on the clock of `now`, may lie in the past); None = not by itself."""
        raise NotImplementedError

    @property
    def participants(self) -> tuple[ParticipantCore, ...]:
        """Those of this process."""
        raise NotImplementedError

    def participant(
        self,
        prefix: GuidPrefix,
        *,
        now: int,
        name: str = "",
        user_data: bytes = b"",
        properties: tuple[tuple[str, str], ...] = (),
        lease: int | None = None,
        on_event: Callable[[ParticipantEvent], object] | None = None,
    ) -> ParticipantCore:
        """A new participant. ValueError: `prefix` is not 12 bytes or in use here, or the domain is closed."""
        raise NotImplementedError

    def receive(self, datagram: bytes, source: Locator | None, now: int) -> None:
        """A datagram has come. Never raises for what is in it; counts."""
        raise NotImplementedError

    def set_addresses(self, addresses: Addresses, now: int) -> None:
        """Interfaces came or went: tell everybody."""
        raise NotImplementedError

    def tick(self, now: int) -> int | None:
        """Do what is due; returns the new `deadline`."""
        raise NotImplementedError

    def close(self, now: int) -> None:
        """Close all participants."""
        raise NotImplementedError
