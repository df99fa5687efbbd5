"""UDP and discovery: what datagrams alone have."""

from __future__ import annotations

import asyncio
import errno
import os
import socket
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import pytest

from muros.links import DiscoveryLink, LinkError, UdpLink
from muros.links._hosts import file_holder, interface_addresses, port_holder
from tests.links.rigs import UdpRig, Watcher, has_ipv6


class Reluctant(UdpLink):
    """A socket that refuses the first ``refusals`` messages with ``number``."""

    def __init__(self, refusals: int, number: int, **options: Any) -> None:
        super().__init__(0, "127.0.0.1", **options)
        self.refusals = refusals
        self.number = number

    def _transmit(self, sock: socket.socket, message: bytes, address: Any) -> None:
        if self.refusals:
            self.refusals -= 1
            raise OSError(self.number, os.strerror(self.number))
        super()._transmit(sock, message, address)


def receiver() -> tuple[socket.socket, tuple[str, int]]:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", 0))
    sock.settimeout(10)
    return sock, sock.getsockname()


class TestUdp:
    def test_the_port_taken_says_by_whom(self) -> None:
        async def main() -> None:
            first = UdpLink(0, "127.0.0.1")
            first.open(Watcher())
            second = UdpLink(first.port, "127.0.0.1")
            own = Path("/proc/self/comm").read_text().strip()
            with pytest.raises(LinkError) as caught:
                second.open(Watcher())
            assert str(caught.value) == (
                f"udp4 127.0.0.1:{first.port}: address in use by {own} (pid {os.getpid()}). "
                "Stop it or choose another port."
            )
            assert not second.is_open
            first.close()
            second.open(Watcher())
            second.close()

        asyncio.run(main())

    @pytest.mark.parametrize(
        ("port", "host", "words"),
        [
            (0, "192.0.2.77", "this host has no such address. Choose one of its own"),
            (70000, "127.0.0.1", "there is no such port. Ports go from 0"),
        ],
    )
    def test_an_address_it_cannot_have(self, port: int, host: str, words: str) -> None:
        async def main() -> None:
            with pytest.raises(LinkError, match=words):
                UdpLink(port, host).open(Watcher())

        asyncio.run(main())

    def test_a_link_opened_again_keeps_its_port(self) -> None:
        async def main() -> None:
            link = UdpLink(0, "127.0.0.1")
            link.open(Watcher())
            port = link.port
            link.close()
            link.open(Watcher())
            assert link.port == port > 0
            assert link.name == f"udp4 127.0.0.1:{port}"
            link.close()

        asyncio.run(main())

    def test_a_peer_that_is_gone_harms_nobody(self, tmp_path: Path) -> None:
        async def main() -> None:
            rig = UdpRig(tmp_path)
            events = Watcher(echo=True)
            rig.link.open(events)
            gone, address = receiver()
            gone.close()
            for _ in range(10):
                assert rig.link.send(b"to nobody", address)  # ICMP comes back, or nothing: both are silence
            client = await rig.client()
            await client.send(b"hello")
            assert await client.receive() == b"hello"
            rig.close()

        asyncio.run(main())

    def test_what_the_network_refuses_is_told(self) -> None:
        async def main() -> None:
            link = UdpLink(0, "127.0.0.1")
            events = Watcher()
            link.open(events)
            assert link.send(b"all", ("255.255.255.255", 9)) is False  # needs SO_BROADCAST
            assert link.counters.dropped == {"network-refused": 1}
            assert link.counters.sent == 0
            assert "Permission denied" in events.problems[0][2]
            link.close()

        asyncio.run(main())

    @pytest.mark.parametrize("number", [errno.EAGAIN, errno.ENOBUFS])
    def test_a_full_socket_queues_in_order(self, number: int) -> None:
        async def main() -> None:
            link = Reluctant(3, number)
            link.open(Watcher())
            sock, address = receiver()
            sent = [b"%d" % n for n in range(200)]
            for message in sent:
                assert link.send(message, address)
            loop = asyncio.get_running_loop()
            got = [await loop.run_in_executor(None, sock.recv, 100) for _ in sent]
            assert got == sent
            assert link.counters.sent == len(sent)
            assert not link._queue
            assert link._queued == 0
            sock.close()
            link.close()

        asyncio.run(main())

    def test_a_full_queue_drops_the_newest(self) -> None:
        async def main() -> None:
            link = Reluctant(1, errno.EAGAIN, queue_bytes=250)
            events = Watcher()
            link.open(events)
            sock, address = receiver()
            taken = [link.send(bytes([n]) * 100, address) for n in range(5)]
            assert taken == [True, True, False, False, False]
            assert link.counters.dropped == {"queue-full": 3}
            assert events.codes() == ["queue-full"] * 3
            loop = asyncio.get_running_loop()
            got = [await loop.run_in_executor(None, sock.recv, 200) for _ in range(2)]
            assert [data[0] for data in got] == [0, 1]
            sock.close()
            link.close()

        asyncio.run(main())

    def test_what_was_queued_and_then_refused_is_not_counted_as_sent(self) -> None:
        async def main() -> None:
            link = Reluctant(1, errno.EAGAIN)
            events = Watcher()
            link.open(events)
            assert link.send(b"all", ("255.255.255.255", 9))
            await events.until(lambda: events.problems)
            assert link.counters.sent == link.counters.sent_bytes == 0
            assert link.counters.dropped == {"network-refused": 1}
            link.close()

        asyncio.run(main())

    def test_one_wake_up_takes_a_bounded_number(self) -> None:
        async def main() -> None:
            link = UdpLink(0, "127.0.0.1", drain=8)
            events = Watcher()
            link.open(events)
            sock, _ = receiver()
            for n in range(20):
                sock.sendto(b"%d" % n, ("127.0.0.1", link.port))
            batches = []
            original = link._readable

            def counted() -> None:
                before = len(events.messages)
                original()
                batches.append(len(events.messages) - before)

            asyncio.get_running_loop().add_reader(link._socket, counted)  # type: ignore[arg-type]
            await events.until(lambda: len(events.messages) == 20)
            assert batches == [8, 8, 4]
            sock.close()
            link.close()

        asyncio.run(main())

    def test_what_the_kernel_threw_away_is_counted_and_told(self) -> None:
        async def main() -> None:
            link = UdpLink(0, "127.0.0.1", receive_buffer=4096)
            events = Watcher()
            link.open(events)
            sock, _ = receiver()
            for _ in range(50):
                sock.sendto(bytes(1000), ("127.0.0.1", link.port))
            await events.until(lambda: events.problems)
            ((code, what, _, remedy, n),) = events.problems
            assert (code, what) == ("receive-buffer-full", f"messages to {link.name} lost")
            assert "net.core.rmem_max" in remedy
            assert n == link.counters.dropped[code] == 50 - len(events.messages)
            assert 0 < len(events.messages) < 50
            sock.close()
            link.close()

        asyncio.run(main())

    def test_an_empty_datagram_is_no_message(self) -> None:
        async def main() -> None:
            link = UdpLink(0, "127.0.0.1")
            events = Watcher()
            link.open(events)
            sock, _ = receiver()
            sock.sendto(b"", ("127.0.0.1", link.port))
            sock.sendto(b"x", ("127.0.0.1", link.port))
            await events.until(lambda: events.messages)
            assert [data for data, _ in events.messages] == [b"x"]
            assert link.counters.dropped == {"empty-message": 1}
            assert events.codes() == ["empty-message"]
            sock.close()
            link.close()

        asyncio.run(main())

    def test_udp4_and_udp6_share_a_port_number(self) -> None:
        async def main() -> None:
            four = UdpLink(0)
            four.open(Watcher())
            six = UdpLink(four.port, family=6)
            six.open(Watcher())
            assert six.name == f"udp6 [::]:{four.port}"
            four.close()
            six.close()

        if not has_ipv6():
            pytest.skip("this machine has no IPv6 loopback")
        asyncio.run(main())


class TestLocators:
    def test_bound_to_any_address_it_lists_those_of_the_host(self) -> None:
        locators = UdpLink(8888).locators()
        assert {(locator.family, locator.port) for locator in locators} == {(4, 8888)}
        addresses = [ip_address(locator.packed) for locator in locators]
        assert ip_address("127.0.0.1") in addresses
        assert [address.is_loopback for address in addresses] == sorted(
            address.is_loopback for address in addresses
        )
        assert all(len(locator.packed) == 16 for locator in UdpLink(8888, family=6).locators())

    def test_bound_to_one_address_it_lists_that(self) -> None:
        (locator,) = UdpLink(9999, "127.0.0.1").locators()
        assert locator == (4, bytes([127, 0, 0, 1]), 9999)
        assert DiscoveryLink().locators() == []

    def test_interfaces_have_names(self) -> None:
        assert ("lo", ip_address("127.0.0.1")) in interface_addresses(4)


class TestHolders:
    def test_who_has_a_port(self) -> None:
        with socket.socket() as listener:
            listener.bind(("127.0.0.1", 0))
            listener.listen()
            port = listener.getsockname()[1]
            assert f"(pid {os.getpid()})" in str(port_holder("tcp", port))
            assert port_holder("udp", port) is None
        assert port_holder("tcp", port) is None

    def test_who_has_a_file(self, tmp_path: Path) -> None:
        path = tmp_path / "device"
        with path.open("w"):
            assert f"(pid {os.getpid()})" in str(file_holder(str(path)))
        assert file_holder(str(path)) is None


class TestDiscovery:
    def test_multicast_reaches_every_agent_on_the_port(self) -> None:
        async def main() -> None:
            first = DiscoveryLink(0, interface="lo")
            heard = [Watcher(), Watcher()]
            first.open(heard[0])
            second = DiscoveryLink(first.port, interface="127.0.0.1")
            second.open(heard[1])
            assert first.discovery_only
            assert first.name == f"discovery 239.255.0.2:{first.port}"
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
                sender.bind(("127.0.0.1", 0))
                sender.settimeout(10)
                sender.sendto(b"who is there?", ("239.255.0.2", first.port))
                for events in heard:
                    await events.until(lambda events=events: events.messages)  # type: ignore[misc]
                    assert events.messages == [(b"who is there?", sender.getsockname())]
                assert second.send(b"I am", sender.getsockname())
                assert sender.recv(100) == b"I am"
            first.close()
            second.close()

        asyncio.run(main())

    def test_by_default_it_listens_on_every_interface(self, monkeypatch: pytest.MonkeyPatch) -> None:
        here = [entry for entry in interface_addresses(4) if entry.address.is_loopback]
        monkeypatch.setattr(
            "muros.links._udp.interface_addresses", lambda family: here
        )  # tests stay on loopback

        async def main() -> None:
            link = DiscoveryLink(0)
            events = Watcher()
            link.open(events)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
                sender.sendto(b"who is there?", ("239.255.0.2", link.port))
                await events.until(lambda: events.messages)
            assert not events.problems
            link.close()

        asyncio.run(main())

    def test_an_interface_that_is_not_there(self) -> None:
        async def main() -> None:
            with pytest.raises(LinkError, match=r"no interface wlan99 .* Choose one of: .*lo"):
                DiscoveryLink(0, interface="wlan99").open(Watcher())

        asyncio.run(main())

    def test_interfaces_that_come_up_later_are_joined(self, monkeypatch: pytest.MonkeyPatch) -> None:
        present = [entry for entry in interface_addresses(4) if entry.interface == "lo"]
        now: list[Any] = []
        monkeypatch.setattr("muros.links._udp.interface_addresses", lambda family: list(now))
        monkeypatch.setattr("muros.links._udp.JOIN_PERIOD_S", 0.001)

        async def main() -> None:
            link = DiscoveryLink(0)
            events = Watcher()
            link.open(events)
            assert events.codes() == ["no-multicast"]
            now.extend(present)
            async with asyncio.timeout(10):
                while not link._joined:
                    await asyncio.sleep(0)
            now.clear()
            async with asyncio.timeout(10):
                while link._joined:
                    await asyncio.sleep(0)
            now.extend(present)  # the kernel still has it: joining again is no error
            async with asyncio.timeout(10):
                while not link._joined:
                    await asyncio.sleep(0)
            link.close()

        asyncio.run(main())
