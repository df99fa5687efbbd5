"""The space of the cyclonedds engine, and how Cyclone is told where to look for others."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, cast
from xml.sax.saxutils import quoteattr

from muros.findings import Findings
from muros.rtps import MAX_DOMAIN
from muros.space._core import Limits
from muros.space._door import SpaceError
from muros.space._space import EngineSpace
from muros.space.cyclone._opaque import VERSION, announces_types, installed_version
from muros.space.dds._view import DdsGraph

if TYPE_CHECKING:
    import asyncio

    from muros.rtps.net import NetworkSettings
    from muros.space.cyclone._domain import CycloneDomain
    from muros.space.cyclone._participant import CycloneParticipant

__all__ = ["CycloneSpace", "configuration", "open_cyclone"]

LIMITS: Final = tuple(Limits.__dataclass_fields__)
NETWORK: Final = ("interfaces", "peers", "range", "network")
OTHERS: Final = ("ros_distro", "config")


class CycloneSpace(EngineSpace):
    """A space in the ROS 2 graph, carried by Cyclone DDS. See `muros.space.Space`."""

    def __init__(
        self,
        *,
        domain: int,
        config: str | None = None,
        findings: Findings | None = None,
        clock: Callable[[], int] = time.time_ns,
        limits: Limits | None = None,
        ros_distro: str | None = None,
    ) -> None:
        super().__init__(f"cyclonedds:{domain}", domain, findings, clock, limits, self)
        self._config = config
        self._ros_distro = ros_distro
        self._domains: dict[int, CycloneDomain] = {}
        # The books have the shape of those of the dds engine.
        self.graph = DdsGraph(self._core, cast(Any, self._domains), domain)
        if announces_types():
            self._core.report(
                "types-announced",
                who="the engine cyclonedds",
                what="ROS 2 Kilted and newer will not talk with this process",
                why=f"cyclonedds {installed_version()} announces types that it does not know; "
                f"only in version {VERSION} that can be helped",
                remedy=f"Install cyclonedds=={VERSION}, or use dds:",
            )

    def participant(
        self,
        name: str,
        *,
        namespace: str = "/",
        domain: int | None = None,
        enclave: str = "/",
        key: bytes | None = None,
        owner: str = "",
    ) -> CycloneParticipant:
        """A new participant."""
        from muros.space.cyclone._participant import CycloneParticipant

        self.check_open()
        if key == b"":
            raise ValueError("the key of a participant is empty; leave it out, or give at least one byte")
        home = self._home(self.domain if domain is None else domain)
        holder = next((p for p in home.participants.values() if key is not None and p.key == key), None)
        self.check_free(key, holder)
        made = CycloneParticipant(self._core, home, name, namespace, enclave, owner, key)
        home.join(made)
        self._core.settle()
        return made

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """Serve the space on this loop from now on."""
        self.check_open()
        if self._core.driver.attach(loop):
            self._home(self.domain)
            for home in self._domains.values():
                home.attach(loop)

    def close(self) -> None:
        """Close every participant; all others are told."""
        if self.closed:
            return
        self.closed = True
        for number, home in self._domains.items():
            home.close()
            _release(number)
        self._core.driver.stop()
        self._domains.clear()
        self._core.queue.clear()

    def run(self) -> None:
        """Take what Cyclone has."""
        for home in tuple(self._domains.values()):
            home.fetch()

    def next(self) -> int | None:
        """When there is something to take."""
        return self.clock() if any(home.waits for home in self._domains.values()) else None

    def _home(self, number: int) -> CycloneDomain:
        from muros.space.cyclone._domain import CycloneDomain

        home = self._domains.get(number)
        if home is None:
            if not 0 <= number <= MAX_DOMAIN:
                raise ValueError(f"domain {number} does not exist; domains go from 0 to {MAX_DOMAIN}")
            _configure(number, self._config)
            try:
                home = CycloneDomain(number, self._core, self._ros_distro)
            except SpaceError:
                _release(number)
                raise
            self._domains[number] = home
            if self._core.driver.loop is not None:
                home.attach(self._core.driver.loop)
        return home


def open_cyclone(
    rest: str,
    *,
    findings: Findings | None = None,
    clock: Callable[[], int] = time.time_ns,
    **options: Any,
) -> CycloneSpace:
    """The engine of `cyclonedds:` URLs. `rest` is the default domain, else that of ROS_DOMAIN_ID.

    Options: the fields of `Limits`; `interfaces`, `peers`, `range` or a whole `network` (`NetworkSettings`) instead
    of what the environment says, or `config`, a configuration of Cyclone DDS as XML; `ros_distro`. Without any of
    them CYCLONEDDS_URI decides, if it is set. The first space of a process in a domain decides for the others there.
    """
    if rest and not (rest.isascii() and rest.isdigit()):
        raise SpaceError(
            f"cyclonedds:{rest}: {rest!r} is no domain number; write cyclonedds: or cyclonedds:42"
        )
    unknown = sorted(set(options) - {*LIMITS, *NETWORK, *OTHERS})
    if unknown:
        known = ", ".join((*LIMITS, *NETWORK, *OTHERS))
        raise TypeError(f"cyclonedds: has no option {', '.join(unknown)} (known: {known})")
    if not installed_version():
        raise SpaceError(
            f"cyclonedds: needs the package cyclonedds: pip install 'cyclonedds=={VERSION}'. It is not made for Python "
            "3.14, aarch64 Linux and musl; dds: needs nothing and can do more"
        )
    settings = _settings(int(rest) if rest else None, options)
    config = options.get("config")
    if config is None and (any(name in options for name in NETWORK) or "CYCLONEDDS_URI" not in os.environ):
        config = configuration(settings)
    return CycloneSpace(
        domain=settings.domain,
        config=config,
        findings=findings,
        clock=clock,
        limits=Limits(**{name: options[name] for name in LIMITS if name in options}),
        ros_distro=options.get("ros_distro"),
    )


def configuration(settings: NetworkSettings) -> str:
    """What Cyclone is to be told of the network."""
    from muros.rtps.net import Range

    off = settings.range is Range.OFF
    names = settings.interfaces or (("lo",) if off or settings.range is Range.LOCALHOST else ())
    interfaces = "".join(
        f'<NetworkInterface {"address" if name[0].isdigit() else "name"}={quoteattr(name)} multicast="true"/>'
        for name in names
    )
    general = f"<Interfaces>{interfaces}</Interfaces>" if interfaces else ""
    general += f"<AllowMulticast>{'false' if off else 'true'}</AllowMulticast>"
    peers = (*settings.peers, "127.0.0.1") if settings.range is Range.LOCALHOST else settings.peers
    discovery = ""
    if off:
        # Who has another tag is not noticed, and this one nobody has.
        discovery = f"<Tag>{os.urandom(8).hex()}</Tag>"
    elif peers:
        each = "".join(f"<Peer Address={quoteattr(peer)}/>" for peer in peers)
        discovery = (
            f"<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{settings.known_indices}"
            f"</MaxAutoParticipantIndex><Peers>{each}</Peers>"
        )
    return (
        f"<CycloneDDS><Domain><General>{general}</General>"
        f"<Discovery>{discovery}</Discovery></Domain></CycloneDDS>"
    )


_configured: Final[dict[int, tuple[Any, int]]] = {}
"""Domains of Cyclone by number, with how many spaces are in each: Cyclone has one of each in a process."""


def _configure(number: int, config: str | None) -> None:
    """Have Cyclone make the domain, unless it is there."""
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain

    made, users = _configured.get(number, (None, 0))
    if not users:
        try:
            made = Domain(number, config)
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:  # somebody else has made it
                raise SpaceError(
                    f"Cyclone DDS does not take the configuration of domain {number}: {error}"
                ) from None
    _configured[number] = made, users + 1


def _release(number: int) -> None:
    """A space has left a domain; with the last one it goes, and may be configured anew."""
    from muros.space.cyclone._participant import delete

    made, users = _configured.pop(number)
    if users > 1:
        _configured[number] = made, users - 1
    elif made is not None:
        delete(made)


def _settings(domain: int | None, options: dict[str, Any]) -> NetworkSettings:
    from dataclasses import replace

    from muros.rtps.net import NetworkError, NetworkSettings

    given: dict[str, Any] = {
        name: options[name] for name in ("interfaces", "peers", "range") if name in options
    }
    network: NetworkSettings | None = options.get("network")
    try:
        if network is None:
            return NetworkSettings.from_environment(domain=domain, **given)
        if domain is not None:
            given["domain"] = domain
        return replace(network, **given) if given else network
    except NetworkError as error:
        raise SpaceError(str(error)) from None
