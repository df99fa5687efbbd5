"""Participants that meet over a network, and within a process; and how they part."""

from typing import Any

import pytest

from muros.rtps import (
    NOWHERE,
    WRITER_QOS,
    Addresses,
    DomainCore,
    DomainProblem,
    DomainSettings,
    Durability,
    EndpointFound,
    EndpointLost,
    EndpointQos,
    Incompatible,
    Liveliness,
    LivelinessChanged,
    Locator,
    Matched,
    ParticipantChanged,
    ParticipantFound,
    ParticipantLost,
    Unmatched,
    Why,
    udp4,
)
from muros.rtps._constants import ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER
from muros.rtps._discovery_data import ParticipantData, departure
from muros.rtps._wire import Data, data, message, parse_untrusted
from tests.rtps.domains import GROUP, MS, SECOND, Process, World, of, payload


def pair(**options: Any) -> tuple[World, Process, Process]:
    world = World()
    return world, world.process(**options), world.process(**options)


# --- Meeting ---------------------------------------------------------------------------------------------


def test_two_processes_meet_and_exchange_samples() -> None:
    world, left, right = pair()
    talker, listener = (
        left.participant(name="talker"),
        right.participant(name="listener", user_data=b"enclave=/;"),
    )
    writer, reader = left.writer(talker, user_data=b"typehash=x;"), right.reader(listener)
    world.run(300 * MS)
    assert (writer.matched, reader.matched) == ((reader.guid,), (writer.guid,))
    for number in range(100):
        assert writer.write(payload(number), left.now, source_time=number) == number + 1
    world.run(SECOND)
    assert [sample.payload for sample in right.got[reader.guid]] == [payload(number) for number in range(100)]
    assert [sample.source_time for sample in right.got[reader.guid]] == list(range(100))
    assert {sample.writer for sample in right.got[reader.guid]} == {writer.guid}
    assert writer.acknowledged
    (found,) = of(left.events[talker.prefix], ParticipantFound)
    assert (found.participant.name, found.participant.user_data) == ("listener", b"enclave=/;")
    (endpoint,) = of(right.events[listener.prefix], EndpointFound)
    assert endpoint.endpoint == writer.data == listener.endpoint(writer.guid)
    assert endpoint.endpoint.user_data == b"typehash=x;"
    assert of(right.events[listener.prefix], Matched) == [Matched(reader.guid, writer.data)]


def test_who_is_there_before_and_who_comes_later_are_both_met_at_once() -> None:
    world, left, right = pair()
    early = left.participant()
    left.writer(early)
    world.run(20 * SECOND)
    late = right.participant()
    reader = right.reader(late)
    # By the unicast answer, not by the announcement that comes every three seconds.
    world.run(10 * MS)
    assert len(reader.matched) == 1


def test_announcements_come_in_a_burst_and_then_with_a_steady_period() -> None:
    world, left, _ = pair()
    sent = world.record()
    left.participant()
    world.run(10 * SECOND)
    times = [datagram.sent_at for datagram in sent[::2]]  # multicast reaches two
    assert times == [0, 0.1e9, 0.25e9, 0.5e9, 1e9, 4e9, 7e9, 10e9]
    sent.clear()
    left.participant()
    world.run(10 * SECOND)
    second = [datagram.sent_at for datagram in sent if datagram.data[8:10] == b"\1\2"]
    assert second == [10e9, 10e9]  # one of a process is enough


def test_a_short_lease_makes_announcements_more_frequent() -> None:
    world, left, _ = pair()
    sent = world.record()
    left.participant(lease=10 * SECOND)
    world.run(5 * SECOND)
    times = [datagram.sent_at for datagram in sent[::2]]
    assert times == [0, 0.1e9, 0.25e9, 0.5e9, 1e9, 3e9, 5e9]


def test_participants_of_one_process_meet_without_a_network() -> None:
    core = DomainCore(0, lambda *_: pytest.fail("nothing may leave"))
    got: dict[str, list[bytes]] = {"other": [], "own": []}
    talker = core.participant(b"talker000000", now=0)
    listener = core.participant(b"listener0000", now=0)
    options: dict[str, Any] = {"topic": "t", "type_name": "T", "qos": WRITER_QOS, "now": 0}
    writer = talker.writer(**options)
    listener.reader(**options, on_sample=lambda sample: got["other"].append(sample.payload))
    talker.reader(**options, on_sample=lambda sample: got["own"].append(sample.payload))
    assert len(writer.matched) == 2
    writer.write(payload(1), 1)
    assert got == {"other": [payload(1)], "own": [payload(1)]}
    assert writer.acknowledged
    assert [found.name for found in listener.participants] == [""]


def test_participants_of_a_process_see_each_other_without_discovery() -> None:
    world = World()
    process = world.process()
    one, two = process.participant(), process.participant(name="two")
    writer = process.writer(two, user_data=b"x")
    assert one.participants == (two.data,)
    assert one.endpoints == (writer.data,)
    assert two.endpoints == ()
    assert one.endpoint(writer.guid) == writer.data
    assert two.endpoint(writer.guid) is None
    assert one.on_topic("rt/a") == two.on_topic("rt/a") == (writer.data,)
    reader = process.reader(one)
    assert of(process.events[one.prefix], Matched) == [Matched(reader.guid, writer.data)]
    assert of(process.events[two.prefix], Matched) == [Matched(writer.guid, reader.data)]
    other = process.reader(one, qos=EndpointQos(durability=Durability.TRANSIENT_LOCAL))
    (told,) = of(process.events[two.prefix], Incompatible)
    assert (told.local, told.remote, writer.refused[other.guid]) == (writer.guid, other.data, told.mismatches)
    other.close(process.now)
    assert writer.refused == {}
    two.close(process.now)
    assert len(one.participants) == len(one.endpoints) == 0
    assert of(process.events[one.prefix], Unmatched) == [Unmatched(reader.guid, writer.data, Why.LEFT)]
    assert reader.matched == ()
    assert len(process.core.registry) == 1


def test_participants_of_a_process_say_nothing_to_each_other() -> None:
    world = World()
    process = world.process()
    sent = world.record()
    participants = [process.participant() for _ in range(20)]
    for participant in participants:
        process.writer(participant, qos=EndpointQos(lease=SECOND))
    assert not process.core.inside
    world.run(10 * SECOND)
    announcements = 20 + 4 + 3  # each once; the first again in its burst, and every three seconds
    assert len(sent) == announcements


def test_liveliness_by_hand_is_known_within_a_process() -> None:
    world = World()
    process = world.process()
    qos = EndpointQos(liveliness=Liveliness.MANUAL_BY_TOPIC, lease=SECOND)
    one, two = process.participant(), process.participant()
    writer, reader = process.writer(one, qos=qos), process.reader(two, qos=qos)
    world.run(1500 * MS)
    changes = of(process.events[two.prefix], LivelinessChanged)
    assert changes == [LivelinessChanged(reader.guid, writer.guid, False)]
    writer.write(payload(1), process.now)
    changes = of(process.events[two.prefix], LivelinessChanged)
    assert changes[1:] == [LivelinessChanged(reader.guid, writer.guid, True)]


def test_when_the_first_participant_has_gone_the_next_announces_itself_to_all() -> None:
    world, left, right = pair()
    first, second = left.participant(), left.participant()
    world.run(5 * SECOND)
    first.close(left.now)
    world.run(60 * SECOND)  # longer than the lease
    world.network.tap = lambda datagram: datagram.sender != right.meta  # the other says nothing
    late = right.participant()
    world.run(3 * SECOND)
    assert [found.prefix for found in late.participants] == [second.prefix]


def test_many_readers_at_one_place_get_one_datagram() -> None:
    world, left, right = pair()
    writer = left.writer(left.participant())
    readers = [right.reader(right.participant()) for _ in range(5)]
    world.run(SECOND)
    world.network.counters.clear()
    writer.write(payload(7), left.now)
    sent = world.record()
    writer.write(payload(8), left.now)
    assert len(sent) == 1
    world.run(SECOND)
    assert [[s.payload for s in right.got[reader.guid]] for reader in readers] == [
        [payload(7), payload(8)]
    ] * 5


def test_processes_of_many_participants_meet_with_few_datagrams() -> None:
    world, left, right = pair()
    for number in range(20):
        talker, listener = left.participant(), right.participant()
        for topic in range(5):
            left.writer(talker, f"rt/{number}/{topic}")
            right.reader(listener, f"rt/{number}/{topic}")
    sent = world.record()
    world.run(2 * SECOND)
    for process in (left, right):
        for participant in process.core.participants:
            assert len(participant.endpoints) == 39 * 5
            assert all(local.matched for local in participant.locals())
    assert len(sent) < 3600  # 400 pairs, each with three topics of discovery each way
    assert max(len(datagram.data) for datagram in sent) <= 1400
    # Those who speak in the datagrams of others are alive, too.
    world.run(60 * SECOND)
    assert all(len(p.participants) == 39 for process in (left, right) for p in process.core.participants)


# --- Parting ---------------------------------------------------------------------------------------------


def test_a_closed_writer_is_told_of_at_once() -> None:
    world, left, right = pair()
    writer = left.writer(left.participant())
    listener = right.participant()
    reader = right.reader(listener)
    world.run(SECOND)
    writer.close(left.now)
    world.run(10 * MS)
    assert reader.matched == ()
    assert listener.endpoints == ()
    events = right.events[listener.prefix]
    assert of(events, Unmatched) == [Unmatched(reader.guid, writer.data, Why.LEFT)]
    assert of(events, EndpointLost) == [EndpointLost(writer.data, Why.LEFT)]
    with pytest.raises(ValueError, match="closed"):
        writer.write(payload(1), left.now)
    writer.close(left.now)


def test_a_closed_participant_is_told_of_at_once_with_all_it_had() -> None:
    world, left, right = pair()
    talker, listener = left.participant(), right.participant()
    left.writer(talker)
    left.reader(talker, "rt/b")
    reader = right.reader(listener)
    world.run(SECOND)
    talker.close(left.now)
    world.run(10 * MS)
    assert not (listener.participants)
    assert not (listener.endpoints)
    assert not (reader.matched)
    assert [lost.why for lost in of(right.events[listener.prefix], ParticipantLost)] == [Why.LEFT]
    assert left.core.participants == ()
    talker.close(left.now)


@pytest.mark.parametrize("lease", [SECOND, 20 * SECOND])
def test_one_that_vanishes_is_forgotten_in_its_lease(lease: int) -> None:
    world, left, right = pair()
    talker, listener = left.participant(lease=lease), right.participant()
    left.writer(talker)
    reader = right.reader(listener)
    world.run(5 * SECOND)
    assert len(reader.matched) == 1
    last = world.network.now
    left.vanish()
    world.run(lease / 2)
    assert len(reader.matched) == 1
    world.run(lease / 2 + SECOND)
    assert not (listener.participants)
    assert not (listener.endpoints)
    assert not (reader.matched)
    assert [lost.why for lost in of(right.events[listener.prefix], ParticipantLost)] == [Why.LEASE]
    assert world.network.now - last <= lease + SECOND


def test_one_that_came_back_with_the_same_guid_is_met_again() -> None:
    world, left, right = pair()
    prefix = b"the same one"
    listener = right.participant()
    reader = right.reader(listener)
    last = 0
    for life in range(3):
        talker = left.participant(prefix=prefix)
        writer = left.writer(talker, entity=0x103, last=last)
        world.run(SECOND)
        assert reader.matched == (writer.guid,)
        last = writer.write(payload(life), left.now)
        world.run(SECOND)
        talker.close(left.now)
        world.run(SECOND)
    assert [(s.sequence, s.payload) for s in right.got[reader.guid]] == [
        (n + 1, payload(n)) for n in range(3)
    ]


def test_one_that_comes_back_is_understood_by_those_who_missed_its_farewell() -> None:
    world, left, right = pair()
    listener = right.participant()
    prefix = b"the same one"
    for life in range(3):
        talker = left.participant(prefix=prefix)
        writer = left.writer(talker, f"rt/{life}", entity=0x103)
        world.run(2 * SECOND)
        assert [endpoint.topic for endpoint in listener.endpoints] == [f"rt/{life}"]
        assert listener.endpoint(writer.guid) == writer.data
        world.network.loss = 1.0
        talker.close(left.now)
        world.run(10 * MS)
        world.network.loss = 0.0


@pytest.mark.parametrize("back", [0, 500])
def test_one_that_alone_has_forgotten_the_other_meets_it_again(back: int) -> None:
    """Messages get lost in one direction only, for longer than the lease. `back`: its counts begin so much lower."""
    world, left, right = pair()
    talker, listener = left.participant(), right.participant()
    qos = EndpointQos(durability=Durability.TRANSIENT_LOCAL, depth=10)
    writer, reader = left.writer(talker, qos=qos), right.reader(listener, qos=qos)
    world.run(10 * SECOND)
    writer.write(payload(1), left.now)
    world.run(SECOND)
    world.network.tap = lambda datagram: datagram.sender != left.meta
    world.run(25 * SECOND)
    assert not listener.participants
    assert writer.matched == (reader.guid,)
    world.network.tap = None
    for core in (left.core, right.core):
        for participant in core.participants:
            for port in participant._discovery._writers.values():
                for proxy in port.core.readers:
                    proxy.count = (proxy.count or 0) + back
    world.run(6 * SECOND)
    assert reader.matched == (writer.guid,)
    writer.write(payload(2), left.now)
    world.run(SECOND)
    assert right.got[reader.guid][-1].payload == payload(2)


def test_one_that_comes_back_at_once_waits_until_all_have_been_told_that_it_had_gone() -> None:
    world, left, right = pair()
    listener = right.participant()
    prefix = b"the same one"
    first = left.participant(prefix=prefix)
    left.writer(first, "rt/old")
    sibling = left.participant()
    world.run(SECOND)
    sent = world.record()
    start = world.network.now
    first.close(left.now)
    again = left.participant(prefix=prefix, user_data=b"again")
    own = left.reader(sibling, "rt/new")
    writer = left.writer(again, "rt/new")
    assert writer.matched == (own.guid,)  # within the process it is there
    world.run(SECOND)
    told = [
        (int((datagram.sent_at - start) / MS), event.sequence, bool(event.payload))
        for datagram in sent
        if datagram.receiver == right.meta
        for event in parse_untrusted(datagram.data).submessages
        if isinstance(event, Data) and event.source == prefix and event.writer == ENTITYID_SPDP_WRITER
    ]
    assert [(at, alive) for at, _, alive in told][:4] == [(0, False), (30, False), (60, False), (100, True)]
    numbers = [number for _, number, _ in told]
    assert numbers == sorted(numbers)
    assert len(set(numbers)) == 4
    assert [endpoint.topic for endpoint in listener.endpoints if endpoint.is_writer] == ["rt/new"]
    lost, found = (
        of(right.events[listener.prefix], ParticipantLost),
        of(right.events[listener.prefix], ParticipantFound),
    )
    assert len(lost) == 1
    assert [each.participant.user_data for each in found if each.participant.prefix == prefix] == [
        b"",
        b"again",
    ]


def test_one_that_comes_back_and_goes_at_once_is_not_seen() -> None:
    world, left, right = pair()
    listener = right.participant()
    prefix = b"the same one"
    left.participant()
    for _ in range(5):
        left.participant(prefix=prefix).close(left.now)
    world.run(SECOND)
    assert len(listener.participants) == 1
    back = left.participant(prefix=prefix)
    for _ in range(5):
        back.close(left.now)
        back = left.participant(prefix=prefix)
        back.set_user_data(b"changed", left.now)
        left.core.set_addresses(left.addresses, left.now)
        stranger = right.participant()
        world.run(20 * MS)
        stranger.close(right.now)
    world.run(SECOND)
    assert [each.user_data for each in listener.participants if each.prefix == prefix] == [b"changed"]
    assert back.participants


def test_nothing_is_left_behind() -> None:
    world, left, right = pair()
    for _ in range(3):
        talker, listener = left.participant(), right.participant()
        writer = left.writer(talker)
        right.reader(listener)
        world.run(SECOND)
        writer.write(payload(1), left.now)
        talker.close(left.now)
        world.run(SECOND)
        listener.close(right.now)
        world.run(SECOND)
    for core in (left.core, right.core):
        assert len(core.registry) == len(core.registry._topics) == len(core.gathered) == 0
        tables = (core._routes, core._writers, core._replies, core.peers, core.inside, core.news)
        assert not any(tables)
        assert core.deadline is None
        assert len(core.agenda) == 0


# --- Changing --------------------------------------------------------------------------------------------


def test_new_user_data_is_told() -> None:
    world, left, right = pair()
    first, talker, listener = left.participant(), left.participant(), right.participant()
    world.run(SECOND)
    talker.set_user_data(b"enclave=/x;", left.now)
    world.run(10 * MS)
    (change,) = of(right.events[listener.prefix], ParticipantChanged)
    assert (change.participant.user_data, change.before.user_data) == (b"enclave=/x;", b"")
    assert change.before.prefix == talker.prefix
    assert talker.data in first.participants


def test_new_addresses_are_told_and_used() -> None:
    world, left, right = pair()
    writer = left.writer(left.participant())
    listener = right.participant()
    reader = right.reader(listener)
    world.run(SECOND)
    moved = udp4("10.0.0.77", 7500)
    world.network.endpoint(moved, right._receive)
    for endpoint in right.endpoints[:2]:
        endpoint.close()
    right.endpoints[:2] = [world.network.endpoint(udp4("10.0.0.77", 7501))] * 2
    right.core.set_addresses(
        right.addresses._replace(metatraffic_unicast=(moved,), default_unicast=(moved,)), right.now
    )
    world.run(SECOND)
    writer.write(payload(1), left.now)
    world.run(SECOND)
    assert [sample.payload for sample in right.got[reader.guid]] == [payload(1)]
    assert left.core.peers[listener.prefix].user == (moved,)


def test_participants_made_before_there_is_a_network_are_announced_when_there_is_one() -> None:
    world = World()
    left, right = world.process(addresses=NOWHERE), world.process()
    writer = left.writer(left.participant())
    reader = right.reader(right.participant())
    world.run(SECOND)
    assert not writer.matched
    left.core.set_addresses(Addresses((left.meta,), (GROUP,), (left.user,), (), (GROUP,)), left.now)
    world.run(100 * MS)
    assert writer.matched == (reader.guid,)


# --- Others, not meant or not understood -------------------------------------------------------------------


def announcement(process: Process, **options: Any) -> bytes:
    """What a stranger says of itself to everybody."""
    options = {
        "prefix": b"a stranger..",
        "metatraffic_unicast": (udp4("10.0.0.9", 7410),),
        "default_unicast": (udp4("10.0.0.9", 7411),),
        **options,
    }
    told = ParticipantData(**options)
    return message(told.prefix, data(ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, 1, told.payload()))


STRANGER = udp4("10.0.0.9", 7410)


def test_other_domains_and_tags_are_foreign() -> None:
    world = World()
    process = world.process(domain=3, settings=DomainSettings(domain_tag="ours"))
    listener = process.participant()
    options: dict[str, Any]
    for options in (
        {"domain": 4, "domain_tag": "ours"},
        {"domain": 3},
        {"domain": 3, "domain_tag": "theirs"},
    ):
        process.core.receive(announcement(process, **options), STRANGER, 0)
    assert process.core.counters["foreign"] == 3
    assert listener.participants == ()
    assert [report.problem for report in process.reports] == [DomainProblem.FOREIGN_DOMAIN]
    process.core.receive(announcement(process, domain_tag="ours"), STRANGER, 0)
    assert len(listener.participants) == 1


def test_nobody_speaks_for_another() -> None:
    world = World()
    process = world.process()
    listener = process.participant()
    process.core.receive(announcement(process), STRANGER, 0)
    lie = data(
        ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, 2, b"", inline_qos=departure(b"a stranger..\0\0\1\xc1")
    )
    process.core.receive(message(b"somebodyelse", lie), STRANGER, 0)
    told = ParticipantData(prefix=b"a third one.").payload()
    process.core.receive(
        message(b"somebodyelse", data(ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, 2, told)), STRANGER, 0
    )
    assert [found.prefix for found in listener.participants] == [b"a stranger.."]
    assert process.core.counters["refused"] == 2
    assert [report.problem for report in process.reports] == [DomainProblem.PREFIX_MISMATCH]
    process.core.receive(message(b"a stranger..", lie), STRANGER, 0)
    assert listener.participants == ()


def test_echoes_are_dropped_but_another_with_our_prefix_is_reported() -> None:
    world = World()
    process = world.process()
    own = process.participant()
    world.run(2 * SECOND)
    assert process.core.counters["echoes"] == 5
    assert process.reports == []
    process.core.receive(announcement(process, prefix=own.prefix), STRANGER, process.now)
    assert [report.problem for report in process.reports] == [DomainProblem.PREFIX_TAKEN]
    assert process.reports[0].source == STRANGER
    assert own.participants == ()


def test_one_without_an_address_that_can_be_reached_is_reported() -> None:
    world = World()
    process = world.process()
    process.participant()
    memory = Locator(16, 7410, bytes(16))
    process.core.receive(
        announcement(process, metatraffic_unicast=(memory,), default_unicast=(memory,)), STRANGER, 0
    )
    assert [report.problem for report in process.reports] == [DomainProblem.UNREACHABLE]


def test_what_is_malformed_is_counted_and_told_once_in_a_while() -> None:
    world = World()
    process = world.process()
    listener = process.participant()
    bad = announcement(process)[:-30]
    for now in (0, 1, 11 * SECOND):
        process.core.receive(b"RTPX" + bytes(20), STRANGER, now)
        process.core.receive(bad, STRANGER, now)
    assert process.core.counters["malformed"] == 6
    assert [report.number for report in process.reports] == [1, 5]
    assert listener.participants == ()


def test_a_prefix_is_checked() -> None:
    world = World()
    process = world.process()
    first = process.participant()
    for prefix in (first.prefix, b"short", bytes(12)):
        with pytest.raises(ValueError, match="prefix"):
            process.core.participant(prefix, now=0)
    process.core.close(0)
    with pytest.raises(ValueError, match="closed"):
        process.core.participant(b"another one.", now=0)
    with pytest.raises(ValueError, match="closed"):
        process.writer(first)


def test_entity_ids_are_checked_and_given() -> None:
    world = World()
    process = world.process()
    participant = process.participant()
    writer = process.writer(participant, entity=0x00000103)
    assert writer.guid == participant.prefix + b"\0\0\1\3"
    for entity in (0x103, 0x104, 0x1C2, 0x3C2):
        with pytest.raises(ValueError, match="entity id"):
            process.writer(participant, entity=entity)
    with pytest.raises(ValueError, match="reader"):
        process.reader(participant, entity=0x203)
    assert len({process.writer(participant).guid, process.reader(participant).guid, writer.guid}) == 3
    assert process.writer(participant, keyed=True).guid[-1] == 2
    assert process.reader(participant, keyed=True).guid[-1] == 7


def test_one_that_misses_the_answer_to_its_announcement_is_told_again_soon() -> None:
    """It has begun to speak before it listens, and hears no multicast."""
    world, left, _ = pair()
    left.core.set_addresses(left.addresses._replace(announce_to=()), left.now)
    early = left.participant()
    world.run(20 * SECOND)
    sent = world.record()
    left.core.receive(announcement(left), STRANGER, left.now)
    start = world.network.now
    world.run(1500 * MS)
    told = [
        (datagram.sent_at - start) / MS
        for datagram in sent
        if datagram.receiver == STRANGER and early.data.payload() in datagram.data
    ]
    assert told == [0, 100, 400, 1000]


def test_one_that_has_answered_is_not_told_again() -> None:
    world, left, right = pair()
    left.participant()
    world.run(20 * SECOND)
    late = right.participant()
    sent = world.record()
    world.run(1500 * MS)
    announcements = [
        d for d in sent if d.receiver == right.meta and left.core.participants[0].data.payload() in d.data
    ]
    assert len(announcements) == 1
    assert late.participants
