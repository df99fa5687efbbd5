"""The tables of the agent's command line: transports, middlewares and options, as data."""

import ipaddress
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Final, TypeAlias

from muros._distros import NEW_DISTROS, OLD_DISTROS
from muros.links import BAUD_RATES

DISCOVERY_PORT: Final = 7400
"""Where clients look for agents unless told otherwise."""
BAUDRATE: Final = 115200
"""Bits per second of a serial line unless told otherwise."""
ROSSERIAL_BAUDRATE: Final = 57600
"""The same for boards with rosserial firmware."""
CONNECTIONS: Final = 100
"""Connections that a TCP link holds at the same time unless told otherwise."""
VERBOSE: Final = 4
"""How much is told unless told otherwise: clients that come and go."""


@dataclass(frozen=True, slots=True)
class Middleware:
    """A word of `-m`: the URL of its space and what it is."""

    space: str
    about: str


MIDDLEWARES: Final = {
    "dds": Middleware("dds:", "the ROS 2 graph"),
    "rtps": Middleware("dds:", "the same, by its older name"),
    "cyclonedds": Middleware("cyclonedds:", "the ROS 2 graph through Cyclone DDS, if that is installed"),
    "local": Middleware("local:", "the data space inside this agent, and no network"),
    "ced": Middleware("local:", "the same, by the reference agent's name"),
}
MIDDLEWARE: Final = "dds"
"""Where the data goes unless told otherwise."""
ROS_DISTROS: Final = (OLD_DISTROS[-1], *NEW_DISTROS)
"""What `--ros-distro` takes: Humble writes longer gids into the graph than those after it."""


@dataclass(frozen=True, slots=True)
class Transport:
    """A transport word: which options make no sense without a value, and what it is."""

    needs: tuple[tuple[str, ...], ...]
    """Each a group of option keys, of which exactly one must be given."""
    about: str


_PORT_NEEDED = (("port",),)
_DEVICE_NEEDED = (("device", "file"),)
TRANSPORTS: Final = {
    "udp4": Transport(_PORT_NEEDED, "UDP over IPv4"),
    "udp6": Transport(_PORT_NEEDED, "UDP over IPv6"),
    "tcp4": Transport(_PORT_NEEDED, "TCP over IPv4"),
    "tcp6": Transport(_PORT_NEEDED, "TCP over IPv6"),
    "serial": Transport(_DEVICE_NEEDED, "a serial port, waited for and reopened"),
    "multiserial": Transport(_DEVICE_NEEDED, "several serial ports"),
    "pseudoterminal": Transport((), "a serial line without hardware; prints its far end"),
    "canfd": Transport((("device",),), "CAN FD through SocketCAN"),
    "rosserial": Transport(
        (("device", "file", "port"),), "boards with rosserial firmware: serial ports, or TCP"
    ),
}

IP_TRANSPORTS = frozenset({"udp4", "udp6", "tcp4", "tcp6"})
_TCP = frozenset({"tcp4", "tcp6"})
_SERIAL = frozenset({"serial", "multiserial"})
_TERMINAL = _SERIAL | {"pseudoterminal", "rosserial"}
_LISTENING = IP_TRANSPORTS | {"rosserial"}
_ALL: frozenset[str] = frozenset()

Value: TypeAlias = str | int | float | bool | Path


@dataclass(frozen=True, slots=True)
class Option:
    """One option. `transports` empty: it is the agent's and stands anywhere."""

    key: str
    flags: tuple[str, ...]
    about: str
    value: str = ""
    """The name of its value in the help; empty: it takes none."""
    read: Callable[[str], Value] = str
    """Its value from text; raises ValueError with what is wrong, behind "is"."""
    bare: Value | None = None
    """Its value when none follows; None: one must follow."""
    transports: frozenset[str] = _ALL


def integer(low: int, high: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if not (text.isascii() and text.isdigit()):
            raise ValueError("not a number")
        if not low <= int(text) <= high:
            raise ValueError(f"out of range: it must be from {low} to {high}")
        return int(text)

    return read


def _baudrate(text: str) -> int:
    rate = integer(0, 2**32)(text)
    if rate not in BAUD_RATES:
        near = sorted(BAUD_RATES, key=lambda known: abs(known - rate))[:2]
        raise ValueError(f"not a baud rate of serial ports (nearest: {' and '.join(map(str, sorted(near)))})")
    return rate


def _can_id(text: str) -> int:
    try:
        value = int(text, 16)
    except ValueError:
        raise ValueError("not a hexadecimal number") from None
    if not 0 <= value <= 0x1FFFFFFF:
        raise ValueError("out of range: it must be from 0 to 0x1FFFFFFF")
    return value


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError("not a number of seconds") from None
    if not 0 < value < 1e9:
        raise ValueError("out of range: it must be more than 0 seconds")
    return value


def _address(text: str) -> str:
    try:
        return str(ipaddress.ip_address(text))
    except ValueError:
        raise ValueError("not an IP address") from None


def _one_of(words: Sequence[str], what: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in words:
            raise ValueError(f"no {what}{guess(text, words)}; there are {', '.join(words)}")
        return text

    return read


OPTIONS: Final = (
    Option("port", ("-p", "--port"), "port to listen on", "PORT", integer(0, 65535), transports=_LISTENING),
    Option(
        "bind", ("--bind",), "address to listen on (default: all)", "ADDR", _address, transports=_LISTENING
    ),
    Option(
        "discovery",
        ("-d", "--discovery"),
        f"answer clients that look for an agent (port {DISCOVERY_PORT} unless given)",
        "[PORT]",
        integer(1, 65535),
        DISCOVERY_PORT,
        IP_TRANSPORTS,
    ),
    Option(
        "connections",
        ("--connections",),
        f"connections that TCP holds at the same time (default {CONNECTIONS})",
        "N",
        integer(1, 1_000_000),
        transports=_TCP,
    ),
    Option(
        "p2p",
        ("-P", "--p2p"),
        "taken, but does nothing here",
        "PORT",
        integer(1, 65535),
        transports=IP_TRANSPORTS,
    ),
    Option(
        "device",
        ("-D", "--dev", "--devs"),
        'serial port; several in quotes: "A B"; CAN interface; link to the far end',
        "DEV",
        transports=_TERMINAL | {"canfd"},
    ),
    Option(
        "file",
        ("-f", "--file"),
        "read the device from this file",
        "FILE",
        transports=_SERIAL | {"rosserial"},
    ),
    Option(
        "baudrate",
        ("-b", "--baudrate"),
        f"bits per second (default {BAUDRATE}; rosserial {ROSSERIAL_BAUDRATE})",
        "BAUD",
        _baudrate,
        BAUDRATE,
        _TERMINAL,
    ),
    Option(
        "id", ("-I", "--id"), "CAN identifier (default 0x00000001)", "HEX", _can_id, 1, frozenset({"canfd"})
    ),
    Option(
        "flow-control",
        ("-fc", "--flow-control"),
        "taken, but does nothing here",
        transports=_SERIAL,
    ),
    Option(
        "middleware",
        ("-m", "--middleware"),
        f"where the data goes: {', '.join(MIDDLEWARES)} (default {MIDDLEWARE})",
        "NAME",
        _one_of(tuple(MIDDLEWARES), "middleware"),
    ),
    Option(
        "ros-distro",
        ("--ros-distro",),
        "the ROS 2 around us, where it cannot be seen",
        "NAME",
        _one_of(ROS_DISTROS, "ROS 2 distribution"),
    ),
    Option("refs", ("-r", "--refs"), "profiles for clients that create by reference", "FILE", Path),
    Option("refs-optional", ("--refs-optional",), "go on without profiles if FILE cannot be used"),
    Option(
        "verbose",
        ("-v", "--verbose"),
        f"0 (nothing) to 6 (every byte); default {VERBOSE}",
        "LEVEL",
        integer(0, 6),
        VERBOSE,
    ),
    Option(
        "forget", ("--forget",), "remove clients silent for so long (default: never)", "SECONDS", _seconds
    ),
    Option(
        "log-style",
        ("--log-style",),
        "muros, or reference: lines as the reference agent prints them",
        "STYLE",
        _one_of(("muros", "reference"), "log style"),
    ),
    Option("no-color", ("--no-color",), "no colours, even on a terminal"),
    Option("config", ("--config",), "read links and options from a TOML file", "FILE", Path),
    Option("help", ("-h", "--help"), "this text"),
)
BY_FLAG: Final = {flag: option for option in OPTIONS for flag in option.flags}
BY_KEY: Final = {option.key: option for option in OPTIONS}
NO_EFFECT: Final = {
    "p2p": "agents do not look for each other in this version",
    "flow-control": "serial ports are used without flow control in this version",
}


def guess(word: str, known: Sequence[str]) -> str:
    """ " (did you mean X?)" where a known word is close."""
    close = get_close_matches(word, known, 1)
    return f" (did you mean {close[0]}?)" if close else ""
