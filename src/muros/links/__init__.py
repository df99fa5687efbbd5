"""The host's links: transports that move whole messages between an agent or server and its peers.

===========================  ===============================================================  =====================
link                         peers                                                            an address
===========================  ===============================================================  =====================
`UdpLink`                    one message a datagram                                           (host, port)
`DiscoveryLink`              UDP multicast, for clients that look for an agent                (host, port)
`TcpLink`                    a length before each message                                     (host, port)
`SerialLink`                 one or more serial ports, awaited and reopened                   (device, peer number)
`PseudoterminalLink`         a serial line without hardware                                   (device, peer number)
`CanLink`                    one message a CAN FD frame                                       identifier
`CustomLink`                 your own functions                                               as they say
===========================  ===============================================================  =====================

All keep the promises of `Link` and tell their owner through `LinkEvents`; `LinkError` says why one cannot open.
`muros.links.testing` has links without a network, for tests in virtual time.
"""

from collections.abc import Callable, Mapping
from functools import partial

from muros.links._can import CanLink
from muros.links._custom import CustomLink
from muros.links._door import Address, Link, LinkCounters, LinkError, LinkEvents, Locator
from muros.links._framing import Framing, LengthFraming, SerialFraming
from muros.links._line import LineAddress
from muros.links._pty import PseudoterminalLink
from muros.links._serial import SerialLink, devices_from_file
from muros.links._tcp import TcpLink
from muros.links._terminal import BAUD_RATES, serial_ports
from muros.links._udp import DiscoveryLink, UdpLink

LINK_KINDS: Mapping[str, Callable[..., Link]] = {
    "udp4": partial(UdpLink, family=4),
    "udp6": partial(UdpLink, family=6),
    "tcp4": partial(TcpLink, family=4),
    "tcp6": partial(TcpLink, family=6),
    "serial": SerialLink,
    "multiserial": SerialLink,
    "pseudoterminal": PseudoterminalLink,
    "canfd": CanLink,
}
"""The words of the agent's command line for links, and what makes each."""

__all__ = [
    "BAUD_RATES",
    "LINK_KINDS",
    "Address",
    "CanLink",
    "CustomLink",
    "DiscoveryLink",
    "Framing",
    "LengthFraming",
    "LineAddress",
    "Link",
    "LinkCounters",
    "LinkError",
    "LinkEvents",
    "Locator",
    "PseudoterminalLink",
    "SerialFraming",
    "SerialLink",
    "TcpLink",
    "UdpLink",
    "devices_from_file",
    "serial_ports",
]
