"""Echo throughput of `UdpLink` beside a plain blocking relay loop and asyncio's own datagram protocol.

Each server runs in a process of its own and echoes; this process keeps a window of messages on the way and counts
what comes back. As the sender does as much work as a server, the rate alone would flatter the slower ones: the server's
own processor time for a message is the measure, and the ratio is of that. Rounds alternate, the best of each counts.

    python bench/bench_links.py [--messages 40000] [--rounds 3] [--size 64]
"""

from __future__ import annotations

import argparse
import asyncio
import multiprocessing
import resource
import socket
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from muros.links import Link, UdpLink
from muros.links.testing import Recorder

WINDOW = 64


def blocking_relay(ready: Connection) -> None:
    """The least that an echo server in Python can do."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    sock.bind(("127.0.0.1", 0))
    ready.send(sock.getsockname()[1])
    while True:
        data, address = sock.recvfrom(65536)
        sock.sendto(data, address)


def udp_link(ready: Connection) -> None:
    """The link, with an owner that answers each message with itself."""

    class Echo(Recorder):
        def on_message(self, link: Link, data: bytes, address: Any) -> None:
            link.send(data, address)

    async def main() -> None:
        link = UdpLink(0, "127.0.0.1")
        link.open(Echo())
        ready.send(link.port)
        await asyncio.Event().wait()

    asyncio.run(main())


def datagram_protocol(ready: Connection) -> None:
    """What asyncio offers itself: one callback for each datagram."""

    class Echo(asyncio.DatagramProtocol):
        transport: asyncio.DatagramTransport

        def connection_made(self, transport: Any) -> None:
            self.transport = transport

        def datagram_received(self, data: bytes, address: Any) -> None:
            self.transport.sendto(data, address)

    async def main() -> None:
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(Echo, local_addr=("127.0.0.1", 0))
        ready.send(transport.get_extra_info("sockname")[1])
        await asyncio.Event().wait()

    asyncio.run(main())


class Result(NamedTuple):
    cpu: float
    """Processor time of the server for a message, in seconds."""
    rate: float
    """Messages echoed in a second."""


def measure(server: Callable[[Connection], None], messages: int, size: int) -> Result:
    """Runs one server for so many messages."""
    before = children_cpu()
    here, there = multiprocessing.Pipe()
    process = multiprocessing.Process(target=server, args=(there,), daemon=True)
    process.start()
    try:
        if not here.poll(10):
            raise TimeoutError("the server does not start")
        address = ("127.0.0.1", here.recv())
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
            sock.connect(address)
            sock.settimeout(2)
            data = bytes(size)
            for _ in range(WINDOW):
                sock.send(data)
            start = time.perf_counter()
            for _ in range(messages):
                sock.recv(65536)
                sock.send(data)
            seconds = time.perf_counter() - start
    finally:
        process.terminate()
        process.join()
    return Result((children_cpu() - before) / messages, messages / seconds)


def children_cpu() -> float:
    """Processor time of all processes that have ended, in seconds."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--messages", type=int, default=40_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--size", type=int, default=64, help="bytes of a message")
    options = parser.parse_args()
    servers = {"blocking relay": blocking_relay, "UdpLink": udp_link, "DatagramProtocol": datagram_protocol}
    best: dict[str, Result] = {}
    for _ in range(options.rounds):
        for name, server in servers.items():
            result = measure(server, options.messages, options.size)
            best[name] = min(best.get(name, result), result)
    floor = best["blocking relay"].cpu
    for name, (cpu, rate) in best.items():
        print(
            f"{name:<18}{cpu * 1e6:6.2f} us of cpu a message, {cpu / floor:5.2f} x the relay;  {rate:9,.0f} msg/s"
        )


if __name__ == "__main__":
    main()
