"""Which of a peer's addresses is chosen."""

import pytest

from muros.rtps import Addresses, Locator, udp4
from muros.rtps._reach import Hosts, is_loopback, is_multicast

ETH = udp4("192.168.1.5", 7411)
BRIDGE = udp4("172.17.0.1", 7411)
HOSTS = Hosts(Addresses(default_unicast=(ETH, BRIDGE)))

LO = udp4("127.0.0.1", 7413)
PEER = udp4("192.168.1.9", 7411)
FAR = udp4("10.1.2.3", 7411)
SAME_BRIDGE = udp4("172.17.0.1", 7411)
UDP6 = Locator(2, 7411, b"\xfe\x80" + bytes(13) + b"\x05")
MEMORY = Locator(16, 7411, bytes(15) + b"\x01")


@pytest.mark.parametrize(
    ("offered", "source", "chosen"),
    [
        ((FAR, PEER), PEER, PEER),
        ((PEER, FAR), FAR, FAR),
        # From another host: its loopback is not ours, and a bridge that both have is not it.
        ((LO, SAME_BRIDGE, PEER), PEER, PEER),
        ((LO, SAME_BRIDGE), PEER, None),
        # Its source is not offered (some router stands between): what is nearest.
        ((FAR, PEER), udp4("192.168.1.200", 4000), PEER),
        # On this host.
        ((ETH, LO), ETH, LO),
        ((LO,), LO, LO),
        ((ETH, BRIDGE), udp4("192.168.1.5", 40000), ETH),
        ((ETH,), LO, ETH),
        # Not to be used.
        ((UDP6, MEMORY), PEER, None),
        ((udp4("0.0.0.0", 7411), udp4("239.255.0.1", 7411), udp4("192.168.1.9", 0)), PEER, None),
        ((Locator(1, 70000, PEER.address), PEER._replace(port=65535)), PEER, PEER._replace(port=65535)),
        ((), PEER, None),
    ],
)
def test_the_address_that_surely_works(
    offered: tuple[Locator, ...], source: Locator, chosen: Locator | None
) -> None:
    assert HOSTS.choose(offered, source) == (() if chosen is None else (chosen,))


def test_ipv6_is_used_where_this_process_has_it() -> None:
    ours = Hosts(Addresses(default_unicast=(ETH, UDP6._replace(address=b"\xfe\x80" + bytes(13) + b"\x07"))))
    assert ours.choose((UDP6,), UDP6) == (UDP6,)
    loopback = Locator(2, 7411, bytes(15) + b"\x01")
    assert is_loopback(loopback)
    assert ours.choose((UDP6, loopback), loopback) == (loopback,)
    assert is_multicast(Locator(2, 7411, b"\xff\x02" + bytes(14)))
