"""The lines of a rosserial server: links of `muros.links` that hand over bytes as they come, and who is at their ends.

Frames are cut by the boards' own decoders, which know what was negotiated.
"""

from __future__ import annotations

import os
import re
from collections.abc import Hashable, Mapping, Sequence

from muros.links import LineAddress, Link, SerialLink, TcpLink
from muros.rosserial.server._core import Identity

__all__ = ["BAUD", "BAUDS", "TCP_PORT", "RawFraming", "identify", "serial_line", "tcp_line"]

BAUD = 57600
"""Bits per second that rosserial firmware has by default."""
BAUDS = (
    *(57600, 115200, 230400, 1000000, 500000, 921600, 38400, 19200, 9600, 460800),
    *(2000000, 1500000, 3000000, 4000000),
)
"""The rates that are tried one after the other where none is given: the usual ones first."""
TCP_PORT = 11411
"""Where boards with a network dial in."""
_READ_BYTES = 4096
"""So much is read from one connection before the others have their turn."""
_OWN_RATE = re.compile(r"/dev/(ttyACM|ttyGS|rfcomm|pts/)")
"""Lines whose rate is not that of the terminal: USB of the board's own, Bluetooth, pseudoterminals."""


class RawFraming:
    """No framing: every piece is a message as it came."""

    def feed_untrusted(self, data: bytes) -> list[tuple[bytes, int]]:
        """The bytes, as one message."""
        return [(data, 0)]

    def errors(self) -> Mapping[str, int]:
        """There are none."""
        return {}

    def frame(self, message: bytes, peer: int) -> bytes:
        """The message as it is."""
        return message


def serial_line(devices: str | Sequence[str], baud: int = BAUD) -> SerialLink:
    """Serial ports with a board each; patterns take whatever is plugged in."""
    return SerialLink(devices, baud, make_framing=RawFraming)


def tcp_line(port: int = TCP_PORT, host: str | None = None) -> TcpLink:
    """A port of this host where boards dial in."""
    return TcpLink(port, host, read_bytes=_READ_BYTES, make_framing=RawFraming)


def identify(link: Link, address: Hashable, name: str, alone: bool) -> Identity:
    """Who is at an address of a link. ``name`` is the full name for nodes; ``alone``: without the line's name."""
    if isinstance(address, LineAddress):
        own = _OWN_RATE.match(os.path.realpath(address.device))
        rate = getattr(link, "baud_of", None)  # serial links have one
        baud = 0 if own or rate is None else rate(address.device)
        node = name if alone else f"{name}_{_token(os.path.basename(address.device))}"
        return Identity(("line", address.device), address.device, node, baud)
    host = str(address[0]) if isinstance(address, tuple) else str(address)
    node = name if alone else f"{name}_{_token(host)}"
    return Identity((link.name, host), host, node, 0)


def _token(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")
