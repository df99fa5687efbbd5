"""What happens inside namespaces in `test_interfaces.py`: interfaces come and go under a watch and under a network."""

import asyncio
from collections.abc import Callable
from typing import Any

from muros.rtps import Ports, udp4
from muros.rtps.net import Network, NetworkSettings, _interfaces, _network
from muros.rtps.net._interfaces import Watch, chosen, interfaces, require
from tests.rtps_net.cores import NotingCore
from tests.rtps_net.namespaces import ip

PORTS = Ports(0)


def names() -> list[str]:
    """Of those in use."""
    return [interface.name for interface in interfaces()]


async def until(so: Callable[[], object]) -> None:
    """Waits, within a bound."""
    async with asyncio.timeout(10):
        while not so():
            await asyncio.sleep(0.005)


def listing() -> None:
    """Which interfaces count."""
    asyncio.run(_listing())


async def _listing() -> None:
    """The kernel tells of cables a moment later."""
    assert interfaces() == ()
    ip("link set lo up")
    await until(lambda: names() == ["lo"])
    ip("link add v0 type veth peer name v1")
    ip("addr add 10.1.0.1/24 dev v0")
    assert names() == ["lo"]  # not up
    ip("link set v0 up")
    assert names() == ["lo"]  # no cable
    ip("link set v1 up")
    await until(lambda: names() == ["v0", "lo"])  # v1 has no address
    ip("addr add 10.1.0.9/24 dev v0 label v0:more")
    ip("addr add 10.2.0.1/24 dev v1")
    await until(lambda: len(interfaces()) == 3)
    v1, v0, lo = interfaces()
    assert v1.index < v0.index
    assert (v0.name, v0.addresses, v0.loopback, v0.multicast) == ("v0", ("10.1.0.1", "10.1.0.9"), False, True)
    assert (lo.name, lo.addresses, lo.loopback, lo.multicast) == ("lo", ("127.0.0.1",), True, True)
    ip("link set v1 multicast off")
    assert [interface.multicast for interface in interfaces()] == [False, True, True]

    present = (v1, v0, lo)
    assert chosen(present, (), secluded=False) == present
    assert chosen(present, (), secluded=True) == (lo,)
    assert chosen(present, ("v1", "nosuch"), secluded=False) == (v1,)
    assert chosen(present, ("v1",), secluded=True) == ()
    (only,) = chosen(present, ("10.1.0.9",), secluded=False)
    assert (only.name, only.addresses) == ("v0", ("10.1.0.9",))

    assert require(()) == ()
    assert require(("v0", "10.2.0.1")) == ()
    assert require(("v0", "nosuch")) == ("nosuch",)
    ip("link set v0 down")
    assert require(("v0",)) == ("v0",)  # may come up


def watching() -> None:
    """The kernel tells of changes."""
    asyncio.run(_watching())


def polling() -> None:
    """The same where the kernel does not tell."""
    _interfaces._netlink = lambda: None
    _interfaces.POLL_PERIOD = 0.02  # type: ignore[misc]
    asyncio.run(_watching())


async def _watching() -> None:
    ip("link set lo up")
    seen: list[list[str]] = []
    watch = Watch(asyncio.get_running_loop(), lambda: seen.append(names()))
    ip("link add v0 type veth peer name v1")
    ip("link set v1 up")
    ip("link set v0 up")
    ip("addr add 10.1.0.1/24 dev v0")
    await until(lambda: seen and seen[-1] == ["v0", "lo"])
    ip("link set v1 down")  # the cable
    await until(lambda: seen[-1] == ["lo"])
    ip("link set v1 up")
    await until(lambda: seen[-1] == ["v0", "lo"])
    ip("addr del 10.1.0.1/24 dev v0")
    await until(lambda: seen[-1] == ["lo"])
    watch.close()
    calls = len(seen)
    ip("addr add 10.1.0.1/24 dev v0")
    await asyncio.sleep(0.1)
    assert len(seen) == calls


def coming_and_going() -> None:
    """A network joins interfaces that come, tells the core, and speaks and hears through them."""
    made: Any = NotingCore
    vars(_network)["DomainCore"] = made
    asyncio.run(_coming_and_going())


async def _coming_and_going() -> None:
    loop = asyncio.get_running_loop()
    ip("link set lo up")
    one, two = Network(NetworkSettings()), Network(NetworkSettings())
    one.open(loop)
    two.open(loop)
    core: Any = one.core
    other: Any = two.core
    group = udp4("239.255.0.1", PORTS.multicast)

    def hosts() -> list[str]:
        return [locator.host for locator in core.addresses.default_unicast]

    async def heard(ways: int) -> None:
        """Both hear both, once by each way."""
        await until(lambda: len(one._joined) == len(two._joined) == ways)
        core.received.clear()
        other.received.clear()
        core.transmit(b"one", group)
        other.transmit(b"two", group)
        await until(lambda: len(core.received) == len(other.received) == 2 * ways)

    assert hosts() == ["127.0.0.1"]
    core.transmit(b"x", udp4("10.1.0.2", 7410))
    assert one.counters.lost == {"dds-unreachable": 1}
    await heard(1)

    ip("link add v0 type veth peer name v1")
    ip("link set v1 up")
    ip("link set v0 up")
    ip("addr add 10.1.0.1/24 dev v0")
    await until(lambda: hosts() == ["10.1.0.1"] and other.addresses.default_unicast[0].host == "10.1.0.1")
    await heard(2)
    ip("link del v0")
    await until(lambda: hosts() == ["127.0.0.1"])
    await heard(1)
    one.close()
    two.close()
