"""Processes of many participants meet: everybody learns of everybody, and it takes few datagrams."""

import pytest

from muros.links.testing import Datagram
from muros.rtps import Addresses, EndpointFound, EndpointLost, ParticipantCore, udp4
from muros.rtps._constants import (
    ENTITYID_SEDP_PUBLICATIONS_WRITER,
    ENTITYID_SEDP_SUBSCRIPTIONS_WRITER,
    ENTITYID_SPDP_WRITER,
)
from muros.rtps._events import AckNack, Data, Event, Heartbeat
from muros.rtps._wire import parse_untrusted
from tests.rtps.domains import GROUP, MS, SECOND, Process, World, of, payload

SEDP = (ENTITYID_SEDP_PUBLICATIONS_WRITER, ENTITYID_SEDP_SUBSCRIPTIONS_WRITER)


def inhabited(world: World, count: int, **options: object) -> Process:
    """A process of `count` participants, each with a writer and a reader."""
    process = world.process(**options)
    for _ in range(count):
        inhabit(process)
    return process


def inhabit(process: Process) -> ParticipantCore:
    participant = process.participant()
    number = len(process.core.participants)
    process.writer(participant, f"rt/{number}")
    process.reader(participant, f"rt/{number % 7}")
    return participant


def all_known(world: World) -> bool:
    everything = sum(len(each.locals()) for process in world.processes for each in process.core.participants)
    return all(
        len(participant.endpoints) == everything - len(participant.locals())
        for process in world.processes
        for participant in process.core.participants
    )


def took(world: World, most: float) -> float:
    """ns until everybody knows everybody."""
    begin = world.network.now
    while not all_known(world):
        assert world.network.now < begin + most
        world.run(5 * MS)
    return float(world.network.now - begin)


def submessages(sent: list[Datagram]) -> list[Event]:
    return [event for datagram in sent for event in parse_untrusted(datagram.data).submessages]


def told(sent: list[Datagram], to: Process, *writers: int) -> int:
    """How many samples of discovery went to a process."""
    there = [datagram for datagram in sent if datagram.receiver == to.meta]
    return sum(isinstance(event, Data) and event.writer in writers for event in submessages(there))


def test_two_processes_of_many_meet_with_few_datagrams() -> None:
    world = World()
    sent = world.record()
    inhabited(world, 30)
    inhabited(world, 30)
    assert took(world, SECOND) <= 50 * MS
    world.run(5 * SECOND)
    # 900 pairs. Each has four acknowledgements of endpoints and two more; all else is said once for all of a process.
    assert len(sent) < 600
    events = submessages(sent)
    assert sum(isinstance(event, AckNack) for event in events) < 6 * 900 * 1.2
    assert sum(isinstance(event, Heartbeat) for event in events) < 600
    assert sum(isinstance(event, Data) and event.writer in SEDP for event in events) <= 2 * 60
    assert max(len(datagram.data) for datagram in sent) <= 1400


def test_on_one_host_datagrams_are_larger_and_fewer() -> None:
    world = World()
    sent = world.record()
    for number in (1, 2):
        here = udp4("127.0.0.1", 7408 + 2 * number), udp4("127.0.0.1", 7409 + 2 * number)
        addresses = Addresses(here[:1], (GROUP,), here[1:], (), (GROUP,))
        process = world.process(addresses=addresses)
        process.meta, process.user = here
        process.endpoints = [
            world.network.endpoint(at, process._receive) for at in (*here, (number, "at home"))
        ]
        for _ in range(30):
            inhabit(process)
    assert took(world, SECOND) <= 50 * MS
    world.run(5 * SECOND)
    assert len(sent) < 350
    assert max(len(datagram.data) for datagram in sent) > 4000


def test_a_newcomer_learns_from_its_process_what_that_has_heard() -> None:
    """It asks for nothing, and is told nothing twice."""
    world = World()
    old, new = inhabited(world, 20), inhabited(world, 1)
    took(world, SECOND)
    world.run(2 * SECOND)
    sent = world.record()
    newcomer = inhabit(new)
    assert took(world, SECOND) <= 20 * MS
    assert len(of(new.events[newcomer.prefix], EndpointFound)) == 40
    world.run(SECOND)
    assert told(sent, new, *SEDP) == 0
    assert told(sent, new, ENTITYID_SPDP_WRITER) <= 1
    assert told(sent, old, *SEDP) == 2
    assert len(sent) < 30


def test_what_happens_after_it_came_is_heard_by_a_newcomer() -> None:
    world = World()
    old, new = inhabited(world, 1), inhabited(world, 1)
    took(world, SECOND)
    newcomer = inhabit(new)
    (speaker,) = old.core.participants
    late = old.writer(speaker, "rt/late")
    world.run(SECOND)
    assert newcomer.endpoint(late.guid) is not None
    late.close(old.now)
    world.run(SECOND)
    assert newcomer.endpoint(late.guid) is None
    writer, reader = old.writer(speaker, "rt/both"), new.reader(newcomer, "rt/both")
    world.run(SECOND)
    writer.write(payload(1), old.now)
    world.run(SECOND)
    assert [sample.payload for sample in new.got[reader.guid]] == [payload(1)]


def test_what_ends_while_a_newcomer_is_not_known_yet_ends_for_it_too() -> None:
    """It was heard by an older participant, which acknowledged it, and so nobody has it any more."""
    world = World()
    old, new = inhabited(world, 1), inhabited(world, 1)
    took(world, SECOND)
    (speaker,) = old.core.participants
    short = old.writer(speaker, "rt/short")
    world.run(SECOND)
    lost: list[Datagram] = []

    def tap(datagram: Datagram) -> bool:
        """The elder misses the farewell, and has it repaired; the newcomer cannot be heard."""
        if datagram.receiver == new.meta and not lost and told([datagram], new, *SEDP):
            lost.append(datagram)
            return False
        events = submessages([datagram])
        return not any(event.source == newcomer.prefix for event in events)

    newcomer = inhabit(new)
    assert newcomer.endpoint(short.guid) is not None
    world.network.tap = tap
    short.close(old.now)
    world.run(SECOND)
    assert len(lost) == 1
    assert newcomer.endpoint(short.guid) is None
    assert len(of(new.events[newcomer.prefix], EndpointLost)) == 1
    again = old.writer(speaker, "rt/short", entity=short.entity)
    world.network.tap = None
    world.run(5 * SECOND)
    assert newcomer.endpoint(again.guid) is not None


def test_a_process_that_starts_anew_at_the_same_place_is_told_everything() -> None:
    """Nobody at a place is believed to know what another process there knew."""
    world = World()
    old, first = inhabited(world, 5), inhabited(world, 5)
    took(world, SECOND)
    first.vanish()
    second = world.process(addresses=first.addresses)
    second.meta, second.user = first.meta, first.user
    second.endpoints += [world.network.endpoint(at, second._receive) for at in (first.meta, first.user)]
    newcomer = second.participant(prefix=b"another life")
    world.run(500 * MS)
    assert len(newcomer.endpoints) == sum(len(each.locals()) for each in old.core.participants) == 10


@pytest.mark.parametrize("seed", range(4))
def test_many_meet_where_much_is_lost(seed: int) -> None:
    world = World(seed, loss=0.2, duplicate=0.05, reorder=0.1)
    for _ in range(3):
        inhabited(world, 12)
    took(world, 20 * SECOND)
    world.run(30 * SECOND)
    sent = world.record()
    world.run(10 * SECOND)
    acknowledgements = [event for event in submessages(sent) if isinstance(event, AckNack)]
    assert acknowledgements == [], "it comes to rest"
