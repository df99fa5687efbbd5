"""Our side of a test with foreign peers: a `dds` space on an asyncio loop that runs while the test waits.

The test itself stays a plain function: `rig.until(condition)` and `rig.ask(peer, command, ...)` run the loop.
"""

import asyncio
import random
import time
from collections.abc import Callable
from typing import Any, Final, Self

import pytest

from muros.findings import Finding
from muros.space import Reader, Service, Space, open_space
from tests.dds.peers import SPARE_TIME, WAIT, Peer

__all__ = ["ARRAY", "BASIC_TYPES", "STRING", "Losses", "Rig", "take_all"]

STRING: Final = "std_msgs::msg::dds_::String_"
ARRAY: Final = "std_msgs::msg::dds_::UInt8MultiArray_"
PATIENCE: Final = 30.0
"""Seconds that anything may take on a busy machine before a test gives up."""


def basic_types(name: str) -> Service:
    """A service of type test_msgs/srv/BasicTypes."""
    kind = "test_msgs::srv::dds_::BasicTypes"
    return Service(name, f"rq{name}Request", f"rr{name}Reply", f"{kind}_Request_", f"{kind}_Response_")


BASIC_TYPES: Final = basic_types("/sum")


class Losses:
    """Loses a share of all datagrams, the same ones for the same seed. For the space's option `fault`."""

    def __init__(self, share: float, seed: int = 1) -> None:
        self.share = share
        self.lost = self.seen = 0
        self._random = random.Random(seed)

    def __call__(self, datagram: bytes) -> bool:
        self.seen += 1
        lost = self._random.random() < self.share
        self.lost += lost
        return lost


class Rig:
    """A loop, and spaces that live on it, on the loopback interface only."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        self.spaces: list[Space] = []
        self.told: list[Finding] = []

    def space(self, domain: int, engine: str = "dds", **options: Any) -> Space:
        """Open a space and attach it."""
        options.setdefault("interfaces", ("lo",))
        space = open_space(f"{engine}:{domain}", **options)
        space.findings.on_finding(self.told.append)
        space.attach(self.loop)
        self.spaces.append(space)
        return space

    def run(self, seconds: float) -> None:
        """Let the loop run."""
        self.loop.run_until_complete(asyncio.sleep(seconds))

    def until(self, condition: Callable[[], object], what: str = "", wait: float = PATIENCE) -> None:
        """Let the loop run until `condition` holds; the test fails when it takes too long."""
        if not self.eventually(condition, wait):
            where = ", ".join(space.url for space in self.spaces)
            pytest.fail(f"not within {wait:.0f} s in {where}: {what or condition}; findings: {self.told}")

    def eventually(self, condition: Callable[[], object], wait: float = PATIENCE) -> bool:
        """Let the loop run until `condition` holds, at most `wait` seconds; whether it does."""
        end = time.monotonic() + wait

        async def watch() -> bool:
            while not condition():
                if time.monotonic() > end:
                    return False
                await asyncio.sleep(0.002)
            return True

        return self.loop.run_until_complete(watch())

    def ask(self, peer: Peer, command: str, **arguments: Any) -> Any:
        """A peer's command while the loop runs."""
        peer.begin(command, **arguments)
        return self.answer(peer, arguments.get("wait", WAIT))

    def answer(self, peer: Peer, wait: float = WAIT) -> Any:
        """The answer to a command begun, while the loop runs."""
        self.eventually(peer.ready, wait + SPARE_TIME)
        return peer.result(0)

    def matched(self, endpoint: Any, count: int = 1) -> None:
        """Wait until a writer or reader has `count` counterparts."""
        self.until(lambda: len(endpoint.matched) == count, f"{count} matched with {endpoint}")

    def collect(self, reader: Reader, count: int, wait: float = PATIENCE) -> list[bytes]:
        """The bodies of the next samples: `count`, or what came."""
        got: list[bytes] = []

        def enough() -> bool:
            got.extend(take_all(reader))
            return len(got) >= count

        self.eventually(enough, wait)
        return got

    def close(self) -> None:
        """Close all spaces and the loop."""
        for space in self.spaces:
            space.close()
        self.loop.run_until_complete(asyncio.sleep(0))
        self.loop.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def take_all(reader: Reader) -> list[bytes]:
    """The bodies of everything a reader has."""
    bodies = []
    while (sample := reader.take()) is not None:
        bodies.append(sample.data)
    return bodies
