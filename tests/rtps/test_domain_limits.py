"""What others may cost: peers that say too much, too often, or too large things."""

import time
from dataclasses import replace
from typing import Any

import pytest

from muros.rtps import (
    DomainProblem,
    DomainSettings,
    EndpointData,
    EndpointQos,
    ParticipantChanged,
    ParticipantCore,
    ParticipantLost,
    Why,
)
from muros.rtps._constants import (
    ENTITYID_PARTICIPANT_MESSAGE_WRITER,
    ENTITYID_SEDP_PUBLICATIONS_WRITER,
    ENTITYID_SEDP_SUBSCRIPTIONS_WRITER,
    ENTITYID_SPDP_READER,
    ENTITYID_SPDP_WRITER,
)
from muros.rtps._discovery_data import Assertion
from muros.rtps._wire import data, heartbeat
from tests.rtps.domains import MS, SECOND, TYPE, Process, World, of
from tests.rtps.strangers import Stranger


def met(**settings: Any) -> tuple[World, Process, ParticipantCore, Stranger]:
    lease = settings.pop("lease", 100 * SECOND)
    world = World()
    process = world.process(settings=DomainSettings(**settings))
    participant = process.participant()
    stranger = Stranger(process, lease=lease)
    stranger.announce()
    return world, process, participant, stranger


def test_peers_are_limited() -> None:
    _, process, participant, _ = met(peers=10)
    for number in range(2, 100):
        Stranger(process, number).announce()
    assert len(participant.participants) == 10
    assert process.core.counters["too-many-peers"] == 89
    assert [report.problem for report in process.reports] == [DomainProblem.TOO_MANY_PEERS]
    assert process.reports[0].number == 10


def test_one_that_is_silent_and_has_nothing_makes_way_when_there_is_no_room() -> None:
    world, _, participant, first = met(peers=3, lease=1000 * SECOND)
    first.endpoint(0x103)
    made_up = [Stranger(first.process, number, lease=10**18) for number in (2, 3)]
    for stranger in made_up:
        stranger.announce()
    late, later = Stranger(first.process, 4), Stranger(first.process, 5)
    late.announce()
    assert late.prefix not in {found.prefix for found in participant.participants}
    world.run(3 * SECOND)
    made_up[0].announce()  # still speaks
    first.announce()
    world.run(3 * SECOND)
    late.announce()
    later.announce()
    known = {found.prefix for found in participant.participants}
    assert known == {first.prefix, made_up[0].prefix, late.prefix}
    (lost,) = of(first.process.events[participant.prefix], ParticipantLost)
    assert (lost.participant.prefix, lost.why) == (made_up[1].prefix, Why.LEASE)


def test_participants_of_this_process_do_not_count_as_peers() -> None:
    _, process, participant, _ = met(peers=1)
    process.participant()
    assert len(participant.participants) == 2


def test_endpoints_of_a_peer_are_limited() -> None:
    _, process, participant, stranger = met(endpoints_per_peer=5)
    for number in range(20):
        stranger.endpoint(number << 8 | 3)
    assert len(participant.endpoints) == 5
    assert [report.problem for report in process.reports] == [DomainProblem.TOO_MANY_ENDPOINTS]
    stranger.withdraw(participant.endpoints[0])
    stranger.endpoint(99 << 8 | 3)
    assert len(participant.endpoints) == 5
    assert participant.endpoint(stranger.prefix + (99 << 8 | 3).to_bytes(4, "big")) is not None


def test_what_a_peer_says_is_limited_in_size() -> None:
    _, process, participant, stranger = met(memory_per_peer=10_000)
    for number in range(20):
        stranger.endpoint(number << 8 | 3, user_data=bytes(3000))
    assert len(participant.endpoints) == 3
    assert [report.problem for report in process.reports] == [DomainProblem.DISCOVERY_TOO_LARGE]
    for _ in range(5):
        stranger.withdraw(participant.endpoints[-1])
        stranger.endpoint(0x7703, user_data=bytes(3000))  # in its place
    assert len(participant.endpoints) == 3
    for _ in range(20):
        stranger.endpoint(3, user_data=bytes(10))  # what is said anew counts once
        stranger.endpoint(3, user_data=bytes(20))
    assert len(participant.endpoint(stranger.prefix + b"\0\0\0\3").user_data) == 20  # type: ignore[union-attr]


def test_changes_are_limited_in_time_and_heard_later() -> None:
    world, process, participant, stranger = met(changes_burst=10, changes_per_second=100)
    for number in range(50):
        stranger.endpoint(number << 8 | 3)
    assert len(participant.endpoints) == 10
    assert [report.problem for report in process.reports] == [DomainProblem.FLOOD]
    world.run(100 * MS)
    assert 15 <= len(participant.endpoints) <= 30
    world.run(SECOND)
    assert len(participant.endpoints) == 50


def test_one_that_says_something_else_of_itself_all_the_time_is_heard_now_and_then() -> None:
    world, process, participant, stranger = met()
    for number in range(200):
        stranger.told = replace(stranger.told, name=f"{number}")
        stranger.announce()
    assert len(of(process.events[participant.prefix], ParticipantChanged)) == 20
    assert [report.problem for report in process.reports] == [DomainProblem.FLOOD]
    world.run(SECOND)
    stranger.announce()
    assert participant.participants[0].name == "199"


def test_nobody_speaks_of_anothers_endpoints() -> None:
    _, process, participant, stranger = met()
    stranger.endpoint(0x103, prefix=b"another one.")
    writer = EndpointData(guid=stranger.prefix + b"\0\0\1\3", topic="t", type_name=TYPE, qos=EndpointQos())
    stranger.say(ENTITYID_SEDP_SUBSCRIPTIONS_WRITER, writer.payload())
    assert process.core.counters["prefix-mismatch"] == 2
    assert participant.endpoints == ()


def test_malformed_discovery_is_counted_and_what_follows_is_heard() -> None:
    _, process, participant, stranger = met()
    stranger.say(ENTITYID_SEDP_PUBLICATIONS_WRITER, b"\0\3\0\0nonsense")
    stranger.say(ENTITYID_SEDP_PUBLICATIONS_WRITER, b"")
    stranger.endpoint(0x703)
    stranger.say(ENTITYID_PARTICIPANT_MESSAGE_WRITER, b"\0\1\0\0")
    stranger.say(ENTITYID_PARTICIPANT_MESSAGE_WRITER, Assertion(b"another one.", False).payload())
    assert len(participant.endpoints) == 1
    assert process.core.counters["discovery-malformed"] == 3
    stranger.send(
        data(ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, 50, b"\0\3\0\0nonsense"),
    )
    assert process.core.counters["discovery-malformed"] == 4


def test_samples_nobody_wants_are_counted() -> None:
    _, process, participant, stranger = met()
    process.reader(participant)
    stranger.send(data(0, 0x103, 1, b"\0\1\0\0"), heartbeat(0, 0x103, 1, 1, 1))
    assert process.core.counters["unmatched"] == 2


def test_a_lease_that_is_too_short_is_lengthened() -> None:
    world, process, participant, _ = met()
    hasty = Stranger(process, 2, lease=1)
    hasty.announce()
    world.run(50 * MS)
    assert len(participant.participants) == 2
    world.run(100 * MS)
    assert len(participant.participants) == 1


def test_a_heartbeat_of_a_huge_range_asks_for_little() -> None:
    world, _, _, stranger = met()
    sent = world.record()
    for count in range(1, 101):
        stranger.send(heartbeat(0, ENTITYID_SEDP_PUBLICATIONS_WRITER, 1, 2**62, count))
    world.run(SECOND)
    assert len(sent) < 40
    assert all(len(datagram.data) < 1000 for datagram in sent)


def test_endless_talk_within_a_process_leaves_room_for_others() -> None:
    world = World()
    process = world.process(settings=DomainSettings(turn=100))
    one, two = process.participant(), process.participant()
    ping, pong = process.writer(one, "rt/ping"), process.writer(two, "rt/pong")
    process.reader(one, "rt/pong", on_sample=lambda sample: ping.write(sample.payload, process.now) and None)
    process.reader(two, "rt/ping", on_sample=lambda sample: pong.write(sample.payload, process.now) and None)
    ping.write(b"\0\1\0\0ball", process.now)
    first = ping.last
    assert 10 < first < 200
    assert process.core.deadline == process.now
    process.core.tick(process.now)
    assert first < ping.last < 400


def test_the_queue_within_a_process_is_limited() -> None:
    world = World()
    process = world.process(settings=DomainSettings(queue=50))
    one, two = process.participant(), process.participant()
    writer = process.writer(one, qos=EndpointQos(depth=1000))
    trigger = process.writer(one, "rt/go")

    def flood(_: object) -> None:
        for number in range(200):
            writer.write(number.to_bytes(8, "big"), process.now)

    process.reader(two, "rt/go", on_sample=flood)
    reader = process.reader(two)
    trigger.write(b"\0\1\0\0", process.now)
    assert process.core.counters["dropped"] >= 150
    assert DomainProblem.QUEUE_FULL in [report.problem for report in process.reports]
    world.run(SECOND)
    assert len(process.got[reader.guid]) == 200  # it is reliable


@pytest.mark.parametrize("name", ["peers", "queue", "lease_least", "announce_period"])
def test_settings_are_checked(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        DomainSettings(**{name: 0})  # type: ignore[arg-type]


def test_many_are_no_trouble() -> None:
    """Forty participants with five hundred endpoints meet in a moment, and idle for nothing."""
    world = World()
    left, right = world.process(), world.process()
    start = time.process_time()
    for number in range(20):
        talker, listener = left.participant(), right.participant()
        for topic in range(12):
            left.writer(talker, f"rt/{number}/{topic}")
            right.reader(listener, f"rt/{number}/{topic}")
    world.run(2 * SECOND)
    for process in (left, right):
        for participant in process.core.participants:
            assert len(participant.endpoints) == 39 * 12
            assert all(writer.matched for writer in participant.writers)
            assert all(reader.matched for reader in participant.readers)
    assert time.process_time() - start < 10
    ticks = [0]
    before = left.core.tick

    def counted(now: int) -> int | None:
        ticks[0] += 1
        return before(now)

    left.core.tick = counted  # type: ignore[method-assign]
    world.run(10 * SECOND)
    assert ticks[0] < 200
    left.core.close(left.now)
    world.run(SECOND)
    assert all(len(participant.endpoints) == 19 * 12 for participant in right.core.participants)
