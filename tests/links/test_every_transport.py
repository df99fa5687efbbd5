"""The promises of the door, kept by every transport alike."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from muros.links import Link, LinkError
from tests.links.rigs import RIGS, Rig, Watcher, has_ipv6

PEERS = 20
SIZES = (1, 2, 3, 4, 59, 60, 61, 62, 63, 64, 255, 256, 512, 4095, 4096, 4097, 16384, 32768, 65535)


@pytest.fixture(params=RIGS)
def kind(request: pytest.FixtureRequest) -> str:
    if "6" in request.param and not has_ipv6():
        pytest.skip("this machine has no IPv6 loopback")
    return str(request.param)


def run(kind: str, folder: Path, body: Callable[[Rig, Watcher], Awaitable[None]], **watcher: Any) -> None:
    """Runs ``body`` with an open link of the kind."""

    async def main() -> None:
        rig = RIGS[kind](folder)
        events = Watcher(**watcher)
        try:
            rig.link.open(events)
            await body(rig, events)
        finally:
            rig.close()

    asyncio.run(main())


def payloads(largest: int) -> Iterator[bytes]:
    source = random.Random(1)
    for size in sorted({*(size for size in SIZES if size < largest), largest - 1, largest}):
        yield source.randbytes(size)
    yield b"\x7e" * largest  # the worst for escaping
    yield b"\0" * largest


class TestEveryTransport:
    def test_messages_of_every_size_come_and_go(self, kind: str, tmp_path: Path) -> None:
        async def body(rig: Rig, events: Watcher) -> None:
            client = await rig.client()
            n = size = 0
            for message in payloads(rig.link.mtu):
                await client.send(message)
                assert await client.receive() == message
                n += 1
                size += len(message)
            await events.until(lambda: len(events.messages) == n)
            counters = rig.link.counters
            assert (counters.received, counters.received_bytes) == (n, size)
            assert (counters.sent, counters.sent_bytes) == (n, size)
            assert not counters.dropped
            assert not events.problems

        run(kind, tmp_path, body, echo=True)

    def test_many_peers_get_each_their_own(self, kind: str, tmp_path: Path) -> None:
        async def body(rig: Rig, events: Watcher) -> None:
            clients = [await rig.client() for _ in range(PEERS)]
            for number, client in enumerate(clients):
                await client.send(b"first of %d" % number)
            await events.until(lambda: len(events.messages) == PEERS)
            addresses = dict(events.messages)
            assert len(set(addresses.values())) == PEERS
            assert len({rig.link.describe(address) for address in addresses.values()}) == PEERS
            for number in reversed(range(PEERS)):
                assert rig.link.send(b"to %d" % number, addresses[b"first of %d" % number])
            for number, client in enumerate(clients):
                assert await client.receive() == b"to %d" % number

        run(kind, tmp_path, body)

    def test_order_is_kept_through_a_burst(self, kind: str, tmp_path: Path) -> None:
        async def body(rig: Rig, events: Watcher) -> None:
            client = await rig.client()
            sent = [b"%d" % number for number in range(100)]
            for message in sent:
                await client.send(message)
            await events.until(lambda: len(events.messages) == len(sent))
            assert [data for data, _ in events.messages] == sent
            assert len({address for _, address in events.messages}) == 1

        run(kind, tmp_path, body)

    def test_too_long_is_dropped_counted_and_told(self, kind: str, tmp_path: Path) -> None:
        async def body(rig: Rig, events: Watcher) -> None:
            client = await rig.client()
            await client.send(b"hello")
            await events.until(lambda: events.messages)
            address = events.messages[0][1]
            assert rig.link.send(bytes(rig.link.mtu + 1), address) is False
            assert rig.link.counters.dropped == {"message-too-long": 1}
            ((code, what, why, remedy, n),) = events.problems
            assert (code, n) == ("message-too-long", 1)
            assert f"{rig.link.mtu + 1} B to {rig.link.describe(address)}" in what
            assert f"{rig.link.mtu} B" in why
            assert remedy
            assert rig.link.send(b"fits", address)
            assert await client.receive() == b"fits"

        run(kind, tmp_path, body)

    def test_close_and_open_again(self, kind: str, tmp_path: Path) -> None:
        async def main() -> None:
            rig = RIGS[kind](tmp_path)
            for _ in range(3):
                events = Watcher(echo=True)
                rig.link.open(events)
                assert rig.link.is_open
                with pytest.raises(LinkError, match="open already"):
                    rig.link.open(events)
                assert rig.link.is_open
                client = await rig.client()
                await client.send(b"hello")
                assert await client.receive() == b"hello"
                address = events.messages[0][1]
                rig.link.close()
                rig.link.close()
                assert not rig.link.is_open
                dropped = rig.link.counters.dropped["link-closed"]
                assert rig.link.send(b"too late", address) is False
                assert rig.link.counters.dropped["link-closed"] == dropped + 1
                rig.forget()
            rig.close()

        asyncio.run(main())

    def test_the_owner_may_close_the_link_in_a_handler(self, kind: str, tmp_path: Path) -> None:
        class Closer(Watcher):
            def on_message(self, link: Link, data: bytes, address: Any) -> None:
                super().on_message(link, data, address)
                link.close()

        async def main() -> None:
            rig = RIGS[kind](tmp_path)
            events = Closer()
            rig.link.open(events)
            client = await rig.client()
            for _ in range(3):
                try:
                    await client.send(b"hello")
                except (ConnectionError, OSError):
                    break
            await events.until(lambda: events.messages)
            assert len(events.messages) == 1
            assert not rig.link.is_open
            rig.close()

        asyncio.run(main())

    def test_a_handler_that_raises_is_told_and_harms_nobody(self, kind: str, tmp_path: Path) -> None:
        class Faulty(Watcher):
            def on_message(self, link: Link, data: bytes, address: Any) -> None:
                super().on_message(link, data, address)
                if data == b"poison":
                    raise ZeroDivisionError

        async def main() -> None:
            failures: list[Any] = []
            asyncio.get_running_loop().set_exception_handler(lambda _, context: failures.append(context))
            rig = RIGS[kind](tmp_path)
            events = Faulty(echo=True)
            rig.link.open(events)
            client = await rig.client()
            for message in (b"poison", b"hello", b"poison", b"hello"):
                await client.send(message)
            await events.until(lambda: len(events.messages) == 4)
            assert [type(failure["exception"]) for failure in failures] == [ZeroDivisionError] * 2
            assert all(rig.link.name in failure["message"] for failure in failures)
            assert not events.down
            rig.close()

        if kind in ("simulated", "pair"):
            with pytest.raises(ZeroDivisionError):  # links for tests do not hide what a test must see
                asyncio.run(main())
        else:
            asyncio.run(main())

    def test_garbage_is_counted_and_harms_nobody(self, kind: str, tmp_path: Path) -> None:
        async def body(rig: Rig, events: Watcher) -> None:
            source = random.Random(2)
            client = await rig.client()
            for size in (1, 7, 500, 3000):
                await rig.garbage(source.randbytes(size))
                await rig.garbage(b"\x7e\x01\x00\x04\x00abcdXX")
                await client.send(b"still here")
                await client.send(b"still here")  # the first may end a frame that the garbage has begun
                await client.receive()
            assert bool(rig.link.counters.framing) == rig.damages
            assert not events.down

        run(kind, tmp_path, body, echo=True)

    def test_it_says_what_it_is(self, kind: str, tmp_path: Path) -> None:
        async def body(rig: Rig, events: Watcher) -> None:
            link = rig.link
            assert link.kind
            assert events.up == [events.up[0]]
            assert link.name in repr(link)
            assert all(len(locator.packed) in (4, 16) for locator in link.locators())
            link.close()
            assert "closed" in repr(link)

        run(kind, tmp_path, body)
