"""What happens inside namespaces in `test_meeting.py`: two hosts with a cable between them."""

import asyncio
import os
import subprocess
import time
from typing import Any

from muros.rtps.net import NetworkSettings, Range
from tests.rtps_net.namespaces import ip
from tests.rtps_net.station import Process, Station, exchange, until


def subnet() -> None:
    """They meet by multicast."""
    asyncio.run(_meet(NetworkSettings(), {}))


def static_peer() -> None:
    """They keep to themselves, but one of them knows the other."""
    asyncio.run(_meet(NetworkSettings(range=Range.LOCALHOST, peers=("10.1.0.2",)), {"interfaces": ["v1"]}))


def cable() -> None:
    """The cable comes late, and another with other addresses takes its place."""
    asyncio.run(_cable())


async def _meet(settings: NetworkSettings, other: dict[str, Any]) -> None:
    with Process(other, "unshare", "--net") as echo:
        connect(echo.pid, "10.1.0")
        async with Station(settings, "here") as here:
            assert echo.start() == 0
            assert here.network.index == 0
            await exchange(here, [12] * 100 + [200_000])
            assert here.here == ["echo"]
            echo.leave()
            await until(lambda: here.here == [])


async def _cable() -> None:
    with Process({}, "unshare", "--net") as echo:
        ip("link set lo up")
        async with Station(NetworkSettings(), "here") as here:
            echo_index = asyncio.to_thread(echo.start)
            _wait_for_namespace(echo.pid)
            assert await echo_index == 0
            connect(echo.pid, "10.1.0")
            await exchange(here, [12] * 100)
            ip("link del v0")
            await until(lambda: [i.name for i in here.network.interfaces] == ["lo"])
            connect(echo.pid, "10.2.0")
            sent = [b"again..." + bytes([0, 0, 0, n]) for n in range(100)]
            for payload in sent:
                assert here.write("rt/ping", payload)
            await until(lambda: here.got["rt/pong"][100:] == sent)


def _wait_for_namespace(process: int) -> None:
    """Until it is in a namespace that is not ours."""
    mine = os.stat("/proc/self/ns/net").st_ino
    end = time.monotonic() + 10
    while os.stat(f"/proc/{process}/ns/net").st_ino == mine:
        assert time.monotonic() < end
        time.sleep(0.005)


def connect(process: int, net: str) -> None:
    """A cable between this host (.1) and that of the process (.2)."""
    _wait_for_namespace(process)
    inside = f"--net=/proc/{process}/ns/net"
    ip("link set lo up")
    ip("link add v0 type veth peer name v1")
    ip(f"link set v1 netns {process}")
    _ip_inside(inside, "link set lo up")
    _ip_inside(inside, f"addr add {net}.2/24 dev v1")
    _ip_inside(inside, "link set v1 up")
    ip(f"addr add {net}.1/24 dev v0")
    ip("link set v0 up")


def _ip_inside(where: str, words: str) -> None:
    subprocess.run(["nsenter", where, "ip", *words.split()], check=True, timeout=10)
