"""Participants that meet over a network, and within a process."""

from tests.rtps.domains import MS, SECOND, World, payload


def test_two_processes_meet_and_exchange_samples() -> None:
    world = World()
    left, right = world.process(), world.process()
    talker, listener = left.participant(name="talker"), right.participant(name="listener")
    writer, reader = left.writer(talker), right.reader(listener)
    world.run(300 * MS)
    assert writer.matched == (reader.guid,) and reader.matched == (writer.guid,)
    for number in range(100):
        assert writer.write(payload(number), left.now) == number + 1
    world.run(SECOND)
    assert [sample.payload for sample in right.got[reader.guid]] == [payload(number) for number in range(100)]
    assert writer.acknowledged


def test_participants_of_one_process_meet_without_a_network() -> None:
    world = World()
    process = world.process()
    talker, listener = process.participant(), process.participant()
    writer, reader, own = process.writer(talker), process.reader(listener), process.reader(talker)
    assert writer.matched == (own.guid, reader.guid) or writer.matched == (reader.guid, own.guid)
    writer.write(payload(1), process.now)
    for guid in (reader.guid, own.guid):
        assert [sample.payload for sample in process.got[guid]] == [payload(1)]
