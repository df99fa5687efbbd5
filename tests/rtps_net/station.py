"""A participant on a real network for tests: it says what it hears, and as a program answers from another process.

`python -m tests.rtps_net.station '{"domain": 7, ...}'` is named "echo": what comes on "rt/ping" it sends back on
"rt/pong", until its input closes. Its first line of output is its participant index.
"""

import asyncio
import json
import os
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from muros.rtps import (
    Durability,
    EndpointQos,
    History,
    LocalReader,
    LocalWriter,
    ParticipantEvent,
    ParticipantFound,
    ParticipantLost,
    Received,
)
from muros.rtps.net import Network, NetworkSettings, Range

ROOT = Path(__file__).resolve().parents[2]
TYPE = "std_msgs::msg::dds_::String_"
HEAD = b"\0\1\0\0"
KEEP_ALL = EndpointQos(history=History.KEEP_ALL)
LATE_TOO = EndpointQos(history=History.KEEP_ALL, durability=Durability.TRANSIENT_LOCAL)
"""The two sides of a match do not learn of it at the same time: what is written between is kept for the later one."""
TIME_LIMIT = 10.0


class Station:
    """A participant with writers and readers by topic; everything it does is followed by a poke."""

    def __init__(
        self,
        settings: NetworkSettings,
        name: str,
        *,
        fault: Callable[[bytes], bool] | None = None,
    ) -> None:
        self.network = Network(settings, fault=fault)
        self.here: list[str] = []
        self.got: dict[str, list[bytes]] = {}
        self.on_sample: Callable[[str, bytes], object] = lambda topic, payload: None
        self._writers: dict[str, LocalWriter] = {}
        self._readers: dict[str, LocalReader] = {}
        self._core = self.network.core.participant(
            os.urandom(12), name=name, on_event=self._on_event, now=self.network.clock()
        )

    def open(self) -> Self:
        """On the loop that runs."""
        self.network.open(asyncio.get_running_loop())
        return self

    def close(self) -> None:
        """Says goodbye."""
        self.network.close()

    def write(self, topic: str, payload: bytes) -> bool:
        """False when there is no room."""
        number = self._writers[topic].write(HEAD + payload, self.network.clock())
        self.network.poke()
        return number != 0

    def writer(self, topic: str, qos: EndpointQos = KEEP_ALL) -> LocalWriter:
        """A new writer."""
        made = self._writers[topic] = self._core.writer(topic, TYPE, qos, now=self.network.clock())
        self.network.poke()
        return made

    def reader(self, topic: str, qos: EndpointQos = KEEP_ALL) -> LocalReader:
        """A new reader, which collects in `got`."""
        got = self.got[topic] = []

        def on_sample(sample: Received) -> None:
            payload = sample.payload[len(HEAD) :]
            got.append(payload)
            self.on_sample(topic, payload)

        made = self._readers[topic] = self._core.reader(topic, TYPE, qos, on_sample, now=self.network.clock())
        self.network.poke()
        return made

    def _on_event(self, event: ParticipantEvent) -> None:
        if isinstance(event, ParticipantFound):
            self.here.append(event.participant.name)
        elif isinstance(event, ParticipantLost):
            self.here.remove(event.participant.name)

    async def __aenter__(self) -> Self:
        return self.open()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


async def until(so: Callable[[], object]) -> None:
    """Waits, within a bound."""
    async with asyncio.timeout(TIME_LIMIT):
        while not so():
            await asyncio.sleep(0.002)


async def write_all(station: Station, topic: str, payloads: Sequence[bytes]) -> None:
    """Writes as fast as there is room."""
    left = deque(payloads)

    def write_some() -> bool:
        while left and station.write(topic, left[0]):
            left.popleft()
        return not left

    await until(write_some)


class Process:
    """A station in another process, that echoes. `before` are words before the command, `settings` as JSON has them."""

    def __init__(self, settings: dict[str, Any], *before: str) -> None:
        self._process = subprocess.Popen(
            [*before, sys.executable, "-m", "tests.rtps_net.station", json.dumps(settings)],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def start(self) -> int:
        """Tells it to open its network, and returns the participant index it has got."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write("open\n")
        self._process.stdin.flush()
        return int(self._process.stdout.readline())

    def leave(self) -> None:
        """It says goodbye and ends."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        try:
            assert self._process.wait(TIME_LIMIT) == 0
        finally:
            self._process.stdout.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()


async def exchange(station: Station, sizes: Sequence[int]) -> None:
    """Sends samples of these sizes (multiples of 4) to the echo, and waits for what comes back."""
    station.reader("rt/pong", LATE_TOO)
    writer = station.writer("rt/ping", LATE_TOO)
    await until(lambda: writer.matched)
    await until(lambda: station._readers["rt/pong"].matched)
    sent = [number.to_bytes(4, "big") + bytes(size) for number, size in enumerate(sizes)]
    await write_all(station, "rt/ping", sent)
    await until(lambda: len(station.got["rt/pong"]) >= len(sent))
    assert station.got["rt/pong"] == sent


async def _echo(settings: NetworkSettings) -> None:
    station = Station(settings, "echo")
    station.on_sample = lambda topic, payload: station.write("rt/pong", payload)
    station.writer("rt/pong", LATE_TOO)
    station.reader("rt/ping", LATE_TOO)
    async with station:
        print(station.network.index, flush=True)
        loop = asyncio.get_running_loop()
        ended = loop.create_future()
        loop.add_reader(sys.stdin, lambda: ended.set_result(os.read(0, 100)))
        await ended


def main() -> None:
    """The program."""
    given = json.loads(sys.argv[1])
    given["range"] = Range(given.get("range", "SUBNET"))
    for name in ("peers", "interfaces"):
        given[name] = tuple(given.get(name, ()))
    assert sys.stdin.readline() == "open\n"
    asyncio.run(_echo(NetworkSettings(**given)))


if __name__ == "__main__":
    main()
