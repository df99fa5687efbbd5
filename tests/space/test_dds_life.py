"""Random life on several computers with dds spaces and a bad network: what must hold whatever happens.

Participants, writers, readers, clients and servers come and go, samples and requests are sent, computers vanish, the
network parts and heals. A reliable reader that keeps all gets of each writer an unbroken sequence; a client gets no
reply that is not its own; nothing raises, and when everybody has left nothing is left in any book.
"""

import random
from typing import Any

import pytest

from muros.space import Participant, Qos, Reader, Requester, Topic, Writer
from tests.space.conformance import ADD, BEST_EFFORT, KEEP_ALL, LATCHED, numbered
from tests.space.dds_world import MS, SECOND, Computer, Net, take_all

TOPICS = [Topic("rt/a", "T"), Topic("rt/b", "T"), Topic("rt/b", "Other")]
KINDS = [KEEP_ALL, LATCHED, BEST_EFFORT, Qos(depth=3)]
STEPS = 250


class Life:
    """One run."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.net = Net(seed, loss=0.05, duplicate=0.02, reorder=0.02)
        self.computers = [
            self.net.computer(resource_limit=2000, max_blocking_time=60 * SECOND, request_wait=2 * SECOND)
            for _ in range(3)
        ]
        self.participants: list[Participant] = []
        self.writers: list[Writer] = []
        self.readers: list[tuple[Reader, dict[bytes, list[int]]]] = []
        self.clients: list[tuple[Requester, set[int], list[int]]] = []
        self.written = 0
        self.made = 0

    def step(self) -> None:
        """Something happens."""
        actions = [self.come] * 3 + [self.write] * 8 + [self.ask] * 3 + [self.go] * 2 + [self.part]
        self.random.choice(actions)()
        self.net.run(self.random.choice((0, MS, 10 * MS, 100 * MS)))
        self.check()

    def come(self) -> None:
        if len(self.participants) < 8:
            self.made += 1
            key = bytes((self.random.randrange(4),)) if self.random.random() < 0.5 else None
            space = self.random.choice(self.computers).space
            try:
                self.participants.append(space.participant(f"n{self.made}", key=key))
            except ValueError:
                assert key is not None, "it is there already"
        if not self.participants:
            return
        home = self.random.choice(self.participants)
        topic, qos = self.random.choice(TOPICS), self.random.choice(KINDS)
        kind = self.random.randrange(4)
        if kind == 0:
            self.writers.append(home.writer(topic, qos))
        elif kind == 1:
            got: dict[bytes, list[int]] = {}
            self.readers.append((home.reader(topic, qos, lambda reader: self.take(reader, got)), got))
        elif kind == 2:
            sent: set[int] = set()
            answers: list[int] = []
            client = home.requester(ADD, None, lambda number, data: answers.append(number))
            self.clients.append((client, sent, answers))
        else:
            made: list[Any] = []
            made.append(home.replier(ADD, None, lambda identity, data: made[0].reply(identity, data)))

    def take(self, reader: Reader, got: dict[bytes, list[int]]) -> None:
        while (sample := reader.take()) is not None:
            got.setdefault(sample.writer_gid, []).append(sample.sequence)

    def write(self) -> None:
        for writer in self.random.sample(self.writers, min(2, len(self.writers))):
            if not writer.closed:
                self.written += 1
                writer.write(numbered(self.written) * self.random.choice((1, 1, 20, 20_000)))

    def ask(self) -> None:
        if self.clients:
            client, sent, _ = self.random.choice(self.clients)
            if not client.closed:
                sent.add(client.send(b"question", wait=self.random.random() < 0.8))

    def go(self) -> None:
        things: list[Any] = [*self.writers, *(r for r, _ in self.readers), *(c for c, _, _ in self.clients)]
        if self.random.random() < 0.3:
            things = list(self.participants)
        if things:
            gone = self.random.choice(things)
            gone.close()
            self.participants = [each for each in self.participants if not each.closed]
            self.writers = [each for each in self.writers if not each.closed]

    def part(self) -> None:
        """A network that is in two for a while, shorter than leases."""
        tap = self.net.world.network
        tap.loss = 1.0
        self.net.run(self.random.choice((50 * MS, SECOND)))
        tap.loss = 0.05

    def check(self) -> None:
        for reader, got in self.readers:
            for numbers in got.values():
                assert numbers == sorted(set(numbers)), "once, and in order"
                if reader.qos is KEEP_ALL:
                    assert numbers == list(range(numbers[0], numbers[-1] + 1)), "nothing is missing"
        for _, sent, answers in self.clients:
            assert set(answers) <= sent


@pytest.mark.parametrize("seed", range(6))
def test_life(seed: int) -> None:
    life = Life(seed)
    for _ in range(STEPS):
        life.step()
    life.net.run(30 * SECOND)
    life.check()
    fresh = life.computers[0].space.participant("late").writer(TOPICS[0], KEEP_ALL)
    life.net.run(5 * SECOND)
    fresh.write(b"x")
    life.net.run(5 * SECOND)
    for reader, got in life.readers:
        if not reader.closed and reader.topic == TOPICS[0] and reader.qos is KEEP_ALL:
            assert got[fresh.gid] == [1], "the network is as good as new"
    for computer in life.computers:
        if any(each.participants for each in computer.space._domains.values()):  # type: ignore[attr-defined]
            seen = sorted(node.name for node in computer.graph.nodes)
            assert seen == sorted(["late", *(each.name for each in life.participants)])
    for participant in (*life.participants, fresh.participant):  # type: ignore[attr-defined]
        participant.close()
    life.net.run(5 * SECOND)
    for computer in life.computers:
        nothing_is_left(computer)
    assert {finding.code for computer in life.computers for finding in computer.told} <= EXPECTED


EXPECTED = {
    "no-server",
    "qos-mismatch",
    "reader-too-slow",
    "reply-unmatched",
    "samples-lost",
    "several-servers",
    "type-mismatch",
}


def nothing_is_left(computer: Computer) -> None:
    """No book of a space has anything in it, when all participants have gone."""
    for home in computer.space._domains.values():  # type: ignore[attr-defined]
        assert (home.participants, home.endpoints, home.pairs, home.remotes) == ({}, {}, {}, {})
        assert home.lead is None
        assert home.carrier.core.participants == ()
    core = computer.space._core  # type: ignore[attr-defined]
    assert not core.queue
    assert core.timers.next() is None


def test_who_vanishes_is_forgotten() -> None:
    net = Net()
    one, two = net.computer(), net.computer()
    reader = one.space.participant("stays").reader(TOPICS[0], KEEP_ALL)
    two.space.participant("goes").writer(TOPICS[0], KEEP_ALL).write(b"x")
    net.until(lambda: reader.matched)
    two.vanish()
    net.until(lambda: not reader.matched)
    assert take_all(reader) == []
    reader.close()
    (home,) = one.space._domains.values()  # type: ignore[attr-defined]
    assert (home.remotes, home.pairs) == ({}, {})
