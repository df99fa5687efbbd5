"""A writer alone, spoken to by hand: what it sends, to whom, and what it does not let itself be talked into."""

from __future__ import annotations

from typing import Any, TypeVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtps._endpoint import Place, Problem, first_count
from muros.rtps._events import AckNack, Data, DataFrag, Event, Gap, Heartbeat, NackFrag
from muros.rtps._settings import WriterSettings
from muros.rtps._values import Guid, GuidPrefix, guid_of
from muros.rtps._wire import info_dst, message, parse_untrusted
from muros.rtps._writer import WriterCore
from tests.rtps.nodes import MS, READER, SECOND, SMALL_WRITER, WRITER, payload

ME = b"w" * 12

HEADS = 400
"""Bytes that may stand in a datagram besides the payload of one fragment."""

E = TypeVar("E", bound=Event)


class Bench:
    """A writer whose readers are the test. `sent` keeps (place, event), oldest first."""

    def __init__(self, **options: Any) -> None:
        self.now = 1000 * SECOND
        self.sent: list[tuple[Place, Event]] = []
        self.datagrams = 0
        self.bytes = 0
        self.problems: list[tuple[Problem, Guid, int]] = []
        self.rooms = 0
        self.core = WriterCore(
            guid_of(ME, WRITER), self._send, report=self._report, on_room=self._room, **options
        )
        self.counts: dict[str, int] = {}

    def match(self, name: str = "r", **options: Any) -> None:
        options.setdefault("reliable", True)
        places = options.pop("places", [name])
        self.core.match(guid(name), places, self.now, **options)

    def acknack(
        self, base: int, missing: tuple[int, ...] = (), *, name: str = "r", final: bool = True
    ) -> None:
        count = self.counts[name] = self.counts.get(name, 0) + 1
        event = AckNack(prefix(name), ME, READER, WRITER, base, missing, count, final)
        self.core.on_acknack(event, self.now)

    def nack_frag(self, sequence: int, missing: tuple[int, ...], count: int = 1, *, name: str = "r") -> None:
        event = NackFrag(prefix(name), ME, READER, WRITER, sequence, missing[0], missing, count)
        self.core.on_nack_frag(event, self.now)

    def take(self, kind: type[E]) -> list[E]:
        """What was sent of this kind; everything is forgotten."""
        sent, self.sent = self.sent, []
        self.datagrams = self.bytes = 0
        return [event for _, event in sent if isinstance(event, kind)]

    def sent_data(self) -> list[Data]:
        """The samples among what was sent, which stays."""
        return [event for _, event in self.sent if isinstance(event, Data)]

    def wait(self, span: int) -> None:
        """Time passes; the writer does what it asked to do meanwhile."""
        end = self.now + span
        while (at := self.core.deadline) is not None and at <= end:
            self.now = max(self.now, at)
            self.core.tick(self.now)
        self.now = end

    def _send(self, submessages: list[bytes], destination: GuidPrefix | None, place: Place) -> None:
        head = [] if destination is None else [info_dst(destination)]
        datagram = message(ME, *head, *submessages)
        assert len(datagram) <= self.core.settings.fragment_size + HEADS
        self.datagrams += 1
        self.bytes += len(datagram)
        self.sent += [(place, event) for event in parse_untrusted(datagram).submessages]

    def _report(self, problem: Problem, peer: Guid, number: int) -> None:
        self.problems.append((problem, peer, number))

    def _room(self) -> None:
        self.rooms += 1


def prefix(name: str) -> bytes:
    return name.encode().ljust(12, b".")


def guid(name: str) -> bytes:
    return guid_of(prefix(name), READER)


class TestSending:
    def test_a_sample_goes_once_to_each_place_for_everybody_there(self) -> None:
        bench = Bench(reliable=False)
        bench.match("a", places=["x", "y"], reliable=False)
        bench.match("b", places=["y"], reliable=False)
        bench.core.write(payload(1), bench.now, 123 * SECOND)
        assert [place for place, _ in bench.sent] == ["x", "y"]
        for data in bench.take(Data):
            assert (data.reader, data.destination, data.writer, data.sequence) == (0, None, WRITER, 1)
            assert (data.payload, data.time, data.inline_qos, data.key) == (
                payload(1), 123 * SECOND, None, False,
            )  # fmt: skip

    def test_nobody_hears_and_nothing_is_sent_or_kept(self) -> None:
        bench = Bench(depth=None)
        assert [bench.core.write(payload(n, 100_000), bench.now) for n in range(3)] == [1, 2, 3]
        assert (bench.sent, bench.core.held, bench.core.deadline) == ([], 0, None)

    def test_numbers_go_on_from_an_earlier_life(self) -> None:
        bench = Bench(last=41)
        bench.match()
        assert bench.take(Heartbeat)[0][4:6] == (42, 41)
        assert bench.core.write(payload(0), bench.now) == 42

    def test_readers_that_expect_inline_qos_get_the_endpoints_with_the_samples_own(self) -> None:
        topic = bytes.fromhex("05000800 02000000 74000000 01000000".replace(" ", ""))
        own = bytes.fromhex("83000400 aabbccdd 01000000".replace(" ", ""))
        bench = Bench(endpoint_qos=topic)
        bench.match("a")
        bench.core.write(payload(1), bench.now, None, own)
        bench.match("b", expects_inline_qos=True)
        bench.core.write(payload(2), bench.now, None, own)
        bench.core.write(payload(3), bench.now)
        bench.core.unmatch(guid("b"), bench.now)
        bench.core.write(payload(4), bench.now)
        seen = {data.sequence: data.inline_qos for data in bench.take(Data)}
        assert [sorted(qos or ()) for qos in seen.values()] == [[0x83], [5, 0x83], [5], []]

    def test_a_key_alone_is_sent_as_one(self) -> None:
        bench = Bench()
        bench.match()
        bench.core.write(payload(1), bench.now, key=True)
        assert bench.take(Data)[0].key

    def test_bad_times_and_qos_are_the_callers_fault_and_change_nothing(self) -> None:
        bench = Bench(depth=None)
        bench.match()
        with pytest.raises(ValueError, match="RTPS time"):
            bench.core.write(payload(1), bench.now, -1)
        with pytest.raises(ValueError, match="inline QoS"):
            bench.core.write(payload(1, 70_000), bench.now, None, bytes(1000))
        assert (bench.core.last, bench.core.held) == (0, 0)

    def test_fragments_have_the_size_asked_for_and_all_carry_the_inline_qos(self) -> None:
        own = bytes.fromhex("83000400 aabbccdd 01000000".replace(" ", ""))
        bench = Bench(settings=SMALL_WRITER)
        bench.match()
        bench.core.write(payload(1, 500), bench.now, 5 * SECOND, own)
        fragments = bench.take(DataFrag)
        assert [(f.first_fragment, f.fragments_in, len(f.payload)) for f in fragments] == [
            (1, 1, 200), (2, 1, 200), (3, 1, 100),
        ]  # fmt: skip
        assert b"".join(f.payload for f in fragments) == payload(1, 500)
        assert all(
            f.time == 5 * SECOND and f.inline_qos is not None and 0x83 in f.inline_qos for f in fragments
        )

    def test_a_writer_quicker_than_its_allowance_still_finishes_samples(self) -> None:
        bench = Bench(settings=WriterSettings(fragment_size=100, burst=300))
        bench.match()
        for _ in range(20):
            bench.core.write(payload(1, 1000), bench.now)
            bench.wait(MS)
        done = [f.sequence for f in bench.take(DataFrag) if f.first_fragment == 10]
        assert len(done) >= 5
        assert done == sorted(done)

    @pytest.mark.parametrize(
        "wrong",
        [{"limit": 0}, {"fragment_size": 0}, {"fragment_size": 65001}, {"pace": 0}, {"hold_off": -1}],
    )
    def test_settings_out_of_range_are_refused(self, wrong: dict[str, int]) -> None:
        with pytest.raises(ValueError, match="must"):
            WriterSettings(**wrong)  # type: ignore[arg-type]


class TestAsking:
    def test_the_first_sample_after_a_rest_asks_for_acknowledgement(self) -> None:
        bench = Bench(depth=None)
        bench.match()
        bench.take(Heartbeat)
        bench.core.write(payload(1), bench.now)
        (beat,) = bench.take(Heartbeat)
        assert (beat.first, beat.last, beat.final, beat.reader) == (1, 1, False, 0)
        bench.core.write(payload(2), bench.now)
        assert bench.take(Heartbeat) == []

    def test_many_samples_are_asked_after_while_they_flow(self) -> None:
        bench = Bench(depth=None)
        bench.match()
        bench.take(Heartbeat)
        for number in range(200):
            bench.core.write(payload(number), bench.now)
        assert [beat.last for beat in bench.take(Heartbeat)] == [1, *range(65, 200, 64)]

    def test_only_lagging_readers_are_asked_by_the_clock(self) -> None:
        bench = Bench(depth=None)
        for name in "abc":
            bench.match(name)
        bench.core.write(payload(1), bench.now)
        bench.acknack(2, name="b")
        bench.take(Heartbeat)
        bench.wait(25 * MS)
        assert [place for place, _ in bench.sent] == ["a", "c"]
        assert {beat.destination for beat in bench.take(Heartbeat)} == {prefix("a"), prefix("c")}

    def test_lagging_readers_of_one_participant_are_asked_together(self) -> None:
        bench = Bench(depth=None)
        for entity in (0x104, 0x204, 0x304):
            bench.core.match(guid_of(prefix("a"), entity), ["a"], bench.now, reliable=True)
        bench.core.write(payload(1), bench.now)
        bench.take(Heartbeat)
        bench.wait(25 * MS)
        (beat,) = bench.take(Heartbeat)
        assert (beat.reader, beat.destination) == (0, prefix("a"))

    def test_heartbeats_of_a_volatile_late_reader_begin_with_what_is_meant_for_it(self) -> None:
        bench = Bench(depth=None)
        bench.match("a")
        for number in range(5):
            bench.core.write(payload(number), bench.now)
        bench.take(Heartbeat)
        bench.match("b")
        (beat,) = bench.take(Heartbeat)
        assert (beat.first, beat.last, beat.final, beat.destination) == (6, 5, True, prefix("b"))

    def test_counts_rise(self) -> None:
        bench = Bench(depth=None)
        bench.match()
        bench.core.write(payload(1), bench.now)
        bench.wait(SECOND)
        counts = [beat.count for beat in bench.take(Heartbeat)]
        first = first_count(bench.now - SECOND) + 1
        assert counts == list(range(first, first + len(counts)))
        assert len(counts) > 5

    def test_liveliness_is_asserted_with_a_final_heartbeat(self) -> None:
        bench = Bench()
        bench.match()
        bench.take(Heartbeat)
        bench.core.assert_liveliness(bench.now)
        (beat,) = bench.take(Heartbeat)
        assert (beat.liveliness, beat.final, beat.first, beat.last) == (True, True, 1, 0)


class TestAnswering:
    def written(self, count: int = 5, **options: Any) -> Bench:
        bench = Bench(**({"depth": None} | options))
        bench.match()
        for number in range(1, count + 1):
            bench.core.write(payload(number), bench.now)
        bench.take(Data)
        return bench

    def test_what_is_missing_is_sent_again_to_that_reader_in_one_datagram(self) -> None:
        bench = self.written()
        bench.match("other")
        bench.take(Data)
        bench.acknack(2, (2, 4, 5))
        assert bench.datagrams == 1
        places = {place for place, _ in bench.sent}
        events = [event for _, event in bench.sent]
        data = bench.take(Data)
        assert places == {"r"}
        assert [(d.sequence, d.reader, d.destination) for d in data] == [
            (n, READER, prefix("r")) for n in (2, 4, 5)
        ]
        assert isinstance(events[-1], Heartbeat)
        assert not events[-1].final

    def test_what_was_just_sent_again_is_not_sent_once_more(self) -> None:
        bench = self.written()
        bench.acknack(2, (2,))
        assert len(bench.take(Data)) == 1
        bench.acknack(2, (2, 3))
        assert [data.sequence for data in bench.take(Data)] == [3]
        bench.now += 11 * MS
        bench.acknack(2, (2, 3))
        assert [data.sequence for data in bench.take(Data)] == [2, 3]

    def test_old_and_doubled_acknacks_are_ignored(self) -> None:
        bench = self.written()
        bench.acknack(4, ())
        bench.counts["r"] = 0
        bench.acknack(2, (2, 3))
        assert bench.take(Data) == []
        assert bench.core.acknowledged == 3

    def test_an_acknowledgement_is_not_taken_back(self) -> None:
        bench = self.written()
        bench.acknack(6)
        bench.acknack(2, (2, 3))
        assert bench.core.acknowledged == 5
        assert bench.core.held == 0
        (gap,) = bench.take(Gap)
        assert (gap.start, gap.base, gap.numbers) == (2, 6, ())

    def test_what_was_never_sent_can_not_be_acknowledged_or_wanted(self) -> None:
        bench = self.written()
        bench.acknack(1000, tuple(range(1000, 1256)))
        assert bench.core.acknowledged == 5
        assert bench.sent == []

    def test_what_is_gone_is_a_gap(self) -> None:
        bench = self.written(20, depth=3)
        bench.acknack(1, tuple(range(1, 21)))
        events = [event for _, event in bench.sent]
        assert [type(event) for event in events] == [Gap, Data, Data, Data, Heartbeat]
        assert isinstance(events[0], Gap)
        assert (events[0].start, events[0].base, events[0].numbers) == (1, 18, ())
        assert [event.sequence for event in events if isinstance(event, Data)] == [18, 19, 20]

    def test_holes_between_kept_samples_are_gaps_too(self) -> None:
        bench = Bench(depth=1)
        bench.match()
        kept = {1: b"a", 5: b"b", 300: b"c", 301: b"d"}
        for number in range(1, 303):
            bench.core.write(payload(number), bench.now, instance=kept.get(number, b"z"))
        bench.take(Data)
        bench.acknack(1, tuple(range(1, 257)))
        assert [data.sequence for data in bench.sent_data()] == [1, 5]
        gone = set[int]()
        for gap in bench.take(Gap):
            gone |= {*range(gap.start, gap.base), *gap.numbers}
        assert gone == {*range(2, 257)} - {5}

    def test_a_volatile_reader_is_not_given_what_was_before_it(self) -> None:
        bench = self.written()
        bench.match("late")
        bench.core.write(payload(6), bench.now)
        bench.take(Data)
        bench.acknack(1, (1, 2, 3, 4, 5, 6), name="late")
        assert [data.sequence for data in bench.sent_data()] == [6]
        (gap,) = bench.take(Gap)
        assert (gap.start, gap.base, gap.numbers) == (1, 6, ())

    @pytest.mark.parametrize("base", [0, 1])
    def test_a_reader_that_says_hello_gets_a_heartbeat(self, base: int) -> None:
        bench = Bench(transient_local=True, depth=10)
        for number in range(3):
            bench.core.write(payload(number), bench.now)
        bench.match(transient_local=True)
        bench.take(Heartbeat)
        bench.acknack(base, final=False)
        (beat,) = bench.take(Heartbeat)
        assert (beat.first, beat.last, beat.final) == (1, 3, False)

    def test_two_sides_that_ask_each_other_come_to_rest(self) -> None:
        bench = self.written()
        # A reader that answers every heartbeat, never with news, and always asks back.
        for _ in range(50):
            bench.acknack(3, (), final=False)
        beats = bench.take(Heartbeat)
        assert [beat.final for beat in beats] == [False, *[True] * 49]

    def test_a_reader_that_wants_the_same_for_ever_gets_it_at_a_bounded_rate(self) -> None:
        bench = self.written(256)
        end = bench.now + SECOND
        while bench.now < end:
            bench.acknack(1, tuple(range(1, 257)), final=False)
            bench.wait(MS // 10)
        assert len(bench.take(Data)) <= 256 * 101

    def test_repairs_leave_in_bursts(self) -> None:
        bench = Bench(depth=None, settings=WriterSettings(burst=10_000, fragment_size=1500))
        bench.match()
        for number in range(100):
            bench.core.write(payload(number, 1000), bench.now)
        bench.take(Data)
        bench.acknack(1, tuple(range(1, 101)))
        assert 9_000 < bench.bytes < 13_000
        assert bench.take(Heartbeat) == []
        bench.wait(20 * MS)
        assert len(bench.take(Data)) == 90

    def test_small_repairs_share_datagrams_that_are_not_too_large(self) -> None:
        bench = Bench(depth=None, settings=WriterSettings(fragment_size=1500))
        bench.match()
        for number in range(100):
            bench.core.write(payload(number, 100), bench.now)
        bench.take(Data)
        bench.acknack(1, tuple(range(1, 101)))
        assert bench.datagrams == 10  # nine or ten of 136 bytes, their time stamps included, in each

    def test_what_is_acknowledged_meanwhile_is_not_repaired(self) -> None:
        bench = Bench(
            transient_local=True, depth=None, settings=WriterSettings(burst=2000, fragment_size=1500)
        )
        bench.match()
        for number in range(10):
            bench.core.write(payload(number, 1000), bench.now)
        bench.take(Data)
        bench.acknack(1, tuple(range(1, 11)))
        assert [data.sequence for data in bench.take(Data)] == [1, 2]
        bench.acknack(10, (10,))
        bench.wait(10 * MS)
        assert [data.sequence for data in bench.take(Data)] == [10]

    def test_a_large_repair_leaves_piece_by_piece(self) -> None:
        bench = Bench(depth=None, settings=WriterSettings(burst=1000, fragment_size=200))
        bench.match()
        bench.core.write(payload(1, 5000), bench.now)
        bench.core.write(payload(2), bench.now)
        bench.wait(15 * MS)
        bench.take(Data)
        bench.acknack(1, (1, 2))
        assert [fragment.first_fragment for fragment in bench.take(DataFrag)] == [1, 2, 3, 4, 5]
        bench.acknack(1, (1, 2))  # asked for again while the rest waits
        bench.wait(6 * MS)
        events = [event for _, event in bench.sent if not isinstance(event, Heartbeat)]
        assert [e.first_fragment for e in events if isinstance(e, DataFrag)] == list(range(6, 26))
        assert isinstance(events[-1], Data)

    def test_a_fragment_that_is_missing_is_sent_again_alone(self) -> None:
        bench = self.written(1, settings=SMALL_WRITER)
        bench.core.write(payload(2, 1000), bench.now)
        bench.take(Data)
        bench.nack_frag(2, (2, 5, 6))
        events = [event for _, event in bench.sent]
        assert [type(event) for event in events] == [DataFrag, DataFrag, Heartbeat]
        assert [event.first_fragment for event in bench.take(DataFrag)] == [2, 5]
        bench.nack_frag(2, (1,), count=1)
        assert bench.sent == []
        bench.nack_frag(2, (9,), count=2)
        bench.nack_frag(99, (1,), count=3)
        assert bench.sent == []

    def test_fragments_of_what_is_gone_are_a_gap(self) -> None:
        bench = Bench(depth=1, settings=SMALL_WRITER)
        bench.match()
        for number in range(3):
            bench.core.write(payload(number, 1000), bench.now)
        bench.take(Data)
        bench.nack_frag(2, (1, 2))
        (gap,) = bench.take(Gap)
        assert (gap.start, gap.base, gap.numbers) == (2, 3, ())

    def test_strangers_and_best_effort_readers_are_not_answered(self) -> None:
        bench = self.written()
        bench.match("best", reliable=False)
        bench.take(Data)
        for name in ("stranger", "best"):
            bench.acknack(1, (1, 2), name=name, final=False)
            bench.nack_frag(1, (1,), name=name)
        assert bench.sent == []
        bench.core.unmatch(guid("stranger"), bench.now)


class TestKeeping:
    def test_a_sample_dies_with_its_lifespan(self) -> None:
        bench = Bench(transient_local=True, depth=10, lifespan=100 * MS)
        for number in range(4):
            bench.core.write(payload(number), bench.now)
            bench.wait(40 * MS)
        assert bench.core.held == 2
        bench.match(transient_local=True)
        assert bench.take(Heartbeat)[0][4:6] == (3, 4)
        bench.wait(SECOND)
        assert bench.core.held == 0
        bench.take(Data)
        bench.acknack(3, (3, 4))
        assert bench.take(Gap)[0][4:6] == (3, 5)
        bench.acknack(5)
        bench.wait(SECOND)
        assert bench.core.deadline is None

    def test_an_ended_instance_is_kept_until_all_readers_know(self) -> None:
        bench = Bench(transient_local=True, depth=1)
        bench.match(transient_local=True)
        for name in (b"a", b"b"):
            bench.core.write(payload(1), bench.now, instance=name)
        bench.acknack(3)
        bench.core.write(payload(1), bench.now, instance=b"a", key=True, last=True)
        assert bench.core.held == 2
        bench.acknack(4)
        assert bench.core.held == 1
        bench.core.unmatch(guid("r"), bench.now)
        bench.core.write(payload(1), bench.now, instance=b"b", key=True, last=True)
        assert bench.core.held == 0

    def test_a_transient_local_writer_that_keeps_all_makes_room_from_what_all_have(self) -> None:
        bench = Bench(transient_local=True, depth=None, settings=WriterSettings(limit=3))
        for number in range(1, 6):
            assert bench.core.write(payload(number), bench.now) == number
        assert bench.core.held == 3
        bench.match(transient_local=True)
        assert bench.core.write(payload(6), bench.now) is None
        bench.acknack(4)
        assert bench.rooms == 1
        assert bench.core.write(payload(6), bench.now) == 6

    def test_patience_ends_without_another_write(self) -> None:
        bench = Bench(depth=None, settings=WriterSettings(limit=2, patience=SECOND))
        bench.match()
        for number in range(3):
            bench.core.write(payload(number), bench.now)
        bench.wait(SECOND - 1)
        assert (bench.rooms, bench.problems) == (0, [])
        bench.wait(2)
        assert (bench.rooms, bench.problems) == (1, [(Problem.READER_STALLED, guid("r"), 2)])
        assert bench.core.held == 0
        # It returns, and holds the writer again as if nothing had been.
        bench.acknack(3)
        assert bench.problems[1:] == [(Problem.READER_RETURNED, guid("r"), 2)]
        for number in range(3):
            bench.core.write(payload(number), bench.now)
        assert bench.core.held == 2
        bench.acknack(4)
        assert len(bench.problems) == 2
        assert bench.core.held == 1


def _numbers(most: int = 40) -> st.SearchStrategy[int]:
    return st.one_of(st.integers(0, most), st.integers(0, 2**63 - 1))


def _sets() -> st.SearchStrategy[tuple[int, tuple[int, ...]]]:
    steps = st.lists(st.integers(0, 255), max_size=8, unique=True)
    return st.builds(
        lambda base, offsets: (base, tuple(base + offset for offset in sorted(offsets))), _numbers(), steps
    )


_COUNTS = st.one_of(st.integers(0, 20), st.integers(0, 2**32 - 1))


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("ack"), _sets(), _COUNTS, st.booleans()),
            st.tuples(st.just("frag"), _sets(), _COUNTS, _numbers()),
            st.tuples(st.just("write"), st.sampled_from([8, 500])),
            st.tuples(st.just("wait"), st.integers(0, 30 * MS)),
        ),
        max_size=40,
    ),
    st.sampled_from([1, 3, None]),
    st.booleans(),
)
def test_no_reader_can_upset_a_writer(steps: list[Any], depth: int | None, retains: bool) -> None:
    settings = WriterSettings(limit=10, fragment_size=200, burst=1000)
    bench = Bench(depth=depth, transient_local=retains, settings=settings)
    bench.match()
    bench.match("good")
    for step in steps:
        bench.bytes = 0
        if step[0] == "ack":
            _, (base, missing), count, final = step
            bench.core.on_acknack(
                AckNack(prefix("r"), ME, READER, WRITER, base, missing, count, final), bench.now
            )
        elif step[0] == "frag":
            _, (base, missing), count, sequence = step
            bench.core.on_nack_frag(
                NackFrag(prefix("r"), ME, READER, WRITER, sequence, base, missing, count), bench.now
            )
        elif step[0] == "write":
            bench.core.write(payload(1, step[1]), bench.now)
        else:
            bench.wait(step[1])
            continue
        # Nothing makes it send more than its allowance, beside the sample written and small answers.
        assert bench.bytes < 1000 + 1000
        assert bench.core.held <= (10 if depth is None else depth)
        assert bench.core.acknowledged <= bench.core.sent <= bench.core.last
    # Others are served as ever.
    bench.wait(SECOND)
    bench.core.unmatch(guid("r"), bench.now)
    bench.acknack(bench.core.last + 1, name="good")
    assert bench.core.acknowledged == bench.core.last
    assert bench.core.write(payload(7), bench.now) == bench.core.last
    bench.acknack(bench.core.last + 1, name="good")
    bench.wait(SECOND)
    assert bench.core.deadline is None
    assert retains or bench.core.held == 0
