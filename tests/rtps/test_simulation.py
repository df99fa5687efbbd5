"""Many participants on a network that loses, doubles, reorders and parts, from seeds."""

import random

import pytest

from muros.rtps import (
    EndpointQos,
    History,
    LocalReader,
    LocalWriter,
    Reliability,
    ResourceLimits,
    WriterSettings,
)
from tests.rtps.domains import MS, SECOND, Process, World, payload

FAULTS = {"loss": 0.1, "duplicate": 0.05, "reorder": 0.1}

KEEP_ALL = EndpointQos(history=History.KEEP_ALL, limits=ResourceLimits(max_samples=50))
BEST_EFFORT = EndpointQos(reliability=Reliability.BEST_EFFORT)


class Town:
    """Processes with participants that write and read topics in common."""

    def __init__(self, seed: int, processes: int = 5, participants: int = 2, topics: int = 3) -> None:
        self.draw = random.Random(seed)
        self.world = World(seed, delay=(0.1 * MS, 3 * MS), **FAULTS)
        self.writers: list[tuple[Process, LocalWriter]] = []
        self.readers: list[tuple[Process, LocalReader]] = []
        self.written: dict[bytes, list[bytes]] = {}
        for _ in range(processes):
            process = self.world.process()
            for _ in range(participants):
                participant = process.participant(lease=10 * SECOND)
                for topic in range(topics):
                    if self.draw.random() < 0.6:
                        writer = process.writer(
                            participant,
                            f"rt/{topic}",
                            KEEP_ALL,
                            settings=WriterSettings(limit=50, fragment_size=1000),
                        )
                        self.writers.append((process, writer))
                        self.written[writer.guid] = []
                    if self.draw.random() < 0.6:
                        self.readers.append((process, process.reader(participant, f"rt/{topic}", KEEP_ALL)))
                    if self.draw.random() < 0.3:
                        reader = process.reader(participant, f"rt/{topic}", BEST_EFFORT)
                        self.readers.append((process, reader))

    @property
    def processes(self) -> list[Process]:
        return self.world.processes

    def converged(self) -> bool:
        """Whether everybody knows everybody, and all are matched with all they should be."""
        everything = sum(
            len(p.writers) + len(p.readers) for process in self.processes for p in process.core.participants
        )
        for process in self.processes:
            for participant in process.core.participants:
                if (
                    len(participant.endpoints) + len(participant.writers) + len(participant.readers)
                    != everything
                ):
                    return False
        for _, writer in self.writers:
            if set(writer.matched) != {
                reader.guid for _, reader in self.readers if reader.data.topic == writer.data.topic
            }:
                return False
        return True

    def chat(self, rounds: int, sizes: tuple[int, ...] = (16, 16, 16, 400, 3000)) -> None:
        """Everybody writes at once; a writer without room tries again in the next round."""
        for _ in range(rounds):
            for process, writer in self.writers:
                text = payload(self.draw.getrandbits(40), self.draw.choice(sizes) & ~3)
                if writer.write(text, process.now):
                    self.written[writer.guid].append(text)
            self.world.run(self.draw.uniform(0, 5 * MS))

    def received(self, process: Process, reader: LocalReader, writer: LocalWriter) -> list[bytes]:
        return [sample.payload for sample in process.got[reader.guid] if sample.writer == writer.guid]

    def settle(self) -> None:
        for _ in range(60):
            if all(writer.acknowledged for _, writer in self.writers):
                break
            self.world.run(SECOND)

    def verify(self) -> None:
        """Reliable readers got everything once and in order, best-effort ones in order."""
        for at, reader in self.readers:
            for _, writer in self.writers:
                if writer.data.topic != reader.data.topic:
                    continue
                got, sent = self.received(at, reader, writer), self.written[writer.guid]
                if reader.qos.reliable:
                    assert got == sent
                else:
                    rest = iter(sent)
                    assert all(text in rest for text in got)
                    assert len(got) >= len(sent) / 2


@pytest.mark.parametrize("seed", range(6))
def test_everything_arrives_once_and_in_order(seed: int) -> None:
    town = Town(seed)
    for _ in range(15):
        town.world.run(SECOND)
        if town.converged():
            break
    assert town.converged()
    town.chat(60)
    town.settle()
    town.verify()


@pytest.mark.parametrize("seed", range(4))
def test_a_network_that_parts_and_heals(seed: int) -> None:
    """Longer than the lease: those on the other side are forgotten, and met again."""
    town = Town(seed, processes=4)
    town.world.run(15 * SECOND)
    assert town.converged()
    town.chat(10)
    town.settle()
    sides = [town.processes[:2], town.processes[2:]]
    town.world.network.partition(
        *[[endpoint.address for process in side for endpoint in process.endpoints] for side in sides]
    )
    town.world.run(13 * SECOND)
    for side in sides:
        for process in side:
            for participant in process.core.participants:
                assert len(participant.participants) == 3
    town.chat(10)
    town.settle()
    town.world.network.heal()
    town.world.run(15 * SECOND)
    assert town.converged()
    for process, _ in town.writers:
        for kept in process.got.values():
            kept.clear()
    for texts in town.written.values():
        texts.clear()
    town.chat(30)
    town.settle()
    town.verify()


@pytest.mark.parametrize("seed", range(4))
def test_those_who_stay_are_served_while_others_come_and_go(seed: int) -> None:
    town = Town(seed, processes=3)
    town.world.run(15 * SECOND)
    assert town.converged()
    guests: list[Process] = []
    for _ in range(8):
        town.chat(8)
        if len(guests) > 1 and town.draw.random() < 0.6:
            leaving = guests.pop(town.draw.randrange(len(guests)))
            if town.draw.random() < 0.5:
                leaving.core.close(leaving.now)
            town.world.run(5 * MS)
            leaving.vanish()
        else:
            guest = town.world.process()
            guests.append(guest)
            participant = guest.participant(lease=3 * SECOND)
            guest.writer(participant, "rt/0", KEEP_ALL).write(payload(1), guest.now)
            guest.reader(participant, "rt/1", KEEP_ALL)
        town.world.run(town.draw.uniform(0, SECOND))
    for guest in guests:
        guest.core.close(guest.now)
        guest.vanish()
    town.settle()
    town.verify()
    town.world.run(15 * SECOND)
    staying = town.processes[:3]
    for process in staying:
        for participant in process.core.participants:
            assert len(participant.participants) == 5
        assert len(process.core.peers) == 4
    assert {guid for _, writer in town.writers for guid in writer.matched} <= {
        reader.guid for _, reader in town.readers
    }


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_left_behind_when_all_have_gone(seed: int) -> None:
    town = Town(seed, processes=4)
    town.world.run(3 * SECOND)
    town.chat(20)
    for process in town.draw.sample(town.processes, 4):
        process.core.close(process.now)
        town.world.run(town.draw.uniform(0, SECOND))
    town.world.run(30 * SECOND)
    for process in town.processes:
        core = process.core
        assert len(core.registry) == len(core.registry._topics) == len(core.gathered) == 0
        tables = (core._routes, core._writers, core._replies, core.peers, core.inside, core.news)
        assert not any(tables)
        assert core.deadline is None
    town.world.network.counters.clear()
    town.world.run(60 * SECOND)
    assert not town.world.network.counters["sent"]
