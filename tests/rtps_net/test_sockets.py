"""The search for ports, and sockets as they are set up, on loopback."""

import errno
import os
import socket
from collections.abc import Iterator

import pytest

from muros.rtps import Ports
from muros.rtps.net import Interface, NetworkError
from muros.rtps.net._sockets import (
    Pair,
    bind_multicast,
    bind_pair,
    granted,
    join,
    leave,
    multicast_sender,
    overflown,
)
from tests.rtps_net.quiet import quiet_domain

LO = Interface("lo", socket.if_nametoindex("lo"), ("127.0.0.1",), loopback=True, multicast=True)
GROUP = "239.255.0.1"


@pytest.fixture
def ports() -> Iterator[Ports]:
    with quiet_domain() as domain:
        yield Ports(domain)


def close(*pairs: Pair) -> None:
    for pair in pairs:
        pair.metatraffic.close()
        pair.user.close()


def test_pairs_are_given_from_index_0_upwards(ports: Ports) -> None:
    pairs = [bind_pair(ports, "127.0.0.1", 120) for _ in range(3)]
    assert [pair.index for pair in pairs] == [0, 1, 2]
    for pair in pairs:
        assert pair.metatraffic.getsockname() == ("127.0.0.1", ports.unicast(pair.index))
        assert pair.user.getsockname() == ("127.0.0.1", ports.user_unicast(pair.index))
        assert not pair.user.getblocking()
        assert not pair.user.get_inheritable()
    close(pairs[1])
    again = bind_pair(ports, "0.0.0.0", 120)
    assert again.index == 1
    close(pairs[0], pairs[2], again)


@pytest.mark.parametrize("which", ["unicast", "user_unicast"])
def test_a_half_taken_pair_is_left_alone(ports: Ports, which: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", getattr(ports, which)(0)))
        pair = bind_pair(ports, "0.0.0.0", 120)
        assert pair.index == 1
        close(pair)


def test_all_taken_says_by_whom(ports: Ports) -> None:
    pairs = [bind_pair(ports, "127.0.0.1", 2) for _ in range(2)]
    with pytest.raises(NetworkError) as told:
        bind_pair(ports, "127.0.0.1", 2)
    close(*pairs)
    text = str(told.value)
    assert f"udp ports {ports.unicast(0)} to {ports.user_unicast(1)}" in text
    assert f"all 2 participant indices of domain {(ports.base - 7400) // 250} are in use" in text
    assert f"(pid {os.getpid()})" in text
    assert "\n" not in text


def test_the_last_domain_ends_where_ports_end() -> None:
    """Ports of domain 232 would go beyond 65535 after a few indices."""
    ports = Ports(232)
    pairs = []
    with pytest.raises(NetworkError, match="in use"):  # noqa: PT012
        while True:
            pairs.append(bind_pair(ports, "127.0.0.1", 120))
    close(*pairs)
    assert len(pairs) < 120


def test_another_address_is_told() -> None:
    with pytest.raises(NetworkError, match=r"^udp 192\.0\.2\.254:7410: "):
        bind_pair(Ports(0), "192.0.2.254", 1)


@pytest.mark.parametrize("option", [socket.SO_REUSEADDR, socket.SO_REUSEPORT])
def test_the_multicast_port_is_shared_with_whoever_shares_it(ports: Ports, option: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.setsockopt(socket.SOL_SOCKET, option, 1)
        other.bind(("0.0.0.0", ports.multicast))
        with bind_multicast(GROUP, ports.multicast) as one, bind_multicast(GROUP, ports.multicast) as two:
            for sock in (one, two):
                assert join(sock, GROUP, LO)
                assert join(sock, GROUP, LO)
            with multicast_sender(LO, 1) as sender:
                sender.sendto(b"hello", (GROUP, ports.multicast))
                for sock in (one, two):
                    data, source = sock.recvfrom(100)
                    assert (data, source[0]) == (b"hello", "127.0.0.1")
                leave(one, GROUP, LO.index)
                sender.sendto(b"more", (GROUP, ports.multicast))
                assert two.recv(100) == b"more"
                with pytest.raises(BlockingIOError):
                    one.recv(100)


def test_a_multicast_port_that_is_not_shared_is_told(ports: Ports) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("0.0.0.0", ports.multicast))
        with pytest.raises(NetworkError) as told:
            bind_multicast(GROUP, ports.multicast)
    assert str(told.value).startswith(f"udp {GROUP}:{ports.multicast}: address in use by ")
    assert f"(pid {os.getpid()})" in str(told.value)


def test_what_others_joined_is_not_heard(ports: Ports) -> None:
    with (
        bind_multicast(GROUP, ports.multicast) as joined,
        bind_multicast(GROUP, ports.multicast) as aside,
        multicast_sender(LO, 1) as sender,
    ):
        join(joined, GROUP, LO)
        sender.sendto(b"hello", (GROUP, ports.multicast))
        assert joined.recv(100) == b"hello"
        with pytest.raises(BlockingIOError):
            aside.recv(100)


def test_interfaces_that_are_gone() -> None:
    gone = Interface("gone0", 2**20, ("192.0.2.254",), loopback=False, multicast=True)
    with pytest.raises(OSError, match=r".") as told:
        multicast_sender(gone, 1)
    assert told.value.errno in (errno.EADDRNOTAVAIL, errno.ENODEV)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        assert not join(sock, GROUP, gone)
        leave(sock, GROUP, gone.index)


def test_buffers_grow_and_drops_are_seen() -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        receiver.bind(("127.0.0.1", 0))
        before = receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        assert granted(receiver, 1 << 20) * 2 >= before
        assert granted(receiver, 4096) <= 4096
        assert overflown(receiver) == 0
        for _ in range(20):
            sender.sendto(bytes(1000), receiver.getsockname())
        assert overflown(receiver) > 0
