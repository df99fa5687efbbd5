"""What a peer says reaches those it is for, and is taken for what it is; a peer made of bytes says it."""

from dataclasses import replace
from typing import Any

import pytest

from muros.rtps import (
    EndpointChanged,
    EndpointFound,
    EndpointLost,
    EndpointQos,
    Incompatible,
    Liveliness,
    LivelinessChanged,
    ParticipantChanged,
    ParticipantCore,
    ParticipantLost,
    Reliability,
    Why,
    udp4,
)
from muros.rtps._constants import (
    ENTITYID_PARTICIPANT_MESSAGE_WRITER,
    ENTITYID_SEDP_PUBLICATIONS_READER,
    ENTITYID_SEDP_PUBLICATIONS_WRITER,
    ENTITYID_SEDP_SUBSCRIPTIONS_READER,
    ENTITYID_SPDP_READER,
    ENTITYID_SPDP_WRITER,
    VENDOR_CYCLONE,
    BuiltinEndpoint,
    StatusInfo,
)
from muros.rtps._discovery_data import Assertion
from muros.rtps._parameters import inline_qos
from muros.rtps._wire import (
    AckNack,
    Data,
    Event,
    Heartbeat,
    acknack,
    data,
    heartbeat,
    info_dst,
    info_reply,
    info_src,
)
from tests.rtps.domains import BEST_EFFORT, MS, SECOND, Process, World, of, payload
from tests.rtps.strangers import Stranger


def met(**options: Any) -> tuple[World, Process, ParticipantCore, Stranger]:
    world = World()
    process = world.process()
    participant = process.participant()
    stranger = Stranger(process, **options)
    stranger.announce()
    return world, process, participant, stranger


# --- For whom a submessage is -----------------------------------------------------------------------------


def test_data_for_one_reader_reaches_only_that_one() -> None:
    _, process, participant, stranger = met()
    one, two = process.reader(participant), process.reader(participant)
    sibling = process.reader(process.participant(), entity=one.entity)
    stranger.endpoint(0x103)
    stranger.send(data(one.entity, 0x103, 1, payload(1)))
    stranger.send(info_dst(participant.prefix), data(one.entity, 0x103, 2, payload(2)))
    stranger.send(info_dst(b"another one."), data(0, 0x103, 3, payload(3)))
    assert [[s.sequence for s in process.got[reader.guid]] for reader in (one, two, sibling)] == [
        [1, 2],
        [],
        [1],
    ]


def test_an_acknack_needs_no_destination() -> None:
    world, process, participant, stranger = met()
    writer = process.writer(participant)
    other = process.writer(process.participant(), entity=writer.entity)
    stranger.endpoint(0x104)
    assert writer.matched == other.matched != ()
    for made in (writer, other):
        made.write(payload(1), process.now)
    assert not writer.acknowledged
    stranger.send(acknack(0x104, writer.entity, 2, [], 1, final=True))
    assert writer.acknowledged
    assert other.acknowledged
    writer.write(payload(2), process.now)
    other.write(payload(2), process.now)
    stranger.send(info_dst(participant.prefix), acknack(0x104, writer.entity, 3, [], 2, final=True))
    assert (writer.acknowledged, other.acknowledged) == (True, False)
    before = process.core.counters["unmatched"]
    stranger.send(acknack(0x204, writer.entity, 3, [], 2), acknack(0x104, 0x777703, 3, [], 2))
    assert process.core.counters["unmatched"] == before + 2
    world.run(SECOND)


def test_answers_go_where_info_reply_says_for_the_rest_of_its_message() -> None:
    world = World()
    process = world.process()
    participant = process.participant()
    stranger = Stranger(process, vendor=VENDOR_CYCLONE)
    stranger.announce()
    process.reader(participant)
    stranger.endpoint(0x103)
    world.run(SECOND)
    sent = world.record()
    elsewhere = udp4("10.7.7.7", 4444)
    stranger.send(info_reply([elsewhere]), heartbeat(0, 0x103, 1, 5, 1))
    stranger.send(heartbeat(0, 0x103, 1, 5, 2, final=False))
    world.run(100 * MS)
    assert sent[0].receiver == elsewhere
    assert {datagram.receiver for datagram in sent[1:]} == {stranger.at}
    sent.clear()
    publications = ENTITYID_SEDP_PUBLICATIONS_WRITER
    stranger.send(info_reply([elsewhere]), heartbeat(0, publications, 1, 5, 1))
    stranger.send(heartbeat(0, publications, 1, 5, 2))
    world.run(100 * MS)
    assert [datagram.receiver for datagram in sent[:2]] == [elsewhere, stranger.at]
    sent.clear()
    stranger.send(info_reply([udp4("239.255.0.7", 4444)]), heartbeat(0, 0x103, 1, 6, 3))
    assert [datagram.receiver for datagram in sent] == [stranger.at]


def test_info_src_speaks_for_another_but_not_for_ours() -> None:
    _, process, participant, stranger = met()
    ours = process.participant()
    writer = process.writer(ours, qos=BEST_EFFORT)
    reader = process.reader(participant, qos=BEST_EFFORT)
    gateway = Stranger(process, 2)
    gateway.announce()
    stranger.endpoint(0x103, qos=BEST_EFFORT)
    gateway.send(info_src(stranger.prefix), data(0, 0x103, 1, payload(1)))
    gateway.send(info_src(ours.prefix), data(0, writer.entity, 1, payload(2)))
    assert [sample.payload for sample in process.got[reader.guid]] == [payload(1)]
    assert process.core.counters["echoes"] == 1


def test_an_announcement_for_another_is_left_alone() -> None:
    _, process, participant, _ = met()
    other = Stranger(process, 2)
    content = data(ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, 1, other.told.payload())
    other.send(info_dst(b"another one."), content)
    assert len(participant.participants) == 1
    other.send(info_dst(participant.prefix), content)
    assert len(participant.participants) == 2


# --- Participants -----------------------------------------------------------------------------------------


def test_what_was_overtaken_by_a_farewell_is_left_alone_for_a_while() -> None:
    world, _, participant, stranger = met()
    stranger.announced = 10
    stranger.leave()
    stranger.announced = 5
    stranger.announce()
    assert not participant.participants
    world.run(3 * SECOND)
    stranger.announce()  # one that counts anew
    assert len(participant.participants) == 1


def test_what_was_overtaken_by_a_newer_announcement_is_left_alone() -> None:
    world, process, participant, stranger = met()
    old, stranger.told = stranger.told, replace(stranger.told, name="new")
    stranger.announced = 10
    stranger.announce()
    stranger.told, stranger.announced = old, 5
    stranger.announce()
    assert [found.name for found in participant.participants] == ["new"]
    world.run(3 * SECOND)
    stranger.announce()
    assert [found.name for found in participant.participants] == [""]
    assert len(of(process.events[participant.prefix], ParticipantChanged)) == 2


def test_a_change_is_told_several_times() -> None:
    world, process, participant, stranger = met(lease=1000 * SECOND)
    world.run(2 * SECOND)
    second = process.participant()
    world.run(2 * SECOND)
    sent = world.record()
    second.set_user_data(b"new", process.now)
    world.run(1500 * MS)
    told = [
        event
        for event in stranger.heard(sent)
        if isinstance(event, Data) and event.source == second.prefix and b"new" in event.payload
    ]
    assert len(told) == 5
    assert second.data.user_data == b"new"
    assert participant.data.user_data == b""


def test_a_changed_lease_counts() -> None:
    world, _, participant, stranger = met(lease=30 * SECOND)
    world.run(10 * SECOND)
    stranger.told = Stranger(stranger.process, lease=2 * SECOND).told
    stranger.announce()
    world.run(3 * SECOND)
    assert not participant.participants


def test_anything_said_is_a_sign_of_life() -> None:
    world, _, participant, stranger = met(lease=2 * SECOND)
    for _ in range(5):
        world.run(1500 * MS)
        stranger.send(info_dst(participant.prefix))
    assert len(participant.participants) == 1
    world.run(2500 * MS)
    assert not participant.participants


def test_one_that_comes_to_live_here_is_gone_elsewhere() -> None:
    world, process, participant, stranger = met()
    stranger.endpoint(0x103)
    process.participant(prefix=stranger.prefix)
    events = process.events[participant.prefix]
    assert [lost.why for lost in of(events, ParticipantLost)] == [Why.LEFT]
    assert participant.endpoints == ()
    world.run(SECOND)
    assert [found.prefix for found in participant.participants] == [stranger.prefix]


def test_only_the_builtin_endpoints_a_peer_has_are_talked_to() -> None:
    world = World()
    process = world.process()
    process.writer(process.participant())
    writers_only = Stranger(
        process,
        builtin_endpoints=BuiltinEndpoint.PUBLICATIONS_ANNOUNCER | BuiltinEndpoint.PARTICIPANT_ANNOUNCER,
    )
    readers_only = Stranger(process, 2, builtin_endpoints=BuiltinEndpoint.SUBSCRIPTIONS_DETECTOR)
    sent = world.record()
    for stranger in (writers_only, readers_only):
        stranger.announce()
    world.run(SECOND)
    assert {event.reader for event in writers_only.heard(sent) if isinstance(event, AckNack)} == {
        ENTITYID_SEDP_PUBLICATIONS_READER
    }
    assert not [event for event in writers_only.heard(sent) if isinstance(event, Heartbeat)]
    assert {event.reader for event in readers_only.heard(sent) if isinstance(event, Heartbeat)} == {
        ENTITYID_SEDP_SUBSCRIPTIONS_READER
    }
    assert not [event for event in readers_only.heard(sent) if isinstance(event, AckNack)]


def test_known_participants_are_told_by_unicast_that_one_lives_and_that_it_goes() -> None:
    world, process, participant, stranger = met(lease=1000 * SECOND)
    process.core.set_addresses(process.addresses._replace(announce_to=()), process.now)
    world.run(2 * SECOND)
    sent = world.record()
    world.run(30 * SECOND)
    told = [
        event
        for event in stranger.heard(sent)
        if isinstance(event, Data) and event.writer == ENTITYID_SPDP_WRITER
    ]
    assert len(told) >= 4  # every third of the lease
    sent.clear()
    participant.close(process.now)
    last = [event for event in stranger.heard(sent) if isinstance(event, Data)][-1]
    assert (last.writer, last.payload) == (ENTITYID_SPDP_WRITER, b"")


# --- Endpoints --------------------------------------------------------------------------------------------


def test_an_endpoint_said_again_is_no_news() -> None:
    _, process, participant, stranger = met()
    for _ in range(3):
        told = stranger.endpoint(0x103)
    changed = stranger.endpoint(0x103, user_data=b"x")
    events = process.events[participant.prefix]
    assert of(events, EndpointFound) == [EndpointFound(told)]
    assert of(events, EndpointChanged) == [EndpointChanged(changed, told)]


def test_an_endpoint_that_changes_its_topic_is_another() -> None:
    _, process, participant, stranger = met()
    one, two = process.reader(participant, "rt/a"), process.reader(participant, "rt/b")
    before = stranger.endpoint(0x103, "rt/a")
    assert (one.matched, two.matched) == ((before.guid,), ())
    stranger.endpoint(0x103, "rt/b")
    assert (one.matched, two.matched) == ((), (before.guid,))
    events = process.events[participant.prefix]
    assert of(events, EndpointLost) == [EndpointLost(before, Why.CHANGED)]
    assert [endpoint.topic for endpoint in participant.endpoints] == ["rt/b"]
    assert not [endpoint for endpoint in participant.on_topic("rt/a") if endpoint.guid == before.guid]


def test_one_that_fits_at_last_has_no_reasons_left() -> None:
    _, process, participant, stranger = met()
    reader = process.reader(participant)
    told = stranger.endpoint(0x103, qos=BEST_EFFORT)
    assert list(reader.refused) == [told.guid]
    stranger.endpoint(0x103)
    assert (reader.refused, reader.matched) == ({}, (told.guid,))
    stranger.endpoint(0x103, qos=BEST_EFFORT)
    assert len(of(process.events[participant.prefix], Incompatible)) == 2
    stranger.withdraw(told)
    assert (reader.refused, reader.matched) == ({}, ())


def test_an_endpoint_is_sent_to_where_it_says() -> None:
    world, process, participant, stranger = met()
    writer = process.writer(participant, qos=BEST_EFFORT)
    special = udp4("10.9.9.9", 9999)
    stranger.endpoint(0x104, qos=BEST_EFFORT, unicast=(special,))
    sent = world.record()
    writer.write(payload(1), process.now)
    assert [datagram.receiver for datagram in sent] == [special]
    stranger.endpoint(0x204, qos=BEST_EFFORT, unicast=(udp4("127.0.0.1", 9999),))  # cannot be reached
    sent.clear()
    writer.write(payload(2), process.now)
    assert sorted(datagram.receiver for datagram in sent) == [stranger.at, special]  # type: ignore[type-var]


# --- Samples ----------------------------------------------------------------------------------------------


def test_samples_that_say_nothing_are_not_handed_on() -> None:
    _, process, participant, stranger = met()
    plain, with_key = process.reader(participant), process.reader(participant, "rt/k", keyed=True)
    stranger.endpoint(0x103)
    stranger.endpoint(0x202, "rt/k")
    bye = inline_qos(key_hash=b"k" * 16, status=StatusInfo.DISPOSED)
    stranger.send(
        data(0, 0x103, 1, b""),
        data(0, 0x103, 2, b"", inline_qos=bye),
        data(0, 0x103, 3, payload(1), key=True),
        data(0, 0x103, 4, payload(2), inline_qos=bye),
        data(0, 0x103, 5, payload(3)),
        data(0, 0x202, 1, b""),
        data(0, 0x202, 2, payload(1), key=True),
        data(0, 0x202, 3, payload(1), key=True, inline_qos=bye),
    )
    assert [sample.sequence for sample in process.got[plain.guid]] == [5]
    assert [(sample.sequence, sample.status) for sample in process.got[with_key.guid]] == [
        (3, StatusInfo.DISPOSED)
    ]


def test_a_malformed_key_hash_or_status_counts_as_none() -> None:
    _, process, participant, stranger = met()
    reader = process.reader(participant, keyed=True)
    stranger.endpoint(0x102)
    short = b"\x70\0\4\0key!\x71\0\0\0\1\0\0\0"
    stranger.send(data(0, 0x102, 1, payload(1), inline_qos=short))
    (sample,) = process.got[reader.guid]
    assert (sample.instance, sample.status, sample.payload) == (b"", 0, payload(1))


# --- Liveliness -------------------------------------------------------------------------------------------


def leased(kind: Liveliness) -> EndpointQos:
    return EndpointQos(liveliness=kind, lease=SECOND, reliability=Reliability.BEST_EFFORT)


def test_whatever_comes_from_it_keeps_an_automatic_writer_alive() -> None:
    world, process, participant, stranger = met()
    reader = process.reader(participant, qos=BEST_EFFORT)
    told = stranger.endpoint(0x103, qos=leased(Liveliness.AUTOMATIC))

    def changes() -> list[LivelinessChanged]:
        return of(process.events[participant.prefix], LivelinessChanged)

    for _ in range(5):
        world.run(700 * MS)
        stranger.send(info_dst(participant.prefix))
    assert changes() == []
    world.run(1200 * MS)
    assert changes() == [LivelinessChanged(reader.guid, told.guid, False)]
    stranger.say(ENTITYID_PARTICIPANT_MESSAGE_WRITER, Assertion(stranger.prefix, False).payload())
    assert changes()[1:] == [LivelinessChanged(reader.guid, told.guid, True)]


def test_assertions_keep_those_alive_they_speak_for() -> None:
    world, process, participant, stranger = met()
    other = Stranger(process, 2)
    other.announce()
    kinds = (Liveliness.MANUAL_BY_PARTICIPANT, Liveliness.MANUAL_BY_TOPIC)
    told = [stranger.endpoint(number << 8 | 3, qos=leased(kind)) for number, kind in enumerate(kinds, 1)]
    foreign = other.endpoint(0x103, qos=leased(Liveliness.MANUAL_BY_PARTICIPANT))
    process.reader(participant, qos=BEST_EFFORT)
    for _ in range(4):
        world.run(700 * MS)
        stranger.say(ENTITYID_PARTICIPANT_MESSAGE_WRITER, Assertion(stranger.prefix, True).payload())
        stranger.say(ENTITYID_PARTICIPANT_MESSAGE_WRITER, Assertion(other.prefix, True).payload())
    lost = {change.remote for change in of(process.events[participant.prefix], LivelinessChanged)}
    assert lost == {told[1].guid, foreign.guid}


def test_an_automatic_assertion_does_not_speak_for_manual_writers() -> None:
    world, process, participant, stranger = met()
    told = stranger.endpoint(0x103, qos=leased(Liveliness.MANUAL_BY_PARTICIPANT))
    process.reader(participant, qos=BEST_EFFORT)
    for _ in range(4):
        world.run(700 * MS)
        stranger.say(ENTITYID_PARTICIPANT_MESSAGE_WRITER, Assertion(stranger.prefix, False).payload())
    assert [change.remote for change in of(process.events[participant.prefix], LivelinessChanged)] == [
        told.guid
    ]


def test_leases_end_with_their_readers() -> None:
    _, process, participant, stranger = met()
    readers = [process.reader(participant, qos=BEST_EFFORT) for _ in range(2)]
    told = stranger.endpoint(0x103, qos=leased(Liveliness.MANUAL_BY_TOPIC))
    assert list(participant._leases[stranger.prefix]) == [told.guid]
    readers[0].close(process.now)
    assert participant._leases
    readers[1].close(process.now)
    assert participant._leases == {}
    late = process.reader(participant, qos=BEST_EFFORT)
    stranger.endpoint(0x103, qos=BEST_EFFORT)  # without end from now on
    assert late.matched
    assert participant._leases == {}


def test_nothing_is_asserted_when_no_writer_needs_it_any_more() -> None:
    world, process, participant, stranger = met(lease=1000 * SECOND)
    writer = process.writer(participant, qos=EndpointQos(lease=SECOND))
    world.run(2 * SECOND)
    sent = world.record()

    def said() -> list[Event]:
        return [
            event
            for event in stranger.heard(sent)
            if isinstance(event, Data) and event.writer == ENTITYID_PARTICIPANT_MESSAGE_WRITER
        ]

    world.run(3 * SECOND)
    assert 8 <= len(said()) <= 10
    writer.close(process.now)
    sent.clear()
    world.run(3 * SECOND)
    assert said() == []


@pytest.mark.parametrize("with_lifespan", [True, False])
def test_lifespans_are_of_the_writer(with_lifespan: bool) -> None:
    _, process, participant, stranger = met()
    reader = process.reader(participant)
    qos = EndpointQos(lifespan=SECOND) if with_lifespan else EndpointQos()
    told = stranger.endpoint(0x103, qos=qos)
    stranger.send(data(0, 0x103, 1, payload(1)))
    (sample,) = process.got[reader.guid]
    assert sample.expires == (process.now + SECOND if with_lifespan else None)
    stranger.withdraw(told)
    assert reader._lifespans == {}
