"""The dds engine: the contract of all engines, and what is its own."""

import asyncio
from collections.abc import Callable

from muros.findings import Findings
from muros.rtps import DomainCore, Locator
from muros.space import Space, open_space
from tests.space.conformance import VirtualTime


class Nowhere:
    """What carries a domain without a network: the participants of one process meet all the same."""

    def __init__(self, number: int, clock: Callable[[], int]) -> None:
        self.core = DomainCore(number, self.lose)
        self.clock = clock

    def lose(self, datagram: bytes, place: Locator) -> None:
        """There is nobody else."""

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        raise NotImplementedError

    def poke(self) -> None:
        raise NotImplementedError

    def close(self) -> None:
        self.core.close(self.clock())


class TestDds(VirtualTime):
    """The contract, among the participants of one process."""

    def make(self) -> Space:
        clock = self.clock

        def carrier(number: int, findings: Findings) -> Nowhere:
            return Nowhere(number, clock)

        return open_space(
            "dds:0",
            clock=clock,
            carrier=carrier,
            resource_limit=self.LIMIT,
            max_blocking_time=self.PATIENCE,
            request_wait=self.REQUEST_WAIT,
        )
