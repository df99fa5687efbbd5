"""What happens inside namespaces in `test_peers_on_a_lan.py`: muros and a peer, with a cable between them or not."""

import asyncio
import os
import subprocess
import tempfile
from pathlib import Path

from muros.rtps import EndpointQos
from muros.rtps.net import NetworkSettings, Range
from tests.dds import peers
from tests.rtps_net.namespaces import ip
from tests.rtps_net.station import Station, until
from tests.rtps_net.two_hosts import connect

QOS = EndpointQos(depth=100)
MESSAGE = "std_msgs/msg/String"


def subnet(name: str) -> None:
    """Both as they come: they meet by multicast through the cable."""
    asyncio.run(_meet(name, NetworkSettings(), {}))


def static_peer(name: str) -> None:
    """Both look no further than their host, but muros knows the other's host."""
    settings = NetworkSettings(range=Range.LOCALHOST, peers=("10.1.0.2",))
    asyncio.run(_meet(name, settings, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}))


def known_by_the_peer(name: str) -> None:
    """Only the other one knows where to look; the network carries no multicast."""
    asyncio.run(_meet(name, NetworkSettings(group="239.255.0.9"), {"ROS_STATIC_PEERS": "10.1.0.1"}))


def same_host_subnet(name: str) -> None:
    """One host with a network, both as they come."""
    asyncio.run(_meet(name, NetworkSettings(), {}, same=True))


def same_host_localhost(name: str) -> None:
    """Both look no further than their host."""
    local = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    asyncio.run(_meet(name, NetworkSettings(range=Range.LOCALHOST), local, same=True))


def same_host_mixed(name: str) -> None:
    """One looks no further than its host, the other does."""
    local = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    asyncio.run(_meet(name, NetworkSettings(), local, same=True))


async def _meet(
    name: str, settings: NetworkSettings, variables: dict[str, str], *, same: bool = False
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        other = _start(name, variables, Path(folder) / "log", same)
        with other:
            if same:
                ip("link set lo up")
                ip("link add v0 type veth peer name v1")
                ip("link set v1 up")
                ip("link set v0 up")
                ip("addr add 10.1.0.1/24 dev v0")
            else:
                connect(other.process.pid, "10.1.0")
            async with Station(settings, "here") as here:
                node = await other.ask("node", name="peer", domain=0)
                hearing = await other.ask("subscription", node=node, topic="/there", type=MESSAGE, qos=100)
                saying = await other.ask("publisher", node=node, topic="/back", type=MESSAGE, qos=100)
                writer = here.writer("rt/there", QOS)
                reader = here.reader("rt/back", QOS)
                await until(lambda: writer.matched and reader.matched)
                await other.ask("matched", thing=hearing)
                await other.ask("matched", thing=saying)
                for number in range(20):
                    text = f"hello {number:02}".encode() + b"\0"
                    here.write("rt/there", len(text).to_bytes(4, "little") + text + bytes(-len(text) % 4))
                taken = await other.ask("take", subscription=hearing, count=20)
                assert taken == [{"data": f"hello {number:02}"} for number in range(20)], taken
                await other.ask("publish", publisher=saying, message={"data": "answer"}, count=20)
                await until(lambda: len(here.got["rt/back"]) == 20)
                assert all(b"answer\0" in payload for payload in here.got["rt/back"])


def _start(name: str, variables: dict[str, str], log: Path, same: bool) -> peers.Peer:
    """The peer with a network of its own, or this one's, and no settings but `variables`."""
    words = [] if same else ["unshare", "--net"]
    given = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(("ROS_", "RMW_", "FAST", "CYCLONE"))
    }
    with log.open("wb") as printed:
        process = subprocess.Popen(
            [*words, str(peers.python_of(name)), str(peers.PROGRAMS / peers.ENVIRONMENTS[name])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=printed,
            env=given | {"PYTHONUNBUFFERED": "1", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"} | variables,
        )
    return peers.Peer(name, process, log)
