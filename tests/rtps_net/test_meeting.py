"""Participants meet over real sockets: in one process, in two, on two hosts; by multicast and without."""

import asyncio
import random
from collections.abc import Iterator
from dataclasses import replace

import pytest

from muros.rtps.net import NetworkSettings, Range
from tests.rtps_net import namespaces
from tests.rtps_net.quiet import quiet_domain
from tests.rtps_net.station import Process, Station, exchange, until, write_all

SIZES = [12] * 300 + [60_000, 70_000, 200_000, 2_000_000, 12]


@pytest.fixture
def settings() -> Iterator[NetworkSettings]:
    with quiet_domain() as domain:
        yield NetworkSettings(domain, interfaces=("lo",))


def test_two_networks_in_one_process(settings: NetworkSettings) -> None:
    async def run() -> None:
        async with Station(settings, "one") as one, Station(settings, "two") as two:
            assert (one.network.index, two.network.index) == (0, 1)
            await until(lambda: (one.here, two.here) == (["two"], ["one"]))
            writer = one.writer("rt/chatter")
            two.reader("rt/chatter")
            await until(lambda: writer.matched)
            sent = [bytes([n]) * size for n, size in enumerate((12, 1000, 100_000))]
            await write_all(one, "rt/chatter", sent)
            await until(lambda: two.got["rt/chatter"] == sent)
            two.close()
            await until(lambda: one.here == [])
            assert writer.matched == ()

    asyncio.run(run())


def test_two_processes(settings: NetworkSettings) -> None:
    async def run() -> None:
        with Process({"domain": settings.domain, "interfaces": ["lo"]}) as echo:
            async with Station(settings, "here") as here:
                assert (here.network.index, echo.start()) == (0, 1)
                await until(lambda: here.here == ["echo"])
                await exchange(here, SIZES)
                echo.leave()
                await until(lambda: here.here == [])

    asyncio.run(run())


@pytest.mark.parametrize("first", [True, False])
def test_localhost_needs_no_multicast(settings: NetworkSettings, first: bool) -> None:
    """The other listens to another group: they meet at the well-known ports of this host only."""

    async def run() -> None:
        with Process({"domain": settings.domain, "range": "LOCALHOST", "group": "239.255.0.9"}) as echo:
            if first:
                assert echo.start() == 0
            local = replace(settings, range=Range.LOCALHOST, interfaces=())
            async with Station(local, "here") as here:
                if not first:
                    assert echo.start() == 1
                await exchange(here, [12] * 20)
                assert here.here == ["echo"]

    asyncio.run(run())


def test_subnet_and_localhost_meet_on_one_host(settings: NetworkSettings) -> None:
    async def run() -> None:
        with Process({"domain": settings.domain, "range": "LOCALHOST", "group": "239.255.0.9"}) as echo:
            async with Station(replace(settings, interfaces=()), "here") as here:
                echo.start()
                await exchange(here, [12] * 20)

    asyncio.run(run())


def test_range_off_meets_nobody_but_itself(settings: NetworkSettings) -> None:
    async def run() -> None:
        with Process({"domain": settings.domain, "interfaces": ["lo"]}) as echo:
            off = replace(settings, range=Range.OFF)
            async with Station(settings, "here") as here, Station(off, "off") as alone:
                echo.start()
                await until(lambda: here.here == ["echo"])
                writer = alone.writer("rt/inside")
                alone.reader("rt/inside")
                assert writer.matched
                assert alone.write("rt/inside", b"hallo?!.")
                await until(lambda: alone.got["rt/inside"] == [b"hallo?!."])
                assert alone.here == []
                assert here.here == ["echo"]

    asyncio.run(run())


def test_loss_is_repaired(settings: NetworkSettings) -> None:
    chance = random.Random(5)

    async def run() -> None:
        with Process({"domain": settings.domain, "interfaces": ["lo"]}) as echo:
            async with Station(settings, "here", fault=lambda datagram: chance.random() < 0.1) as here:
                echo.start()
                await exchange(here, [12] * 300 + [200_000] + [1000] * 50)

    asyncio.run(run())


@pytest.mark.parametrize("what", ["subnet", "static_peer", "cable"])
def test_two_hosts(what: str) -> None:
    namespaces.run(f"tests.rtps_net.two_hosts:{what}")
