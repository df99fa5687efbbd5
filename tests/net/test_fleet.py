"""Reliable delivery on a network that is as bad as networks get: every sample once and in order, nothing left behind.

Each seed is a test of its own; to see one again: ``pytest 'tests/net/test_fleet.py::test_storm[17]'``.
"""

import random
from typing import Any

import pytest

from muros.agent import Limits
from muros.client.link import LOST
from tests.net.fleet import Client, Fleet

SEEDS = 200
SAMPLES = 8
PAIRS = 5


def sample(client: int, number: int, dice: random.Random) -> bytes:
    """A sample that tells where it is from; one in six is larger than a message."""
    size = 1300 if dice.random() < 1 / 6 else dice.randint(0, 40)
    return bytes((client, number)) + dice.randbytes(size)


def build(fleet: Fleet) -> tuple[dict[str, list[list[bytes]]], dict[str, list[Client]]]:
    """Two writers and two readers for each of five topics; what is to arrive and where, by topic."""
    dice = fleet.random
    expected: dict[str, list[list[bytes]]] = {}
    readers: dict[str, list[Client]] = {}
    for number in range(4 * PAIRS):
        topic = f"rt/topic{number % PAIRS}"
        client = Client(
            fleet,
            number,
            session_id=0x81 if number % 3 else 0x01,
            history=(4, 16)[number % 2],
            queue=(0, 4)[number % 4 // 2],
        )
        fleet.clients.append(client)
        if number < 2 * PAIRS:
            samples = [sample(number, n, dice) for n in range(SAMPLES)]
            expected.setdefault(topic, []).append(list(samples))
            client.writes(topic, samples)
        else:
            client.reads(topic)
            readers.setdefault(topic, []).append(client)
    return expected, readers


def run(fleet: Fleet, parting: bool = True) -> tuple[dict[str, list[list[bytes]]], dict[str, list[Client]]]:
    """Has everything created, written and read; fails with the seed when it does not arrive."""
    seed = fleet.seed
    expected, readers = build(fleet)
    assert fleet.until(lambda: all(client.ready for client in fleet.clients), 60_000), (
        f"seed {seed}: not ready"
    )
    fleet.writing, fleet.parting = True, parting
    clients = [client for group in readers.values() for client in group]

    def arrived() -> bool:
        return all(len(client.got) >= 2 * SAMPLES for client in clients)

    if not fleet.until(arrived, 8_000):
        fleet.heal()
        assert fleet.until(arrived, 60_000), f"seed {seed}: got {[len(client.got) for client in clients]}"
    fleet.heal()
    fleet.advance(1_000)  # for what would come twice
    return expected, readers


def check(seed: int, expected: dict[str, list[list[bytes]]], readers: dict[str, list[Client]]) -> None:
    """Every reader has got the samples of every writer of its topic, once and in order."""
    for topic, clients in readers.items():
        for client in clients:
            for samples in expected[topic]:
                writer = samples[0][0]
                got = [data for data in client.got if data[0] == writer]
                where = f"seed {seed}: from client {writer} to client {client.number}"
                assert [data[1] for data in got] == list(range(SAMPLES)), where
                assert got == samples, where


def storm(seed: int, **weather: Any) -> Fleet:
    """The usual bad weather."""
    usual: dict[str, Any] = {"loss": 0.3, "duplicate": 0.1, "reorder": 0.1, "delay": (1, 40)}
    return Fleet(seed, limits=Limits(window=(4, 16)[seed % 2]), **usual | weather)


@pytest.mark.parametrize("seed", range(SEEDS))
def test_storm(seed: int) -> None:
    fleet = storm(seed)
    check(seed, *run(fleet))
    problems = [client.problems for client in fleet.clients if client.problems]
    assert not problems, f"seed {seed}"
    fleet.leave()
    fleet.network.loss = 0
    fleet.advance(11_000)  # the agent remembers finished attempts to connect for 10 s
    assert fleet.left_behind() == {}, f"seed {seed}"


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "weather",
    [
        {"loss": 0.0, "duplicate": 0.9},
        {"loss": 0.0, "reorder": 0.9},
        {"loss": 0.6, "duplicate": 0.0, "reorder": 0.0},
        {"loss": 0.1, "delay": (1, 800)},
    ],
    ids=["doubling", "shuffling", "losing", "slow"],
)
def test_one_thing_at_its_worst(seed: int, weather: dict[str, Any]) -> None:
    fleet = storm(seed, **weather)
    check(seed, *run(fleet, parting=False))


def test_a_seed_decides_everything() -> None:
    runs = []
    for _ in range(2):
        fleet = storm(4711)
        run(fleet)
        runs.append((fleet.now, fleet.network.counters, [client.got for client in fleet.clients]))
    assert runs[0] == runs[1]


def test_without_loss_nothing_is_sent_twice() -> None:
    fleet = Fleet(1, delay=(1, 5))
    check(1, *run(fleet, parting=False))
    for client in fleet.clients:
        assert client.session.reliable.resends == 0
        session = fleet.core.clients[client.session.key]
        assert sum(stream.resends for n, stream in session.outputs.items() if n >= 0x80) == 0


def test_a_client_that_has_lost_sight_of_the_agent_still_says_goodbye() -> None:
    fleet = Fleet(2, delay=(1, 5))
    client = Client(fleet, 0).reads("rt/a")
    fleet.clients.append(client)
    assert fleet.until(lambda: client.ready, 5_000)
    fleet.network.partition(["agent"])
    assert fleet.until(lambda: client.session.state == LOST, 10_000)
    fleet.network.heal()
    fleet.leave()
    fleet.advance(11_000)
    assert fleet.left_behind() == {}


def test_clients_that_vanish_leave_nothing_when_the_agent_forgets() -> None:
    fleet = Fleet(3, loss=0.3, delay=(1, 40), limits=Limits(forget_silent=20_000))
    run(fleet)
    for client in fleet.clients:
        client.way.close()
    fleet.clients.clear()
    fleet.advance(35_000)
    assert fleet.left_behind() == {}


def test_clients_that_promised_to_be_lively_are_removed_when_they_vanish() -> None:
    fleet = Fleet(4, loss=0.1, delay=(1, 40))
    for number in range(5):
        fleet.clients.append(Client(fleet, number, hard_liveliness=1000).reads("rt/a"))
    assert fleet.until(lambda: all(client.ready for client in fleet.clients), 30_000)
    fleet.advance(10_000)
    assert len(fleet.core.clients) == 5
    for client in fleet.clients[:3]:
        client.way.close()
    del fleet.clients[:3]
    fleet.advance(13_000)
    assert sorted(fleet.core.clients) == [client.session.key for client in fleet.clients]
