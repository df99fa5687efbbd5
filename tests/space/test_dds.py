"""The dds engine: the contract of all engines, and what is its own."""

import asyncio
from collections.abc import Callable

from muros.findings import Finding, Findings
from muros.rtps import DomainCore, DomainReport, Locator
from muros.space import Requester, Space, identity_of, open_space
from tests.space.conformance import CHATTER, KEEP_ALL, VirtualTime, numbered, take_all


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
    """The contract, among the participants of one process. Tests of its name replaced here say what is different."""

    ON_THE_WAY = VirtualTime.LIMIT
    TYPE_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"

    def make(self) -> Space:
        clock = self.clock

        def carrier(number: int, findings: Findings, report: Callable[[DomainReport], None]) -> Nowhere:
            return Nowhere(number, clock)

        return open_space(
            "dds:0",
            clock=clock,
            carrier=carrier,
            resource_limit=self.LIMIT,
            max_blocking_time=self.PATIENCE,
            request_wait=self.REQUEST_WAIT,
        )

    def heard_identity(self, requester: Requester, number: int) -> bytes:
        """Requests name the reader that waits for the reply, as ROS 2 wants it."""
        return identity_of(requester.gid[:15] + b"\x04", number)

    def test_a_stuck_reader_holds_up_others_only_for_a_while(self, space: Space, told: list[Finding]) -> None:
        """What is under way to the stuck reader waits for it: it loses less than in a space of one process."""
        writer = space.participant("talker").writer(CHATTER, KEEP_ALL)
        stuck = space.participant("stuck").reader(CHATTER, KEEP_ALL)
        quick = space.participant("quick").reader(CHATTER, KEEP_ALL)
        got: list[bytes] = []
        sent = refused = 0

        def send() -> None:
            nonlocal sent, refused
            if writer.write(numbered(sent)):
                sent += 1
            else:
                refused += 1

        writer.on_room = send
        self.settle(space)
        for _ in range(2 * self.LIMIT + 1):
            send()
            self.settle(space)
            got += take_all(quick)
        assert (sent, refused) == (2 * self.LIMIT, 1)
        self.pass_time(space, self.PATIENCE - 1)
        assert sent == 2 * self.LIMIT
        self.pass_time(space, 1)
        assert sent == 2 * self.LIMIT + 1, "the writer was called and got through"
        for _ in range(3):
            send()
            self.settle(space)
        assert refused == 1, "who is stuck holds up nobody a second time"
        got += take_all(quick)
        assert got == [numbered(i) for i in range(sent)]
        assert [(f.code, f.who) for f in told] == [("reader-stalled", "/talker")]
        assert self.take_everything(space, stuck) == [numbered(i) for i in range(sent)]
        send()
        self.settle(space)
        assert take_all(stuck) == [numbered(sent - 1)], "when it goes on taking, it gets samples again"
