"""How a process takes part in the network: one frozen value, read from the variables that ROS 2 knows."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from muros.rtps._constants import DEFAULT_MULTICAST, MAX_DOMAIN, MAX_PARTICIPANT_INDEX
from muros.rtps._values import Locator, udp4

__all__ = ["NetworkError", "NetworkSettings", "Range"]

PEER_LENGTH: Final = 255
"""Characters of the longest name of a peer, as ROS 2 allows them."""


class NetworkError(Exception):
    """The network cannot be used as asked: one readable line that says where, why and what to do.

    A local error: nothing a peer sends can cause it.
    """

    def __init__(self, where: str, why: str, remedy: str) -> None:
        super().__init__(f"{where}: {why}. {remedy}")
        self.where = where
        self.why = why
        self.remedy = remedy


class Range(Enum):
    """How far participants look for others by themselves (ROS_AUTOMATIC_DISCOVERY_RANGE)."""

    SUBNET = "SUBNET"
    """All that multicast reaches, and this host."""
    LOCALHOST = "LOCALHOST"
    """This host; others only if they are static peers."""
    OFF = "OFF"
    """Nobody outside the process, static peers neither."""
    SYSTEM_DEFAULT = "SYSTEM_DEFAULT"
    """What the middleware does without being told, which is `SUBNET` here."""


@dataclass(frozen=True, slots=True)
class NetworkSettings:
    """Where to listen and whom to look for. Equal settings mean the same network. Raises `NetworkError`."""

    domain: int = 0
    """Participants of different domains do not see each other."""
    range: Range = Range.SUBNET
    """How far to look for others."""
    peers: tuple[str, ...] = ()
    """Hosts looked for in addition, by name or IPv4 address; with ``:port`` only that port of theirs."""
    interfaces: tuple[str, ...] = ()
    """Names or IPv4 addresses of the network interfaces used; default all that are up."""
    indices: int = MAX_PARTICIPANT_INDEX + 1
    """Participant indices, and with them pairs of ports, that are tried."""
    known_indices: int = 32
    """Where no multicast goes, peers are looked for at the ports of this many participant indices of a host."""
    group: str = DEFAULT_MULTICAST
    """Multicast group of discovery."""
    hops: int = 1
    """Routers that multicast may pass, plus one."""
    receive_buffer: int = 4 << 20
    """Wanted receive buffer of each socket in bytes; the kernel grants at most net.core.rmem_max."""
    send_queue: int = 4 << 20
    """Bytes that may wait in the process for a socket that takes no more; what comes then is lost."""
    drain: int = 64
    """Datagrams taken in one wake-up before others get their turn."""

    def __post_init__(self) -> None:
        if not 0 <= self.domain <= MAX_DOMAIN:
            raise _refused("domain", self.domain, f"Domains go from 0 to {MAX_DOMAIN}.")
        if not 1 <= self.indices <= MAX_PARTICIPANT_INDEX + 1:
            raise _refused("indices", self.indices, f"There are 1 to {MAX_PARTICIPANT_INDEX + 1}.")
        if not 1 <= self.known_indices <= MAX_PARTICIPANT_INDEX + 1:
            raise _refused(
                "known_indices", self.known_indices, f"There are 1 to {MAX_PARTICIPANT_INDEX + 1}."
            )
        if not 0 <= self.hops <= 255:
            raise _refused("hops", self.hops, "Choose 1 for the subnet, at most 255.")
        for name in ("receive_buffer", "send_queue", "drain"):
            if getattr(self, name) < 1:
                raise _refused(name, getattr(self, name), "It must be at least 1.")
        octets = _address(self.group)
        if octets is None or not 224 <= octets.address[12] <= 239:
            raise _refused("group", self.group, "Multicast groups go from 224.0.0.0 to 239.255.255.255.")
        for peer in self.peers:
            split_peer(peer)

    @property
    def secluded(self) -> bool:
        """Whether nobody on another host is meant: nothing but loopback is then used."""
        return self.range is Range.LOCALHOST and all(
            peer.partition(":")[0] == "localhost" or peer.startswith("127.") for peer in self.peers
        )

    @classmethod
    def from_environment(
        cls,
        environment: Mapping[str, str] | None = None,
        *,
        domain: int | None = None,
        range: Range | str | None = None,
        peers: tuple[str, ...] | None = None,
        interfaces: tuple[str, ...] = (),
        **others: int | str,
    ) -> "NetworkSettings":
        """The settings that ROS 2 Jazzy would take from the variables; an argument that is given goes before them.

        ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_STATIC_PEERS (separated by semicolons), and
        ROS_LOCALHOST_ONLY, which when it is 1 decides alone and makes the other two ignored. Empty variables are
        as good as none. Raises `NetworkError` for a value that cannot be meant, where ROS 2 warns and guesses.
        """
        given = os.environ if environment is None else environment
        alone = given.get("ROS_LOCALHOST_ONLY") == "1"
        if domain is None:
            domain = _domain(given.get("ROS_DOMAIN_ID", ""))
        if range is None:
            range = Range.LOCALHOST if alone else given.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
        if peers is None:
            peers = () if alone else _peers(given.get("ROS_STATIC_PEERS", ""))
        reach = range if isinstance(range, Range) else _range(range)
        return cls(domain, reach, peers, interfaces, **others)  # type: ignore[arg-type]


def split_peer(peer: str) -> tuple[str, int | None]:
    """Host and, if it is given, port of a peer. NetworkError when it is neither a name nor an IPv4 address."""
    host, colon, port = peer.partition(":")
    if not re.fullmatch(r"[A-Za-z0-9_]([A-Za-z0-9_.-]*[A-Za-z0-9_.])?", host) or len(peer) > PEER_LENGTH:
        raise _refused(
            "peer", repr(peer), "Give the name or the IPv4 address of a host, several with ; between."
        )
    if re.fullmatch(r"[0-9.]+", host) and _address(host) is None:
        raise _refused("peer", repr(peer), "An IPv4 address has four numbers from 0 to 255.")
    if not colon:
        return host, None
    if not re.fullmatch(r"[0-9]{1,5}", port) or not 0 < int(port) < 65536:
        raise _refused("peer", repr(peer), "Ports go from 1 to 65535.")
    return host, int(port)


def _address(host: str) -> Locator | None:
    try:
        return udp4(host, 0)
    except ValueError:
        return None


def _domain(text: str) -> int:
    if not text:
        return 0
    if not re.fullmatch(r"[0-9]{1,9}", text.strip()) or int(text) > MAX_DOMAIN:
        raise _refused(
            "ROS_DOMAIN_ID", repr(text), f"Set it to a number from 0 to {MAX_DOMAIN}, or unset it."
        )
    return int(text)


def _range(text: str) -> Range:
    if not text:
        return Range.SUBNET
    try:
        return Range(text)
    except ValueError:
        words = ", ".join(word.value for word in Range)
        raise _refused("ROS_AUTOMATIC_DISCOVERY_RANGE", repr(text), f"Choose one of: {words}.") from None


def _peers(text: str) -> tuple[str, ...]:
    peers = tuple(peer.strip() for peer in text.split(";") if peer.strip())
    for peer in peers:
        try:
            split_peer(peer)
        except NetworkError as error:
            raise NetworkError("ROS_STATIC_PEERS", f"{error.where} {error.why}", error.remedy) from None
    return tuple(dict.fromkeys(peers))


def _refused(what: str, value: object, remedy: str) -> NetworkError:
    return NetworkError(what, f"{value} is not possible", remedy)
