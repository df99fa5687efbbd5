"""What the policies do once writers and readers have met, in virtual time."""

from dataclasses import replace
from typing import Any

import pytest

from muros.rtps import (
    WRITER_QOS,
    DeadlineMissed,
    Durability,
    EndpointQos,
    History,
    Incompatible,
    Liveliness,
    LivelinessChanged,
    LivelinessLost,
    LocalReader,
    LocalWriter,
    Matched,
    Ownership,
    ParticipantCore,
    Policy,
    Problem,
    Received,
    Reliability,
    ResourceLimits,
    StatusInfo,
    Trouble,
    Unmatched,
    Why,
    WriterSettings,
    inline_qos,
    related_identity,
)
from muros.rtps._parameters import key_hash
from tests.rtps.domains import MS, SECOND, Process, World, of, payload


class Pair:
    """A writer and a reader on two computers."""

    def __init__(
        self,
        writer: dict[str, Any] | None = None,
        reader: dict[str, Any] | None = None,
        meet: int = SECOND,
        **both: Any,
    ) -> None:
        self.world = World()
        self.left, self.right = self.world.process(), self.world.process()
        self.talker, self.listener = self.left.participant(), self.right.participant()
        entity_options = {key: both.pop(key) for key in ("keyed", "type_name") if key in both}
        self.options = entity_options
        self.writer_qos = replace(WRITER_QOS, **both, **(writer or {}))
        self.reader_qos = replace(WRITER_QOS, **both, **(reader or {}))
        self.writer = self.left.writer(self.talker, qos=self.writer_qos, **entity_options)
        self.reader = self.right.reader(self.listener, qos=self.reader_qos, **entity_options)
        self.world.run(meet)

    @property
    def now(self) -> int:
        return self.left.now

    @property
    def got(self) -> list[Received]:
        return self.right.got[self.reader.guid]

    def run(self, span: float) -> None:
        self.world.run(span)

    def write(self, number: int, **options: Any) -> int:
        return self.writer.write(payload(number), self.now, **options)

    def left_events(self, kind: type[Any]) -> list[Any]:
        return of(self.left.events[self.talker.prefix], kind)

    def right_events(self, kind: type[Any]) -> list[Any]:
        return of(self.right.events[self.listener.prefix], kind)


# --- Compatibility ---------------------------------------------------------------------------------------


def test_those_that_do_not_fit_learn_why() -> None:
    pair = Pair(reader={"durability": Durability.TRANSIENT_LOCAL})
    assert (pair.writer.matched, pair.reader.matched) == ((), ())
    (told,) = pair.left_events(Incompatible)
    assert (told.local, told.remote) == (pair.writer.guid, pair.reader.data)
    assert told.reasons == ("the writer offers volatile, the reader wants transient local",)
    (told,) = pair.right_events(Incompatible)
    assert (told.local, told.remote) == (pair.reader.guid, pair.writer.data)
    assert [mismatch.policy for mismatch in pair.writer.refused[pair.reader.guid]] == [Policy.DURABILITY]
    pair.write(1)
    pair.run(SECOND)
    assert pair.got == []
    pair.reader.close(pair.now)
    pair.run(SECOND)
    assert pair.writer.refused == {}


def test_partitions_keep_topics_apart() -> None:
    pair = Pair(partitions=("a",))
    other = pair.right.reader(pair.listener, qos=replace(WRITER_QOS, partitions=("b", "c")))
    patterns = pair.right.reader(pair.listener, qos=replace(WRITER_QOS, partitions=("?",)))
    pair.run(SECOND)
    pair.write(1)
    pair.run(SECOND)
    assert [len(pair.right.got[reader.guid]) for reader in (pair.reader, other, patterns)] == [1, 0, 1]


def test_a_change_of_qos_unmatches_and_matches_again() -> None:
    pair = Pair(partitions=("a",))
    for partitions, fits in ((("b",), False), (("a", "b"), True)):
        moved = replace(pair.writer.data, qos=replace(pair.writer_qos, partitions=partitions))
        pair.talker._discovery.announce(moved, pair.now)
        pair.run(SECOND)
        assert bool(pair.reader.matched) is fits
    told = pair.right.events[pair.listener.prefix]
    kinds = [type(event) for event in told if isinstance(event, Matched | Unmatched | Incompatible)]
    assert kinds == [Matched, Unmatched, Incompatible, Matched]
    (ended,) = of(told, Unmatched)
    assert ended.why == Why.CHANGED


def test_best_effort_readers_take_what_comes() -> None:
    pair = Pair(reader={"reliability": Reliability.BEST_EFFORT})
    assert pair.reader.matched == (pair.writer.guid,)
    pair.write(1)
    assert pair.writer.acknowledged  # nothing is waited for
    pair.run(SECOND)
    assert [sample.payload for sample in pair.got] == [payload(1)]


# --- History ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wanted", "expected"), [(Durability.TRANSIENT_LOCAL, [3, 4, 5, 6]), (Durability.VOLATILE, [6])]
)
def test_late_readers_get_the_history_they_want(wanted: Durability, expected: list[int]) -> None:
    pair = Pair(durability=Durability.TRANSIENT_LOCAL, depth=3)
    for number in range(6):
        pair.write(number)
    pair.run(SECOND)
    late = pair.right.participant()
    reader = pair.right.reader(late, qos=replace(pair.reader_qos, durability=wanted))
    sibling = pair.left.reader(pair.talker, qos=replace(pair.reader_qos, durability=wanted))
    pair.run(SECOND)
    pair.write(6)
    pair.run(SECOND)
    for process, made in ((pair.right, reader), (pair.left, sibling)):
        assert [sample.payload for sample in process.got[made.guid]] == [payload(n) for n in expected]


def test_keep_all_refuses_when_full_and_says_when_there_is_room() -> None:
    room = []
    pair = Pair(history=History.KEEP_ALL, limits=ResourceLimits(max_samples=4))
    pair.writer.close(pair.now)
    writer = pair.left.writer(pair.talker, qos=pair.writer_qos, on_room=lambda: room.append(pair.now))
    pair.run(SECOND)
    taken = [writer.write(payload(number), pair.now) for number in range(6)]
    assert taken == [1, 2, 3, 4, 0, 0]
    assert not writer.acknowledged
    pair.run(SECOND)
    assert len(room) == 1
    assert writer.write(payload(9), pair.now) == 5


def test_a_reader_is_given_the_writers_patience_from_the_first_refusal_on() -> None:
    pair = Pair(history=History.KEEP_ALL)
    pair.writer.close(pair.now)
    writer = pair.left.writer(
        pair.talker, qos=pair.writer_qos, settings=WriterSettings(limit=3, patience=SECOND)
    )
    pair.run(SECOND)
    pair.right.vanish()
    for number in range(3):
        assert writer.write(payload(number), pair.now)
        pair.run(SECOND)
    assert not writer.write(payload(3), pair.now)  # although nothing has been acknowledged for three seconds
    pair.run(900 * MS)
    assert not writer.write(payload(3), pair.now)
    assert pair.left_events(Trouble) == []
    pair.run(200 * MS)
    assert writer.write(payload(3), pair.now)
    (told,) = pair.left_events(Trouble)
    assert (told.local, told.remote, told.problem) == (writer.guid, pair.reader.guid, Problem.READER_STALLED)


def test_a_reader_that_refuses_stops_a_writer_that_keeps_all() -> None:
    pair = Pair(history=History.KEEP_ALL, limits=ResourceLimits(max_samples=10))
    accepted: list[Received] = []
    open_ = [False]

    def on_sample(sample: Received) -> bool:
        if open_[0]:
            accepted.append(sample)
        return open_[0]

    pair.reader.close(pair.now)
    reader = pair.right.reader(pair.listener, qos=pair.reader_qos, on_sample=on_sample)
    pair.run(SECOND)
    written = sum(1 for number in range(50) if pair.write(number))
    pair.run(SECOND)
    assert (written, accepted) == (10, [])
    open_[0] = True
    reader.resume(pair.now)
    pair.run(SECOND)
    assert [sample.payload for sample in accepted] == [payload(number) for number in range(10)]
    assert pair.write(99)


def test_samples_end_with_their_lifespan() -> None:
    pair = Pair({"lifespan": SECOND}, durability=Durability.TRANSIENT_LOCAL, depth=10)
    pair.write(1)
    pair.run(600 * MS)
    pair.write(2)
    pair.run(600 * MS)
    late = pair.right.reader(pair.right.participant(), qos=pair.reader_qos)
    pair.run(SECOND)
    (sample,) = pair.right.got[late.guid]
    assert sample.payload == payload(2)
    first = pair.got[0]
    assert first.expires is not None
    assert 0 < first.expires - (first.sequence + SECOND + SECOND) < MS  # it came at 1 s, and lives 1 s


def test_a_lifespan_counts_from_arrival_also_for_what_was_held_back() -> None:
    pair = Pair({"lifespan": SECOND}, history=History.KEEP_ALL)
    expires: list[int | None] = []
    open_ = [False]

    def on_sample(sample: Received) -> bool:
        if open_[0]:
            expires.append(sample.expires)
        return open_[0]

    reader = pair.right.reader(pair.listener, qos=pair.reader_qos, on_sample=on_sample)
    pair.run(SECOND)
    written = []
    for number in range(3):
        written.append(pair.now)
        pair.write(number)
        pair.run(100 * MS)
    open_[0] = True
    reader.resume(pair.now)
    pair.write(3)
    written.append(pair.now)
    pair.run(100 * MS)
    assert len(expires) == 4
    for at, end in zip(written, expires, strict=True):
        assert end is not None
        assert SECOND <= end - at < SECOND + MS


# --- Deadline --------------------------------------------------------------------------------------------


def test_both_sides_notice_a_missed_deadline() -> None:
    pair = Pair(deadline=100 * MS)
    pair.run(SECOND)
    assert pair.left_events(DeadlineMissed) == []  # nothing is due before the first sample
    for _ in range(20):
        pair.write(0)
        pair.run(90 * MS)
    assert (pair.left_events(DeadlineMissed), pair.right_events(DeadlineMissed)) == ([], [])
    pair.run(260 * MS)
    assert [event.total for event in pair.left_events(DeadlineMissed)] == [1, 2, 3]
    assert [event.total for event in pair.right_events(DeadlineMissed)] == [1, 2, 3]
    assert pair.right_events(DeadlineMissed)[0].local == pair.reader.guid
    pair.write(0)
    pair.run(90 * MS)
    assert len(pair.right_events(DeadlineMissed)) == 3
    pair.writer.close(pair.now)
    pair.run(SECOND)
    assert len(pair.left_events(DeadlineMissed)) == 3
    assert len(pair.right_events(DeadlineMissed)) <= 4  # it ends with the last writer


def test_deadlines_hold_for_each_instance() -> None:
    pair = Pair(deadline=100 * MS, keyed=True)
    one, two = b"1" * 16, b"2" * 16
    pair.write(1, instance=one)
    pair.write(2, instance=two)
    for _ in range(5):
        pair.run(70 * MS)
        pair.write(1, instance=one)
    assert {event.instance for event in pair.right_events(DeadlineMissed)} == {two}
    before = len(pair.right_events(DeadlineMissed))
    pair.writer.dispose(two, pair.now)
    for _ in range(5):
        pair.run(70 * MS)
        pair.write(1, instance=one)
    assert len(pair.right_events(DeadlineMissed)) == before


# --- Liveliness ------------------------------------------------------------------------------------------


def test_automatic_liveliness_needs_nothing_of_the_user() -> None:
    pair = Pair(lease=SECOND)
    pair.run(20 * SECOND)
    assert pair.right_events(LivelinessChanged) == []
    assert pair.left_events(LivelinessLost) == []
    pair.left.vanish()
    pair.run(1500 * MS)
    assert pair.right_events(LivelinessChanged) == [
        LivelinessChanged(pair.reader.guid, pair.writer.guid, False)
    ]
    assert pair.reader.matched == (pair.writer.guid,)  # its participant's lease is longer


@pytest.mark.parametrize("kind", [Liveliness.MANUAL_BY_PARTICIPANT, Liveliness.MANUAL_BY_TOPIC])
@pytest.mark.parametrize("reliability", [Reliability.RELIABLE, Reliability.BEST_EFFORT])
def test_manual_liveliness_is_what_the_user_says(kind: Liveliness, reliability: Reliability) -> None:
    pair = Pair(meet=300 * MS, lease=SECOND, liveliness=kind, reliability=reliability)
    guid = (pair.reader.guid, pair.writer.guid)
    for _ in range(10):
        pair.run(600 * MS)
        pair.writer.assert_liveliness(pair.now)
    for _ in range(10):
        pair.run(600 * MS)
        pair.write(1)
    assert (pair.right_events(LivelinessChanged), pair.left_events(LivelinessLost)) == ([], [])
    pair.run(2500 * MS)
    assert pair.left_events(LivelinessLost) == [LivelinessLost(pair.writer.guid, 1)]
    assert pair.right_events(LivelinessChanged) == [LivelinessChanged(*guid, False)]
    pair.writer.assert_liveliness(pair.now)
    pair.run(100 * MS)
    assert pair.right_events(LivelinessChanged)[1:] == [LivelinessChanged(*guid, True)]
    pair.run(2500 * MS)
    assert pair.left_events(LivelinessLost)[1:] == [LivelinessLost(pair.writer.guid, 2)]
    assert pair.right_events(LivelinessChanged)[2:] == [LivelinessChanged(*guid, False)]


def test_a_participant_speaks_for_all_its_writers_but_those_by_topic() -> None:
    pair = Pair(meet=300 * MS, lease=SECOND, liveliness=Liveliness.MANUAL_BY_PARTICIPANT)
    by_topic = replace(pair.writer_qos, liveliness=Liveliness.MANUAL_BY_TOPIC)
    second = pair.left.writer(pair.talker, "rt/b", pair.writer_qos)
    third = pair.left.writer(pair.talker, "rt/c", by_topic)
    for topic in ("rt/b", "rt/c"):
        pair.right.reader(pair.listener, topic, pair.reader_qos)
    for _ in range(10):
        pair.talker.assert_liveliness(pair.now)
        pair.run(500 * MS)
    assert [event.remote for event in pair.right_events(LivelinessChanged)] == [third.guid]
    assert [event.local for event in pair.left_events(LivelinessLost)] == [third.guid]
    assert second.matched


def test_asserting_without_end_does_not_flood_the_network() -> None:
    pair = Pair(meet=300 * MS, lease=SECOND, liveliness=Liveliness.MANUAL_BY_PARTICIPANT)
    sent = pair.world.record()
    for _ in range(1000):
        pair.writer.assert_liveliness(pair.now)
        pair.run(MS)
    assert len(sent) < 30


# --- Ownership -------------------------------------------------------------------------------------------


def exclusive(strength: int) -> EndpointQos:
    return EndpointQos(
        ownership=Ownership.EXCLUSIVE, strength=strength, lease=SECOND, liveliness=Liveliness.MANUAL_BY_TOPIC
    )


def owned(
    keyed: bool = False,
) -> tuple[World, Process, LocalWriter, LocalWriter, LocalReader, ParticipantCore]:
    world = World()
    left, right = world.process(), world.process()
    weak = left.writer(left.participant(), qos=exclusive(1), keyed=keyed)
    strong = left.writer(left.participant(), qos=exclusive(2), keyed=keyed)
    listener = right.participant()
    reader = right.reader(listener, qos=exclusive(0), keyed=keyed)
    world.run(SECOND)
    return world, right, weak, strong, reader, listener


def test_the_strongest_writer_alive_is_heard() -> None:
    world, right, weak, strong, reader, _ = owned()
    for writer, number in ((weak, 1), (strong, 2), (weak, 3), (strong, 4)):
        writer.write(payload(number), right.now)
        world.run(10 * MS)
    assert [sample.payload for sample in right.got[reader.guid]] == [payload(n) for n in (1, 2, 4)]
    assert reader.outranked == 1
    world.run(SECOND)  # neither says that it is alive
    weak.write(payload(5), right.now)
    world.run(10 * MS)
    strong.write(payload(6), right.now)
    world.run(10 * MS)
    weak.write(payload(7), right.now)
    world.run(10 * MS)
    strong.close(right.now)
    world.run(10 * MS)
    weak.write(payload(8), right.now)
    world.run(10 * MS)
    assert [sample.payload for sample in right.got[reader.guid]][3:] == [payload(n) for n in (5, 6, 8)]


def test_ownership_is_of_each_instance() -> None:
    world, right, weak, strong, reader, _ = owned(keyed=True)
    one, two = b"1" * 16, b"2" * 16
    for writer, instance, number in (
        (strong, one, 1), (weak, one, 2), (weak, two, 3), (weak, two, 4),
    ):  # fmt: skip
        writer.write(payload(number), right.now, instance=instance)
        world.run(10 * MS)
    strong.unregister(one, right.now)
    world.run(10 * MS)
    weak.write(payload(5), right.now, instance=one)
    world.run(10 * MS)
    got = [(s.payload, s.status) for s in right.got[reader.guid]]
    assert got == [
        (payload(1), 0),
        (payload(3), 0),
        (payload(4), 0),
        (b"", StatusInfo.UNREGISTERED),
        (payload(5), 0),
    ]


def test_an_owner_that_misses_the_readers_deadline_is_not_waited_for() -> None:
    world = World()
    left, right = world.process(), world.process()
    qos = EndpointQos(ownership=Ownership.EXCLUSIVE, deadline=SECOND)
    weak = left.writer(left.participant(), qos=qos)
    strong = left.writer(left.participant(), qos=replace(qos, strength=1))
    reader = right.reader(right.participant(), qos=qos)
    world.run(SECOND)
    for number in range(3):
        strong.write(payload(number), left.now)
        world.run(800 * MS)
        weak.write(payload(100 + number), left.now)
    world.run(800 * MS)
    weak.write(payload(200), left.now)
    world.run(SECOND)
    assert [s.payload for s in right.got[reader.guid]] == [payload(n) for n in (0, 1, 2, 200)]


# --- Keys and inline QoS ---------------------------------------------------------------------------------


def test_instances_are_passed_on_with_what_becomes_of_them() -> None:
    pair = Pair(keyed=True, depth=5)
    one = bytes(range(16))
    key = b"\0\1\0\0\7\0\0\0"
    pair.write(1, instance=one)
    pair.writer.dispose(one, pair.now)
    pair.writer.dispose(one, pair.now, key=key, unregister=True)
    pair.writer.unregister(one, pair.now)
    pair.write(2)
    pair.run(SECOND)
    both = StatusInfo.DISPOSED | StatusInfo.UNREGISTERED
    assert [(sample.instance, sample.status, sample.payload) for sample in pair.got] == [
        (one, 0, payload(1)),
        (one, StatusInfo.DISPOSED, b""),
        (one, both, key),
        (one, StatusInfo.UNREGISTERED, b""),
        (b"", 0, payload(2)),
    ]
    for wrong in (b"short", b""):
        with pytest.raises(ValueError, match="16 bytes"):
            pair.writer.dispose(wrong, pair.now)


def test_each_instance_has_a_history_of_its_own() -> None:
    pair = Pair(keyed=True, depth=1, durability=Durability.TRANSIENT_LOCAL)
    keys = [bytes([number]) * 16 for number in range(3)]
    for number in range(9):
        pair.write(number, instance=keys[number % 3])
    pair.writer.unregister(keys[0], pair.now)
    pair.run(SECOND)
    late = pair.right.reader(pair.right.participant(), qos=pair.reader_qos, keyed=True)
    pair.run(SECOND)
    assert [sample.payload for sample in pair.right.got[late.guid]] == [payload(7), payload(8)]


def test_a_writer_has_room_for_so_many_instances() -> None:
    room = []
    pair = Pair(keyed=True)
    pair.writer.close(pair.now)
    qos = replace(pair.writer_qos, limits=ResourceLimits(max_instances=2))
    writer = pair.left.writer(pair.talker, qos=qos, keyed=True, on_room=lambda: room.append(pair.now))
    keys = [bytes([number]) * 16 for number in range(3)]
    assert [bool(writer.write(payload(1), pair.now, instance=key)) for key in (*keys, keys[0])] == [
        1,
        1,
        0,
        1,
    ]
    (told,) = pair.left_events(Trouble)
    assert (told.local, told.problem, told.number) == (writer.guid, Problem.INSTANCES_FULL, 2)
    writer.dispose(keys[0], pair.now)
    assert not writer.write(payload(1), pair.now, instance=keys[2])
    assert room == []
    writer.unregister(keys[0], pair.now)
    assert len(room) == 1
    assert writer.write(payload(1), pair.now, instance=keys[2])


def test_a_writer_that_keeps_all_has_room_for_so_many_samples_of_an_instance() -> None:
    limits = ResourceLimits(max_samples=10, max_samples_per_instance=2)
    pair = Pair(keyed=True, history=History.KEEP_ALL, limits=limits)
    one, two = b"1" * 16, b"2" * 16
    taken = [pair.write(number, instance=key) for number, key in enumerate((one, one, one, two, two, two))]
    assert taken == [1, 2, 0, 3, 4, 0]
    assert [told.number for told in pair.left_events(Trouble)] == [2, 2]
    pair.run(SECOND)
    assert pair.write(9, instance=one) == 5
    assert [told.problem for told in pair.left_events(Trouble)] == [Problem.INSTANCE_FULL] * 2
    assert pair.writer.rejected == 2


def test_a_writer_says_when_a_full_instance_has_room_again() -> None:
    room = []
    pair = Pair(keyed=True, history=History.KEEP_ALL, limits=ResourceLimits(max_samples_per_instance=2))
    pair.writer.close(pair.now)
    writer = pair.left.writer(
        pair.talker, qos=pair.writer_qos, keyed=True, on_room=lambda: room.append(pair.now)
    )
    pair.run(SECOND)
    one, two = b"1" * 16, b"2" * 16
    assert [writer.write(payload(n), pair.now, instance=one) for n in range(3)] == [1, 2, 0]
    assert writer.write(payload(3), pair.now, instance=two) == 3
    assert room == []
    pair.run(SECOND)
    assert len(room) == 1
    assert writer.write(payload(2), pair.now, instance=one) == 4


def test_a_topic_without_a_key_is_one_instance() -> None:
    limits = ResourceLimits(max_samples=10, max_samples_per_instance=3)
    pair = Pair(history=History.KEEP_ALL, limits=limits)
    assert [pair.write(number) for number in range(5)] == [1, 2, 3, 0, 0]
    assert pair.writer.rejected == 2
    pair.run(SECOND)
    assert pair.write(5) == 4
    assert [sample.payload for sample in pair.got] == [payload(number) for number in range(3)]


def test_a_history_for_late_readers_gives_up_the_oldest_of_a_full_instance() -> None:
    limits = ResourceLimits(max_samples=4, max_samples_per_instance=2)
    pair = Pair(keyed=True, history=History.KEEP_ALL, durability=Durability.TRANSIENT_LOCAL, limits=limits)
    one, two = b"1" * 16, b"2" * 16
    for number, key in enumerate((one, two, two)):
        assert pair.write(number, instance=key)
    pair.run(SECOND)
    assert pair.write(3, instance=two)
    late = pair.right.reader(pair.right.participant(), qos=pair.reader_qos, keyed=True)
    pair.run(SECOND)
    assert [sample.payload for sample in pair.right.got[late.guid]] == [payload(n) for n in (0, 2, 3)]


def test_a_writer_that_keeps_the_last_ones_refuses_instances_it_has_no_room_for() -> None:
    limits = ResourceLimits(max_samples=3, max_samples_per_instance=2)
    pair = Pair(keyed=True, depth=2, durability=Durability.TRANSIENT_LOCAL, limits=limits)
    one, two = b"1" * 16, b"2" * 16
    taken = [pair.write(number, instance=key) for number, key in enumerate((one, one, two, two, one))]
    assert taken == [1, 2, 3, 0, 4]  # the last one takes the place of the first of its instance
    assert pair.writer.rejected == 1
    pair.writer.unregister(two, pair.now)
    pair.run(SECOND)
    assert pair.write(5, instance=b"3" * 16)


@pytest.mark.parametrize(
    ("depth", "limits", "words"),
    [
        (1, ResourceLimits(max_samples=3, max_samples_per_instance=4), "max_samples_per_instance is 4"),
        (5, ResourceLimits(max_samples_per_instance=4), "the last 5 samples"),
        (5, ResourceLimits(max_samples=4), "the last 5 samples"),
    ],
)
def test_limits_that_contradict_themselves_are_an_error(
    depth: int, limits: ResourceLimits, words: str
) -> None:
    pair = Pair()
    for make in (
        lambda qos: pair.left.writer(pair.talker, qos=qos),
        lambda qos: pair.right.reader(pair.listener, qos=qos),
    ):
        with pytest.raises(ValueError, match=words):
            make(replace(WRITER_QOS, depth=depth, limits=limits))
        make(replace(WRITER_QOS, history=History.KEEP_ALL, limits=limits._replace(max_samples=9)))


@pytest.mark.parametrize("keyed", [False, True])
def test_what_a_reader_holds_back_is_limited_and_comes_later(keyed: bool) -> None:
    """Nothing is lost: what is rejected is not acknowledged, and the writer sends it again when there is room."""
    limits = ResourceLimits(max_samples=5, max_samples_per_instance=2)
    pair = Pair(reader={"limits": limits}, history=History.KEEP_ALL, keyed=keyed)
    pair.reader.close(pair.now)
    got: list[bytes] = []
    room = [1]

    def on_sample(sample: Received) -> bool:
        room[0] -= 1
        if room[0] >= 0:
            got.append(sample.payload)
        return room[0] >= 0

    reader = pair.right.reader(pair.listener, qos=pair.reader_qos, on_sample=on_sample, keyed=keyed)
    pair.run(SECOND)
    keys = [bytes([number]) * 16 if keyed else b"" for number in range(2)]
    for number in range(20):
        assert pair.write(number, instance=keys[number % 2])
    pair.run(SECOND)
    (proxy,) = reader.core.writers
    assert (len(got), len(proxy.pending)) == (1, 4 if keyed else 2)
    assert reader.rejected >= 15
    told = {(told.local, told.remote, told.problem, told.number) for told in pair.right_events(Trouble)}
    assert told == {(reader.guid, pair.writer.guid, Problem.INSTANCE_FULL, 2)}
    before = reader.rejected
    while len(got) < 20:
        room[0] = 1
        reader.resume(pair.now)
        pair.run(SECOND)
    assert got == [payload(number) for number in range(20)]
    assert reader.rejected > before
    assert pair.writer.acknowledged


def test_a_reader_takes_so_many_instances() -> None:
    pair = Pair(reader={"limits": ResourceLimits(max_instances=2)}, keyed=True, depth=10)
    keys = [bytes([number]) * 16 for number in range(3)]
    for number, key in enumerate((*keys, keys[0])):
        pair.write(number, instance=key)
    pair.run(SECOND)
    assert [sample.payload for sample in pair.got] == [payload(0), payload(1), payload(3)]
    (told,) = pair.right_events(Trouble)
    assert (told.local, told.remote, told.problem) == (
        pair.reader.guid,
        pair.writer.guid,
        Problem.INSTANCES_FULL,
    )
    pair.writer.dispose(keys[1], pair.now)
    pair.write(7, instance=keys[2])
    pair.run(SECOND)
    assert [sample.payload for sample in pair.got][-1] == payload(7)


def test_topics_without_a_key_have_no_instances() -> None:
    pair = Pair()
    with pytest.raises(ValueError, match="no key"):
        pair.writer.dispose(b"1" * 16, pair.now)


def test_inline_qos_travels_both_ways() -> None:
    pair = Pair(keyed=True)
    identity = bytes(range(24))
    pair.write(1, inline_qos=inline_qos(related=identity), instance=b"k" * 16)
    pair.run(SECOND)
    (sample,) = pair.got
    assert related_identity(sample.inline_qos) == identity
    assert key_hash(sample.inline_qos) == sample.instance == b"k" * 16


def test_a_reader_that_expects_it_gets_the_writers_qos_with_each_sample() -> None:
    pair = Pair({"strength": 7})
    curious = pair.right.reader(pair.listener, expects_inline_qos=True)
    pair.run(SECOND)
    pair.write(1, inline_qos=inline_qos(related=bytes(24)))
    pair.run(SECOND)
    for reader in (curious, pair.reader):
        (sample,) = pair.right.got[reader.guid]
        assert sample.inline_qos is not None
        assert sample.inline_qos.text(0x0005) == "rt/a"
        assert sample.inline_qos.unpack(0x0006, "i") == (7,)
        assert related_identity(sample.inline_qos) == bytes(24)


# --- One reader only ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [16, 200_000])
@pytest.mark.parametrize("reliability", [Reliability.RELIABLE, Reliability.BEST_EFFORT])
def test_a_sample_for_one_reader_reaches_no_other(size: int, reliability: Reliability) -> None:
    pair = Pair(depth=100, reliability=reliability)
    others = [pair.right.reader(pair.right.participant(), qos=pair.reader_qos) for _ in range(3)]
    pair.run(SECOND)
    readers = [pair.reader, *others]
    for number in range(8):
        pair.writer.write(payload(number, size), pair.now, to=readers[number % 4].guid)
        pair.run(20 * MS)
    pair.writer.write(payload(100, size), pair.now)
    pair.run(SECOND)
    for index, reader in enumerate(readers):
        got = [sample.payload for sample in pair.right.got[reader.guid]]
        assert got == [payload(index, size), payload(index + 4, size), payload(100, size)]
    assert pair.writer.acknowledged
    with pytest.raises(ValueError, match="not matched"):
        pair.writer.write(payload(1), pair.now, to=bytes(16))


@pytest.mark.parametrize("size", [16, 200_000])
def test_samples_for_one_reader_reach_it_and_no_other_when_many_are_lost(size: int) -> None:
    pair = Pair(history=History.KEEP_ALL, durability=Durability.TRANSIENT_LOCAL)
    others = [pair.right.reader(pair.right.participant(), qos=pair.reader_qos) for _ in range(2)]
    pair.run(SECOND)
    pair.world.network.loss = 0.3
    readers = [pair.reader, *others]
    for number in range(30):
        pair.writer.write(payload(number, size), pair.now, to=readers[number % 3].guid)
        pair.run(5 * MS)
    pair.run(20 * SECOND)
    for index, reader in enumerate(readers):
        got = [sample.payload for sample in pair.right.got[reader.guid]]
        assert got == [payload(number, size) for number in range(index, 30, 3)]
    assert pair.writer.acknowledged


# --- What users may do while they take a sample ------------------------------------------------------------


def test_a_sample_may_be_answered_and_everything_closed_while_it_is_taken() -> None:
    pair = Pair()
    process, made = pair.right, list[LocalReader]()
    echo = process.writer(pair.listener, "rt/echo")
    answers = pair.left.reader(pair.talker, "rt/echo")
    inner = process.reader(pair.listener, "rt/echo")

    def on_sample(sample: Received) -> None:
        echo.write(sample.payload, process.now)
        assert process.got[inner.guid] == []  # nothing happens within
        made[0].close(process.now)

    made.append(process.reader(pair.listener, on_sample=on_sample))
    pair.run(SECOND)
    pair.write(1)
    pair.write(2)
    pair.run(SECOND)
    assert [sample.payload for sample in pair.left.got[answers.guid]] == [payload(1)]
    assert [sample.payload for sample in process.got[inner.guid]] == [payload(1)]


def test_a_participant_may_be_closed_while_one_of_its_samples_is_taken() -> None:
    pair = Pair()
    taken = []

    def on_sample(sample: Received) -> None:
        taken.append(sample.payload)
        pair.listener.close(pair.right.now)

    for _ in range(3):
        pair.right.reader(pair.listener, on_sample=on_sample)
    pair.run(SECOND)
    pair.write(1)
    pair.run(SECOND)
    assert taken == [payload(1)]
    assert pair.talker.participants == ()
    assert pair.right.core.participants == ()
