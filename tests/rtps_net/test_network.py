"""A network on loopback with a core that only notes: ports, addresses, draining, the timer, sharing, forks."""

import asyncio
import os
import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from muros.findings import Findings
from muros.rtps import Addresses, Ports, udp4
from muros.rtps._domain_settings import NOWHERE
from muros.rtps.net import Interface, Network, NetworkError, NetworkSettings, Range, _network, _outlets
from tests.rtps_net.cores import NotingCore, install
from tests.rtps_net.quiet import quiet_domain

LO = Interface("lo", 1, ("127.0.0.1",), loopback=True, multicast=True)
ETH = Interface("eth0", 2, ("10.0.0.1", "10.0.0.2"), loopback=False, multicast=True)
WLAN = Interface("wlan0", 3, ("10.1.0.1",), loopback=False, multicast=True)


@pytest.fixture(autouse=True)
def noting(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Networks have a core that notes; what a failed test leaves open is closed, so that no other fails after it."""
    install(monkeypatch)
    yield
    for network in list(_network._open):
        while not network._closed:
            network.close()


@pytest.fixture
def settings() -> Iterator[NetworkSettings]:
    with quiet_domain() as domain:
        yield NetworkSettings(domain, interfaces=("lo",))


@pytest.fixture
def loop() -> Iterator[asyncio.AbstractEventLoop]:
    loop = asyncio.new_event_loop()
    yield loop
    loop.close()


def core_of(network: Network) -> NotingCore:
    core: Any = network.core
    assert isinstance(core, NotingCore)
    return core


def spin(loop: asyncio.AbstractEventLoop, until: Callable[[], object]) -> None:
    """Runs the loop until it is so; the test's own limit ends it otherwise."""

    async def wait() -> None:
        async with asyncio.timeout(10):
            while not until():
                await asyncio.sleep(0.001)

    loop.run_until_complete(wait())


class Peer:
    """A socket that speaks to a network."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(5)
        self.locator = udp4(*self.socket.getsockname())

    def send(self, datagram: bytes, port: int) -> None:
        self.socket.sendto(datagram, ("127.0.0.1", port))

    def __enter__(self) -> "Peer":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()


def test_addresses_are_told_and_announcements_go_to_group_and_host(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    ports = Ports(settings.domain)
    first, second = Network(settings), Network(replace(settings, indices=119))
    assert core_of(first).addresses == NOWHERE
    first.open(loop)
    second.open(loop)
    for network, index in ((first, 0), (second, 1)):
        assert network.index == index
        assert [interface.name for interface in network.interfaces] == ["lo"]
        (addresses,) = core_of(network).told
        assert addresses.metatraffic_unicast == (udp4("127.0.0.1", ports.unicast(index)),)
        assert addresses.default_unicast == (udp4("127.0.0.1", ports.user_unicast(index)),)
        assert addresses.metatraffic_multicast == addresses.default_multicast == ()
        assert addresses.announce_to == (
            udp4("239.255.0.1", ports.multicast),
            *(udp4("127.0.0.1", ports.unicast(other)) for other in range(32) if other != index),
        )
        network.close()
        assert core_of(network).closed == 1
        network.close()
        assert core_of(network).closed == 1


def test_datagrams_come_by_all_three_sockets(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    ports = Ports(settings.domain)
    times = iter(range(100, 200))
    network = Network(settings, clock=lambda: next(times))
    network.open(loop)
    core = core_of(network)
    with Peer() as peer:
        peer.send(b"user", ports.user_unicast(0))
        peer.send(b"meta", ports.unicast(0))
        spin(loop, lambda: len(core.received) == 2)
        assert {datagram for datagram, _, _ in core.received} == {b"user", b"meta"}
        assert {source for _, source, _ in core.received} == {peer.locator}
        core.transmit(b"answer", peer.locator)
        answer, source = peer.socket.recvfrom(100)
        assert (answer, source) == (b"answer", ("127.0.0.1", ports.user_unicast(0)))
    core.transmit(b"all", udp4("239.255.0.1", ports.multicast))
    spin(loop, lambda: len(core.received) == 3)
    assert core.received[2][0] == b"all"  # our own, too: the core knows it by its prefix
    assert core.received[2][2] > core.received[0][2]
    assert network.counters.received >= 3
    assert network.counters.received_bytes >= len(b"user" + b"meta" + b"all")
    assert (network.counters.sent, network.counters.sent_bytes) == (2, len(b"answer" + b"all"))
    network.close()


def test_a_flood_lets_others_have_their_turn(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    network = Network(replace(settings, drain=10))
    network.open(loop)
    core = core_of(network)
    turns: list[int] = []

    def turn() -> None:
        turns.append(len(core.received))
        if len(core.received) < 45:
            loop.call_soon(turn)

    with Peer() as peer:
        for _ in range(45):
            peer.send(b"x", Ports(settings.domain).user_unicast(0))
        loop.call_soon(turn)
        spin(loop, lambda: len(core.received) == 45)
    assert max(b - a for a, b in pairwise(turns)) == 10
    network.close()


def test_closing_while_a_datagram_is_handled(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    network = Network(settings)
    network.open(loop)
    core = core_of(network)
    core.on_receive = lambda datagram: network.close()
    with Peer() as peer:
        for _ in range(3):
            peer.send(b"x", Ports(settings.domain).unicast(0))
        spin(loop, lambda: core.closed)
    assert len(core.received) == 1


def test_what_the_core_raises_ends_nothing(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    network = Network(settings)
    network.open(loop)
    core = core_of(network)
    errors: list[object] = []
    loop.set_exception_handler(lambda _, context: errors.append(context["exception"]))

    def fail(datagram: bytes) -> None:
        if datagram == b"bad":
            raise BlockingIOError("not the socket's")

    core.on_receive = fail
    with Peer() as peer:
        peer.send(b"bad", Ports(settings.domain).unicast(0))
        peer.send(b"good", Ports(settings.domain).unicast(0))
        spin(loop, lambda: len(core.received) == 2)
    assert len(errors) == 1
    network.close()


def test_faults_on_request_lose_both_ways(settings: NetworkSettings, loop: asyncio.AbstractEventLoop) -> None:
    network = Network(settings, fault=lambda datagram: datagram == b"lose")
    network.open(loop)
    core = core_of(network)
    with Peer() as peer:
        for datagram in (b"lose", b"keep"):
            peer.send(datagram, Ports(settings.domain).unicast(0))
            core.transmit(datagram, peer.locator)
        spin(loop, lambda: core.received)
        assert [datagram for datagram, _, _ in core.received] == [b"keep"]
        assert peer.socket.recv(100) == b"keep"
    network.close()


def test_overflow_is_counted_and_told(settings: NetworkSettings, loop: asyncio.AbstractEventLoop) -> None:
    findings = Findings()
    now = 0
    network = Network(
        replace(settings, receive_buffer=4096, drain=2),
        findings=findings,
        wall=lambda: 12.5,
        clock=lambda: now,
    )
    network.open(loop)
    core = core_of(network)
    with Peer() as peer:
        for _ in range(100):
            peer.send(bytes(1000), Ports(settings.domain).user_unicast(0))
        spin(loop, lambda: network.counters.overflown)  # seen with the first that come
        overflown = network.counters.overflown
        spin(loop, lambda: network.counters.received + overflown >= 100)
        for _ in range(100):
            peer.send(bytes(1000), Ports(settings.domain).user_unicast(0))
        received = network.counters.received
        spin(loop, lambda: network.counters.received > received)
        assert network.counters.overflown == overflown  # not looked at with every datagram
        now += 10**9
        peer.send(b"more", Ports(settings.domain).user_unicast(0))
        spin(loop, lambda: core.received[-1][0] == b"more")
    network.close()
    assert network.counters.overflown > overflown
    assert network.counters.received + network.counters.overflown >= 201
    (finding,) = findings.snapshot()
    assert finding.code == "dds-receive-buffer-full"
    assert finding.who == f"dds domain {settings.domain}"
    assert finding.count == network.counters.overflown
    assert finding.last == 12.5
    assert "rmem_max" in finding.format()


def test_a_small_buffer_is_told(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_network, "granted", lambda sock, size: 212_992)
    findings = Findings()
    network = Network(settings, findings=findings)
    network.open(loop)
    network.close()
    (finding,) = findings.snapshot()
    assert finding.code == "dds-receive-buffer-small"
    assert "208 kB" in finding.format()
    assert finding.count == 3


class Timers:
    """A loop on which time passes when a test says so."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self.now = 0
        self.set = 0
        self.waiting: list[tuple[int, Callable[[], object]]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loop, name)

    def call_later(self, delay: float, call: Callable[[], object]) -> Any:
        self.set += 1
        entry = (self.now + round(delay * 1e9), call)
        self.waiting.append(entry)

        class Handle:
            def cancel(handle) -> None:  # noqa: N805
                self.waiting.remove(entry)

        return Handle()

    def run_to(self, now: int) -> None:
        while self.waiting and min(self.waiting, key=lambda entry: entry[0])[0] <= now:
            entry = min(self.waiting, key=lambda entry: entry[0])
            self.waiting.remove(entry)
            self.now = max(self.now, entry[0])
            entry[1]()
        self.now = now


def test_one_timer_that_is_only_brought_forward(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    timers: Any = Timers(loop)
    network = Network(settings, clock=lambda: timers.now)
    core = core_of(network)
    network.poke()  # not open: nothing
    network.open(timers)
    network.poke()  # nothing wanted
    assert timers.set == 0
    core.deadline = 1000
    network.poke()
    core.deadline = 5000
    network.poke()  # later: the timer stays
    assert timers.set == 1
    timers.run_to(2000)
    assert core.ticks == []  # too early; set again
    assert timers.set == 2
    core.deadline = 3000
    network.poke()  # sooner
    assert [entry[0] for entry in timers.waiting] == [3000]
    timers.run_to(10_000)
    assert core.ticks == [3000]
    assert timers.waiting == []
    core.deadline = 4000
    network.poke()  # passed already: at once
    timers.run_to(10_000)
    assert core.ticks == [3000, 10_000]
    network.close()


def test_closing_takes_the_timer_away(settings: NetworkSettings, loop: asyncio.AbstractEventLoop) -> None:
    timers: Any = Timers(loop)
    network = Network(settings, clock=lambda: timers.now)
    network.open(timers)
    core_of(network).deadline = 10
    network.poke()
    network.close()
    assert timers.waiting == []
    network.poke()
    assert timers.waiting == []


def test_range_off_opens_no_socket(loop: asyncio.AbstractEventLoop) -> None:
    timers: Any = Timers(loop)
    network = Network(NetworkSettings(0, Range.OFF, peers=("10.0.0.1",)), clock=lambda: timers.now)
    network.open(timers)
    core = core_of(network)
    assert (network.index, network.interfaces, core.told, core.addresses) == (None, (), [], NOWHERE)
    core.deadline = 5
    network.poke()
    timers.run_to(5)
    assert core.ticks == [5]
    core.transmit(b"x", udp4("127.0.0.1", 7410))
    network.close()
    assert (core.closed, network.counters.sent) == (1, 0)


@pytest.mark.parametrize(
    ("extra", "bound"),
    [
        ({"range": Range.LOCALHOST, "interfaces": ()}, "127.0.0.1"),
        ({"range": Range.LOCALHOST, "interfaces": (), "peers": ("127.0.0.1",)}, "127.0.0.1"),
        ({"interfaces": ("lo",)}, "127.0.0.1"),
        ({"interfaces": ("127.0.0.1",)}, "127.0.0.1"),
        ({"interfaces": ()}, "0.0.0.0"),
        ({"range": Range.LOCALHOST, "interfaces": (), "peers": ("192.0.2.254",)}, "0.0.0.0"),
    ],
)
def test_what_is_for_this_host_is_bound_to_it(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop, extra: dict[str, Any], bound: str
) -> None:
    network = Network(replace(settings, **extra))
    network.open(loop)
    pair = network._pair
    assert pair is not None
    assert pair.user.getsockname()[0] == pair.metatraffic.getsockname()[0] == bound
    if bound == "127.0.0.1":
        assert [interface.name for interface in network.interfaces] == ["lo"]
    network.close()


class Present:
    """Interfaces that come and go as a test says."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *present: Interface) -> None:
        self.present = present
        self.groups: list[str] = []
        self.senders: list[str] = []
        self.refused: set[str] = set()
        monkeypatch.setattr(_network, "interfaces", lambda: self.present)
        monkeypatch.setattr(_network, "join", self._join)
        monkeypatch.setattr(_network, "leave", lambda sock, group, index: self.groups.append(f"-{index}"))
        monkeypatch.setattr(_outlets.Sender, "set_interfaces", self._set)

    def _join(self, sock: socket.socket, group: str, interface: Interface) -> bool:
        self.groups.append(f"+{interface.index}")
        return interface.name not in self.refused

    def _set(self, loop: asyncio.AbstractEventLoop, interfaces: list[Interface]) -> None:
        self.senders = [interface.name for interface in interfaces]


def hosts(network: Network) -> list[str]:
    addresses = core_of(network).addresses
    meta = [locator.host for locator in addresses.metatraffic_unicast]
    assert meta == [locator.host for locator in addresses.default_unicast]
    return meta


def test_interfaces_come_and_go(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    present = Present(monkeypatch, ETH, LO)
    findings = Findings()
    network = Network(replace(settings, interfaces=()), findings=findings)
    network.open(loop)
    assert present.groups == ["+2", "+1"]
    assert present.senders == ["eth0", "lo"]
    assert hosts(network) == ["10.0.0.1", "10.0.0.2"]  # loopback only when nothing else is there

    network._refresh()  # nothing changed: nobody is told
    assert len(core_of(network).told) == 1

    present.present = (ETH, WLAN, LO)
    network._refresh()
    assert present.groups == ["+2", "+1", "+3"]
    assert hosts(network) == ["10.0.0.1", "10.0.0.2", "10.1.0.1"]

    present.present = (LO,)
    network._refresh()
    assert sorted(present.groups[3:]) == ["-2", "-3"]
    assert present.senders == ["lo"]
    assert hosts(network) == ["127.0.0.1"]

    again = replace(ETH, index=9)
    present.present = (again, LO)
    network._refresh()
    assert present.groups[5:] == ["+9"]
    assert hosts(network) == ["10.0.0.1", "10.0.0.2"]
    assert len(core_of(network).told) == 4
    assert findings.snapshot() == ()

    present.present = ()
    network._refresh()
    assert hosts(network) == []
    assert [finding.code for finding in findings.snapshot()] == ["dds-no-interface"]
    network.close()


def test_an_interface_without_multicast_is_used_without(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    tunnel = Interface("tun0", 7, ("10.8.0.2",), loopback=False, multicast=False)
    present = Present(monkeypatch, WLAN, tunnel, LO)
    present.refused.add("wlan0")
    findings = Findings()
    network = Network(replace(settings, interfaces=()), findings=findings)
    network.open(loop)
    assert present.groups == ["+3", "+1"]
    assert hosts(network) == ["10.1.0.1", "10.8.0.2"]
    (finding,) = findings.snapshot()
    assert (finding.code, finding.subject) == ("dds-no-multicast", "wlan0")
    network.close()


def test_localhost_with_a_peer_elsewhere_sends_no_multicast_out(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    present = Present(monkeypatch, ETH, LO)
    network = Network(replace(settings, range=Range.LOCALHOST, interfaces=(), peers=("10.9.9.9:7500",)))
    network.open(loop)
    assert present.senders == ["lo"]
    assert hosts(network) == ["10.0.0.1", "10.0.0.2"]
    assert core_of(network).addresses.announce_to[-1] == udp4("10.9.9.9", 7500)
    network.close()


def test_opening_without_any_interface_is_told(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    present = Present(monkeypatch)
    findings = Findings()
    network = Network(replace(settings, interfaces=()), findings=findings)
    network.open(loop)
    assert [finding.code for finding in findings.snapshot()] == ["dds-no-interface"]
    present.present = (ETH,)
    network._refresh()
    assert hosts(network) == ["10.0.0.1", "10.0.0.2"]
    network.close()


def test_many_addresses_are_told_up_to_a_bound(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    many = tuple(replace(ETH, name=f"br{n}", index=n, addresses=(f"10.0.{n}.1",)) for n in range(2, 60))
    Present(monkeypatch, *many)
    network = Network(replace(settings, interfaces=()))
    network.open(loop)
    assert len(hosts(network)) == 16
    network.close()


def test_static_peers_are_looked_up(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def addresses(name: str, *_: object) -> list[Any]:
        asked.append(name)
        if name == "nobody":
            raise socket.gaierror("no such name")
        return [(socket.AF_INET, socket.SOCK_DGRAM, 17, "", ("10.0.0.7", 0))]

    monkeypatch.setattr(socket, "getaddrinfo", addresses)
    findings = Findings()
    network = Network(
        replace(settings, peers=("robot", "nobody", "10.0.0.8:7777", "localhost:7500"), known_indices=2),
        findings=findings,
    )
    network.open(loop)
    core = core_of(network)
    ports = Ports(settings.domain)
    fixed = (
        udp4("239.255.0.1", ports.multicast),
        udp4("127.0.0.1", ports.unicast(1)),
    )
    assert core.addresses.announce_to == (*fixed, udp4("10.0.0.8", 7777), udp4("127.0.0.1", 7500))
    spin(loop, lambda: len(core.told) == 2 and findings.snapshot())
    found: Addresses = core.told[-1]
    assert found.announce_to == (
        *fixed,
        udp4("10.0.0.7", ports.unicast(0)),
        udp4("10.0.0.7", ports.unicast(1)),
        udp4("10.0.0.8", 7777),
        udp4("127.0.0.1", 7500),
    )
    (finding,) = findings.snapshot()
    assert (finding.code, finding.subject) == ("dds-peer-unknown", "nobody")
    network.close()
    loop.run_until_complete(loop.shutdown_default_executor())
    assert sorted(asked) == ["nobody", "robot"]


def test_an_unknown_interface_is_refused(settings: NetworkSettings, loop: asyncio.AbstractEventLoop) -> None:
    network = Network(replace(settings, interfaces=("nosuch0",)))
    with pytest.raises(NetworkError, match=r"^nosuch0: .* Choose one of: .*lo \(127\.0\.0\.1\)\.$"):
        network.open(loop)
    network.close()


def test_one_unknown_interface_among_others_is_told(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    findings = Findings()
    network = Network(replace(settings, interfaces=("lo", "nosuch0")), findings=findings)
    network.open(loop)
    (finding,) = findings.snapshot()
    assert (finding.code, finding.subject) == ("dds-interface-missing", "nosuch0")
    network.close()


def test_failing_to_open_leaves_nothing_behind(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    narrow = replace(settings, indices=1)
    first, second = Network(narrow), Network(narrow)
    first.open(loop)
    with pytest.raises(NetworkError, match="in use"):
        second.open(loop)
    first.close()
    second.open(loop)  # the ports are free now
    assert second.index == 0
    second.close()


def test_a_loop_that_was_closed_may_be_followed_by_another(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    first = asyncio.new_event_loop()
    network = Network(settings)
    network.open(first)
    first.run_until_complete(asyncio.sleep(0))
    first.close()
    network.open(loop)
    core = core_of(network)
    port = core.addresses.metatraffic_unicast[0].port
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.sendto(b"hello", ("127.0.0.1", port))
        spin(loop, lambda: core.received)
    network.close()


def test_opening_twice_and_after_the_end(settings: NetworkSettings, loop: asyncio.AbstractEventLoop) -> None:
    other = asyncio.new_event_loop()
    network = Network(settings)
    network.open(loop)
    network.open(loop)
    with pytest.raises(NetworkError, match="another loop"):
        network.open(other)
    network.close()
    with pytest.raises(NetworkError, match="closed"):
        network.open(loop)
    other.close()


def test_sharing(settings: NetworkSettings, loop: asyncio.AbstractEventLoop) -> None:
    other = asyncio.new_event_loop()
    one = Network.shared(settings, loop)
    assert Network.shared(settings, loop) is one
    elsewhere = Network.shared(settings, other)
    different = Network.shared(replace(settings, known_indices=3), loop)
    assert len({one, elsewhere, different}) == 3
    assert [network.index for network in (one, elsewhere, different)] == [0, 1, 2]
    one.close()
    assert core_of(one).closed == 0
    one.close()
    assert core_of(one).closed == 1
    again = Network.shared(settings, loop)
    assert again is not one
    assert again.index == 0
    for network in (again, elsewhere, different):
        network.close()
    other.close()


def test_closing_after_the_loop(settings: NetworkSettings) -> None:
    loop = asyncio.new_event_loop()
    network = Network(settings)
    network.open(loop)
    loop.close()
    network.close()
    assert core_of(network).closed == 1


def test_a_fork_says_no_and_leaves_the_parent_alone(
    settings: NetworkSettings, loop: asyncio.AbstractEventLoop
) -> None:
    network = Network.shared(settings, loop)
    core = core_of(network)
    child = os.fork()
    if child == 0:  # no assertion may leave the child
        said = 1
        try:
            network.poke()
            core.transmit(b"x", udp4("127.0.0.1", 7410))
            network.open(loop)
        except NetworkError as error:
            said = 0 if "fork" in str(error) and network.counters.sent == 0 else 2
        except BaseException:
            said = 3
        try:
            network.close()
        except BaseException:
            said = 4
        os._exit(said)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    with Peer() as peer:
        peer.send(b"still here", Ports(settings.domain).unicast(0))
        spin(loop, lambda: core.received)
    network.close()
