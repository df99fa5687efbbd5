"""The dds space: the ROS 2 graph, spoken by `muros.rtps`."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from muros import __version__
from muros._distros import NEW_DISTROS, OLD_DISTROS
from muros.findings import Findings
from muros.rtps import MAX_DOMAIN, DomainReport
from muros.space._core import Limits
from muros.space._door import SpaceError
from muros.space._participant import prefix_of, prefixes
from muros.space._space import EngineSpace
from muros.space.dds._domain import Carrier, DdsDomain
from muros.space.dds._participant import DdsParticipant
from muros.space.dds._remote import VERSION
from muros.space.dds._view import DdsGraph

if TYPE_CHECKING:
    import asyncio

    from muros.rtps.net import NetworkSettings

__all__ = ["DdsSpace", "open_dds"]

LIMITS: Final = tuple(Limits.__dataclass_fields__)
NETWORK: Final = ("interfaces", "peers", "range", "network", "fault", "carrier")
OTHERS: Final = ("ros_distro",)


CarrierFactory: TypeAlias = Callable[[int, Findings, Callable[[DomainReport], None]], Carrier]
"""Makes what carries a domain of that number, given where to tell of faults of the network and of others."""


class DdsSpace(EngineSpace):
    """A space in the ROS 2 graph. See `muros.space.Space`."""

    def __init__(
        self,
        *,
        domain: int,
        carrier: CarrierFactory,
        findings: Findings | None = None,
        clock: Callable[[], int] = time.time_ns,
        limits: Limits | None = None,
        ros_distro: str | None = None,
    ) -> None:
        super().__init__(f"dds:{domain}", domain, findings, clock, limits, self)
        self._domains: dict[int, DdsDomain] = {}
        self._carrier = carrier
        self._ros_distro = ros_distro
        seed = _seed()
        self._salt = seed
        self._next_prefix = prefixes(seed)
        self.graph = DdsGraph(self._core, self._domains, domain)

    def participant(
        self,
        name: str,
        *,
        namespace: str = "/",
        domain: int | None = None,
        enclave: str = "/",
        key: bytes | None = None,
        owner: str = "",
    ) -> DdsParticipant:
        """A new participant."""
        self.check_open()
        number = self.domain if domain is None else domain
        prefix = self._next_prefix() if key is None else self._prefix_of(key)
        home = self._home(number)
        self.check_free(key, home.participants.get(prefix))
        with home.making():
            made = DdsParticipant(self._core, home, prefix, name, namespace, enclave, owner, key is not None)
            home.join(made)
        self._core.settle()
        return made

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """Go on the network, and serve the space on this loop from now on."""
        self.check_open()
        if self._core.driver.loop is not None:
            self._core.driver.attach(loop)  # says so if it is another one
            return
        self._home(self.domain)
        for home in self._domains.values():
            self._open(home, loop)
        self._core.driver.attach(loop)

    def close(self) -> None:
        """Close every participant; all others are told."""
        if self.closed:
            return
        self.closed = True
        for home in tuple(self._domains.values()):
            home.close()
        self._core.driver.stop()
        self._domains.clear()
        self._core.queue.clear()

    def run(self) -> None:
        """Give the domains that are on no network their time."""
        for home in tuple(self._domains.values()):
            home.run()

    def next(self) -> int | None:
        """When they want it."""
        return min((due for home in self._domains.values() if (due := home.next()) is not None), default=None)

    def _home(self, number: int) -> DdsDomain:
        home = self._domains.get(number)
        if home is None:
            if not 0 <= number <= MAX_DOMAIN:
                raise ValueError(f"domain {number} does not exist; domains go from 0 to {MAX_DOMAIN}")
            home = DdsDomain(
                number,
                self._core,
                partial(self._carrier, number, self.findings),
                ros_distro=self._ros_distro,
                properties=_properties(),
            )
            loop = self._core.driver.loop
            if loop is not None:
                self._open(home, loop)
            self._domains[number] = home
        return home

    def _open(self, home: DdsDomain, loop: asyncio.AbstractEventLoop) -> None:
        from muros.rtps.net import NetworkError

        try:
            home.open(loop)
        except NetworkError as error:
            raise SpaceError(str(error)) from None

    def _prefix_of(self, key: bytes) -> bytes:
        """The same for a key as long as this space lives; another process gives the key another one, for the two
        may live at the same time, and peers would take them for one.
        """
        return prefix_of(key) if len(key) in (0, 12) else b"\xfe" + prefix_of(self._salt + key)[1:]


def open_dds(
    rest: str,
    *,
    findings: Findings | None = None,
    clock: Callable[[], int] = time.time_ns,
    **options: Any,
) -> DdsSpace:
    """The engine of `dds:` URLs. `rest` is the default domain, else that of ROS_DOMAIN_ID.

    Options: the fields of `Limits`; `interfaces`, `peers`, `range` or a whole `network` (`NetworkSettings`) instead
    of what the environment says; `ros_distro`, whose way of telling of nodes is used and whose types are meant;
    `fault`, asked with each datagram whether to lose it, and `carrier`, in place of a network, for tests.
    """
    if rest and not (rest.isascii() and rest.isdigit()):
        raise SpaceError(f"dds:{rest}: {rest!r} is no domain number; write dds: or dds:42")
    unknown = sorted(set(options) - {*LIMITS, *NETWORK, *OTHERS})
    if unknown:
        known = ", ".join((*LIMITS, *NETWORK, *OTHERS))
        raise TypeError(f"dds: has no option {', '.join(unknown)} (known: {known})")
    distro = options.get("ros_distro")
    if distro is not None and distro not in (*OLD_DISTROS, *NEW_DISTROS):
        known = ", ".join((*OLD_DISTROS, *NEW_DISTROS))
        raise SpaceError(f"ros_distro {distro!r} is not known; take the nearest of {known}")
    limits = Limits(**{name: options[name] for name in LIMITS if name in options})
    carrier = options.get("carrier")
    domain = int(rest) if rest else None
    if carrier is None:
        settings = _settings(domain, options)
        carrier, domain = _networks(settings, clock, options.get("fault")), settings.domain
    return DdsSpace(
        domain=domain or 0,
        carrier=carrier,
        findings=findings,
        clock=clock,
        limits=limits,
        ros_distro=distro,
    )


def _settings(domain: int | None, options: dict[str, Any]) -> NetworkSettings:
    from dataclasses import replace

    from muros.rtps.net import NetworkError, NetworkSettings

    given = {name: options[name] for name in ("interfaces", "peers", "range") if name in options}
    try:
        settings: NetworkSettings | None = options.get("network")
        if settings is None:
            return NetworkSettings.from_environment(domain=domain, **given)
        return replace(settings, domain=settings.domain if domain is None else domain, **given)
    except NetworkError as error:
        raise SpaceError(str(error)) from None


def _networks(
    settings: NetworkSettings, clock: Callable[[], int], fault: Callable[[bytes], bool] | None
) -> CarrierFactory:
    from dataclasses import replace

    from muros.rtps.net import Network

    def network(number: int, findings: Findings, report: Callable[[DomainReport], None]) -> Carrier:
        return Network(
            replace(settings, domain=number),
            wall=lambda: clock() / 1e9,
            findings=findings,
            report=report,
            fault=fault,
        )

    return network


def _seed() -> bytes:
    """Random; the first byte keeps prefixes from looking like those of any vendor."""
    return b"\xff" + os.urandom(7)


def _properties() -> tuple[tuple[str, str], ...]:
    """Where this process runs, for others to show."""
    return (
        (VERSION, __version__),
        ("dds.sys_info.hostname", platform.node()),
        ("dds.sys_info.process_id", str(os.getpid())),
    )
