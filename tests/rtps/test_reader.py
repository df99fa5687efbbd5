"""A reader alone, spoken to by hand: what it delivers, what it asks for, and how little it can be made to hold."""

from __future__ import annotations

import tracemalloc
from typing import Any, TypeVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtps._endpoint import MILLISECOND, Place, Problem, first_count
from muros.rtps._events import AckNack, Data, DataFrag, Event, Gap, Heartbeat, HeartbeatFrag, NackFrag
from muros.rtps._reader import ReaderCore
from muros.rtps._settings import ReaderSettings
from muros.rtps._values import Guid, GuidPrefix, guid_of
from muros.rtps._wire import info_dst, message, parse_untrusted
from tests.rtps.nodes import MS, READER, SECOND, WRITER, payload, tell

ME = b"r" * 12
THEM = b"w" * 12
E = TypeVar("E", bound=Event)


class Bench:
    """A reader whose writers are the test. `got` keeps the sequence numbers delivered."""

    def __init__(self, *, matched: bool = True, reliable: bool = True, **options: Any) -> None:
        self.now = 1000 * SECOND
        self.sent: list[Event] = []
        self.places: list[Place] = []
        self.got: list[int] = []
        self.samples: list[Data] = []
        self.problems: list[tuple[Problem, int]] = []
        self.refuses = False
        self.core = ReaderCore(
            guid_of(ME, READER),
            self._send,
            self._deliver,
            reliable=reliable,
            settings=ReaderSettings(**options),
            report=self._report,
        )
        self.counts: dict[bytes, int] = {}
        if matched:
            self.match()
            self.sent.clear()

    def match(self, writer: bytes = THEM, **options: Any) -> None:
        options.setdefault("reliable", True)
        self.core.match_writer(guid_of(writer, WRITER), [writer[:1].decode()], self.now, **options)

    def data(self, *numbers: int, writer: bytes = THEM, size: int = 16) -> None:
        for number in numbers:
            event = Data(writer, None, 5, 0, WRITER, number, payload(number, size), None, False)
            self.core.on_data(event, self.now)

    def fragments(self, number: int, *fragments: int, size: int = 1000, of: int = 100) -> None:
        whole = payload(number, size)
        for first in fragments:
            part = whole[(first - 1) * of : first * of]
            event = DataFrag(THEM, None, 5, 0, WRITER, number, first, 1, of, size, part, None, False)
            self.core.on_data_frag(event, self.now)

    def beat(self, first: int, last: int, *, final: bool = True, writer: bytes = THEM) -> None:
        count = self.counts[writer] = self.counts.get(writer, 0) + 1
        self.core.on_heartbeat(Heartbeat(writer, None, 0, WRITER, first, last, count, final, False), self.now)

    def gap(self, start: int, base: int, *numbers: int) -> None:
        self.core.on_gap(Gap(THEM, None, READER, WRITER, start, base, numbers), self.now)

    def take(self, kind: type[E]) -> list[E]:
        """What was sent of this kind; everything is forgotten."""
        sent, self.sent = self.sent, []
        return [event for event in sent if isinstance(event, kind)]

    def wait(self, span: int) -> None:
        """Time passes; the reader does what it asked to do meanwhile."""
        end = self.now + span
        while (at := self.core.deadline) is not None and at <= end:
            self.now = max(self.now, at)
            self.core.tick(self.now)
        self.now = end

    def at_rest(self) -> bool:
        """It holds nothing."""
        return all(
            proxy.held == 0 and not (proxy.pending or proxy.irrelevant or proxy.assemblies)
            for proxy in self.core.writers
        )

    def _send(self, submessages: list[bytes], destination: GuidPrefix | None, place: Place) -> None:
        assert destination is not None
        self.places.append(place)
        self.sent += parse_untrusted(message(ME, info_dst(destination), *submessages)).submessages

    def _deliver(self, writer: Guid, sample: Data) -> bool:
        if self.refuses:
            return False
        self.got.append(sample.sequence)
        self.samples.append(sample)
        return True

    def _report(self, problem: Problem, peer: Guid, number: int) -> None:
        self.problems.append((problem, number))


class TestOrder:
    def test_what_comes_early_waits_for_what_is_before_it(self) -> None:
        bench = Bench()
        bench.data(1, 3, 4, 3, 1)
        assert bench.got == [1]
        bench.data(2)
        assert bench.got == [1, 2, 3, 4]
        bench.data(2, 4, 5)
        assert bench.got == [1, 2, 3, 4, 5]
        assert bench.at_rest()

    def test_writers_do_not_wait_for_each_other(self) -> None:
        bench = Bench()
        bench.match(b"x" * 12)
        bench.data(2)
        bench.data(1, writer=b"x" * 12)
        assert bench.got == [1]
        bench.data(1)
        assert bench.got == [1, 1, 2]

    def test_strangers_are_not_heard(self) -> None:
        bench = Bench()
        bench.data(1, writer=b"x" * 12)
        bench.beat(1, 1, final=False, writer=b"x" * 12)
        assert (bench.got, bench.sent) == ([], [])

    def test_a_writer_that_left_is_not_heard_and_what_waited_is_lost(self) -> None:
        bench = Bench()
        bench.data(2, 3)
        bench.core.unmatch_writer(guid_of(THEM, WRITER))
        bench.data(1)
        assert bench.got == []
        assert bench.core.held == 0
        assert bench.problems == [(Problem.SAMPLES_LOST, 2)]
        bench.core.unmatch_writer(guid_of(THEM, WRITER))

    def test_a_gap_is_not_waited_for(self) -> None:
        bench = Bench()
        bench.data(4, 6, 9)
        bench.gap(1, 4)
        assert bench.got == [4]
        bench.gap(5, 6, 7, 8)
        assert bench.got == [4, 6, 9]
        assert bench.at_rest()
        assert bench.problems == []

    def test_a_gap_does_not_take_away_what_is_there(self) -> None:
        bench = Bench()
        bench.data(2, 4, 7)
        bench.gap(1, 4, 4, 5)
        assert bench.got == [2, 4]
        assert bench.core.writers[0].irrelevant == set()
        bench.data(6)
        assert bench.got == [2, 4, 6, 7]
        assert bench.at_rest()

    def test_a_gap_may_be_huge(self) -> None:
        bench = Bench()
        bench.gap(1, 2**62)
        bench.data(2**62)
        assert bench.got == [2**62]
        assert bench.at_rest()

    def test_a_huge_gap_further_on_is_remembered_within_the_window(self) -> None:
        bench = Bench(window=100)
        bench.gap(3, 2**62)
        assert len(bench.core.writers[0].irrelevant) == 98
        bench.data(1, 2)
        bench.beat(1, 2**62)
        assert bench.take(AckNack)[0].base == 101

    def test_what_the_writer_no_longer_has_is_lost(self) -> None:
        bench = Bench()
        bench.beat(1, 1)
        bench.data(1, 4, 6)
        bench.gap(7, 8)
        bench.beat(9, 9)
        assert bench.got == [1, 4, 6]
        assert bench.problems == [(Problem.SAMPLES_LOST, 4)]  # 2, 3, 5 and 8; nobody misses 7
        bench.data(9)
        assert bench.got[-1] == 9
        bench.gap(12, 14)
        bench.beat(15, 15)
        assert bench.problems[1:] == [(Problem.SAMPLES_LOST, 3)]  # 10, 11 and 14
        bench.data(15)
        assert bench.at_rest()

    def test_what_was_gone_before_the_reader_came_is_not_lost(self) -> None:
        bench = Bench()
        bench.beat(10**12, 10**12 + 3)
        assert bench.problems == []
        assert bench.take(AckNack)[0].base == 10**12

    def test_a_heartbeat_that_jumps_far_is_taken_in_one_step(self) -> None:
        bench = Bench()
        bench.beat(1, 1)
        bench.data(3)
        bench.beat(2**62, 2**62 - 1)
        assert bench.got == [3]
        assert bench.problems == [(Problem.SAMPLES_LOST, 2**62 - 2)]

    def test_best_effort_takes_only_what_is_newer(self) -> None:
        bench = Bench(reliable=False)
        bench.data(5, 3, 5, 9, 7, 10)
        assert bench.got == [5, 9, 10]
        bench.beat(1, 100, final=False)
        bench.gap(1, 50)
        assert bench.sent == []

    def test_a_refused_best_effort_sample_is_lost(self) -> None:
        bench = Bench(reliable=False)
        bench.refuses = True
        bench.data(1)
        bench.refuses = False
        bench.data(2)
        assert bench.got == [2]
        assert bench.problems == [(Problem.SAMPLES_LOST, 1)]


class TestAsking:
    def test_a_new_writer_is_told_that_somebody_is_here_until_it_speaks(self) -> None:
        bench = Bench(matched=False, hellos=5)
        bench.match()
        bench.wait(250 * MS)
        hellos = bench.take(AckNack)
        assert [(ack.base, ack.missing, ack.final) for ack in hellos] == [(1, (), False)] * 2
        first = first_count(bench.now - 250 * MS)  # above those of an earlier life
        assert [ack.count for ack in hellos] == [first + 1, first + 2]
        bench.beat(1, 0)
        bench.wait(60 * SECOND)
        assert bench.sent == []
        assert bench.core.deadline is None

    def test_a_writer_that_wants_a_hello_from_0_gets_one(self) -> None:
        bench = Bench(matched=False)
        bench.match(hello_base=0)
        bench.wait(150 * MS)
        assert [(ack.base, ack.missing, ack.final) for ack in bench.take(AckNack)] == [(0, (), False)] * 2
        bench.beat(7, 7, final=False)
        (ack,) = bench.take(AckNack)
        assert (ack.base, ack.missing) == (7, (7,))

    def test_a_best_effort_writer_is_told_nothing(self) -> None:
        bench = Bench(matched=False)
        bench.match(reliable=False)
        assert (bench.sent, bench.core.deadline) == ([], None)

    def test_what_is_missing_is_asked_for(self) -> None:
        bench = Bench()
        bench.data(1, 3, 5)
        bench.gap(6, 7)
        bench.beat(1, 8)
        (ack,) = bench.take(AckNack)
        assert (ack.base, ack.missing, ack.final, ack.destination) == (2, (2, 4, 7, 8), False, THEM)
        assert (ack.reader, ack.writer) == (READER, WRITER)

    def test_when_nothing_is_missing_only_a_question_is_answered(self) -> None:
        bench = Bench()
        bench.data(1, 2)
        bench.beat(1, 2)
        assert bench.sent == []
        bench.beat(1, 2, final=False)
        (ack,) = bench.take(AckNack)
        assert (ack.base, ack.missing, ack.final) == (3, (), True)

    def test_doubled_and_old_heartbeats_are_not_answered(self) -> None:
        bench = Bench()
        for count in (5, 5, 4, 2**31 + 5, 6):
            event = Heartbeat(THEM, None, 0, WRITER, 1, 0, count, False, False)
            bench.core.on_heartbeat(event, bench.now)
        assert len(bench.take(AckNack)) == 2

    def test_at_most_a_set_is_asked_for(self) -> None:
        bench = Bench()
        bench.beat(1, 2**62)
        assert bench.take(AckNack)[0].missing == tuple(range(1, 257))
        small = Bench(window=10)
        small.beat(1, 2**62)
        assert small.take(AckNack)[0].missing == tuple(range(1, 11))

    def test_the_same_is_not_asked_for_twice_in_a_row(self) -> None:
        bench = Bench()
        bench.data(2)
        for _ in range(20):
            bench.beat(1, 3)
        assert [ack.missing for ack in bench.take(AckNack)] == [(1, 3)]
        bench.wait(11 * MS)
        assert [ack.missing for ack in bench.take(AckNack)] == [(1, 3)]
        bench.data(3)  # something asked for has come: no need to wait
        bench.beat(1, 4)
        assert [ack.missing for ack in bench.take(AckNack)] == [(1, 4)]
        bench.data(1)
        bench.beat(1, 6)
        assert [ack.missing for ack in bench.take(AckNack)] == [(4, 5, 6)]
        bench.data(4)
        bench.beat(1, 6)
        assert [ack.missing for ack in bench.take(AckNack)] == [(5, 6)]
        bench.fragments(5, 1)
        bench.beat(1, 6)
        assert [ack.missing for ack in bench.take(AckNack)] == [(6,)]
        bench.gap(5, 6)
        bench.beat(1, 6)
        assert [ack.missing for ack in bench.take(AckNack)] == [(6,)]

    def test_a_writer_that_left_is_asked_nothing(self) -> None:
        bench = Bench(matched=False, response_delay=MS)
        bench.match()
        bench.beat(1, 5)
        bench.match(b"x" * 12)
        bench.sent.clear()
        for writer in (THEM, b"x" * 12):
            bench.core.unmatch_writer(guid_of(writer, WRITER))
        bench.wait(60 * SECOND)
        assert bench.sent == []

    def test_answers_wait_for_the_response_delay(self) -> None:
        bench = Bench(response_delay=5 * MS)
        bench.beat(1, 2)
        bench.data(1)
        bench.beat(1, 3)
        assert bench.sent == []
        bench.wait(5 * MS)
        (ack,) = bench.take(AckNack)
        assert (ack.base, ack.missing) == (2, (2, 3))
        bench.data(2, 3)
        bench.wait(SECOND)
        assert bench.sent == []
        assert bench.core.deadline is None

    def test_what_was_overtaken_is_asked_for_without_a_heartbeat(self) -> None:
        bench = Bench()
        bench.beat(1, 0)
        bench.data(1, 3, 5)
        bench.wait(9 * MS)
        assert bench.sent == []
        bench.data(4)
        bench.wait(MS)
        assert [ack.missing for ack in bench.take(AckNack)] == [(2,)]

    def test_what_was_only_late_is_not_asked_for(self) -> None:
        bench = Bench()
        bench.beat(1, 0)
        bench.data(2)
        bench.wait(9 * MS)
        bench.data(1)
        bench.wait(SECOND)
        assert bench.sent == []
        assert bench.core.deadline is None

    def test_what_does_not_come_is_asked_for_less_and_less_and_then_no_more(self) -> None:
        bench = Bench()
        bench.beat(1, 0)
        bench.data(2)
        times = []
        for _ in range(5000):
            bench.wait(10 * MS)
            bench.data(bench.core.writers[0].last + 1)
            if bench.take(AckNack):
                times.append((bench.now - 1000 * SECOND) // MS)
        assert times[:6] == [10, 30, 70, 150, 310, 630]
        assert len(times) == 17
        assert times[-1] - times[-2] == 1000
        bench.beat(1, 9)  # a heartbeat still has its answer
        assert [ack.missing for ack in bench.take(AckNack)] == [(1,)]

    def test_all_places_of_a_writer_are_told(self) -> None:
        bench = Bench()
        writer = guid_of(THEM, WRITER)
        bench.core.match_writer(writer, ["a", "b"], bench.now, reliable=True)
        bench.places.clear()
        bench.beat(1, 1)
        assert bench.places == ["a", "b"]


class TestFragments:
    def test_fragments_make_a_sample_in_its_place(self) -> None:
        bench = Bench()
        bench.fragments(1, *range(10, 0, -1))
        bench.fragments(3, *range(1, 11))
        bench.data(2)
        assert bench.got == [1, 2, 3]
        assert [len(sample.payload) for sample in bench.samples] == [1000, 16, 1000]
        assert bench.samples[0].payload == payload(1, 1000)
        assert bench.at_rest()

    def test_fragments_of_what_was_delivered_are_ignored(self) -> None:
        bench = Bench()
        bench.data(1)
        bench.fragments(1, 1, 2, 3)
        bench.data(3)
        bench.fragments(3, 1, 2, 3)
        assert not bench.core.writers[0].assemblies

    def test_missing_fragments_are_asked_for_by_number(self) -> None:
        bench = Bench()
        bench.fragments(2, 1, 2, 4)
        bench.beat(1, 3)
        ack, nack = bench.sent
        assert isinstance(ack, AckNack)
        assert isinstance(nack, NackFrag)
        assert (ack.base, ack.missing, ack.final) == (1, (1, 3), False)
        assert (nack.sequence, nack.missing) == (2, (3, 5, 6, 7, 8, 9, 10))

    def test_fragments_are_asked_for_when_they_have_stopped_coming(self) -> None:
        bench = Bench()
        bench.beat(1, 0)
        for fragment in range(1, 9):
            bench.fragments(1, fragment)
            bench.wait(8 * MS)
            assert bench.sent == []
        bench.wait(3 * MS)
        assert [nack.missing for nack in bench.take(NackFrag)] == [(9, 10)]
        bench.fragments(1, 9, 10)
        bench.wait(SECOND)
        assert bench.sent == []

    def test_fragments_are_asked_for_when_they_were_overtaken(self) -> None:
        bench = Bench()
        bench.fragments(1, 1, 2, 3)
        for fragment in range(1, 4):
            bench.wait(4 * MS)
            bench.fragments(2, fragment)
        ack, nack = bench.sent
        assert isinstance(ack, AckNack)
        assert isinstance(nack, NackFrag)
        assert (ack.base, ack.missing, nack.sequence) == (1, (), 1)

    def test_a_heartbeat_of_fragments_asks_too(self) -> None:
        bench = Bench()
        bench.fragments(1, 1, 4)
        for count, last in ((1, 4), (2, 4), (2, 9)):
            bench.core.on_heartbeat_frag(HeartbeatFrag(THEM, None, 0, WRITER, 1, last, count), bench.now)
        assert [nack.missing for nack in bench.take(NackFrag)] == [(2, 3), (2, 3)]
        bench.core.on_heartbeat_frag(HeartbeatFrag(THEM, None, 0, WRITER, 5, 2**32 - 1, 3), bench.now)
        assert bench.take(NackFrag)[0].missing == tuple(range(1, 257))
        bench.data(1)
        bench.core.on_heartbeat_frag(HeartbeatFrag(THEM, None, 0, WRITER, 1, 9, 4), bench.now)
        assert bench.sent == []

    def test_a_whole_sample_makes_its_fragments_needless(self) -> None:
        bench = Bench()
        bench.fragments(1, 1, 2)
        bench.fragments(2, 1, 2)
        bench.data(2, 1)
        assert bench.got == [1, 2]
        assert bench.at_rest()

    @pytest.mark.parametrize("how", ["gap", "heartbeat"])
    def test_fragments_of_what_will_not_come_are_dropped(self, how: str) -> None:
        bench = Bench()
        bench.beat(1, 1)
        bench.data(1)
        bench.fragments(2, 1, 2)
        bench.fragments(4, 1, 2)
        if how == "gap":
            bench.gap(2, 5)
        else:
            bench.beat(5, 5)
        assert bench.at_rest()

    def test_fragments_that_contradict_each_other_are_dropped(self) -> None:
        bench = Bench()
        bench.fragments(1, 1, 2)
        bench.fragments(1, 1, size=400, of=200)
        assert bench.problems == [(Problem.INCONSISTENT, 1)]
        bench.fragments(1, *range(3, 11))
        assert bench.got == [1]

    def test_best_effort_fragments_are_not_kept_for_ever(self) -> None:
        bench = Bench(reliable=False)
        bench.fragments(1, 1, 2)
        bench.wait(2 * SECOND)
        bench.fragments(2, 1)
        assert len(bench.core.writers[0].assemblies) == 2
        bench.wait(2 * SECOND)
        assert len(bench.core.writers[0].assemblies) == 1
        bench.wait(2 * SECOND)
        assert bench.at_rest()
        assert bench.core.deadline is None
        assert bench.problems == [(Problem.INCOMPLETE, 1)] * 2

    def test_best_effort_fragments_make_way_for_newer_ones(self) -> None:
        bench = Bench(reliable=False)
        for number in range(1, 20):
            bench.fragments(number, 1)
        assert list(bench.core.writers[0].assemblies) == list(range(12, 20))
        bench.fragments(18, *range(2, 11))
        assert bench.got == [18]
        assert list(bench.core.writers[0].assemblies) == [19]

    def test_a_sample_larger_than_the_memory_is_done_without(self) -> None:
        bench = Bench(memory=5000)
        bench.data(2)
        bench.fragments(1, 1, 2, size=100_000)
        assert bench.got == [2]
        assert bench.problems == [(Problem.SAMPLE_TOO_LARGE, 100_000)]
        best = Bench(memory=5000, reliable=False)
        best.fragments(1, 1, 2, 3, size=100_000)
        assert best.problems == [(Problem.SAMPLE_TOO_LARGE, 100_000)]


class TestMemory:
    def test_what_comes_too_early_is_not_kept(self) -> None:
        bench = Bench(window=4)
        bench.data(2, 4, 5, 6, 7, 2**62)
        assert sorted(bench.core.writers[0].pending) == [2, 4]
        bench.fragments(5, 1)
        assert not bench.core.writers[0].assemblies

    def test_what_is_needed_last_makes_way(self) -> None:
        bench = Bench(memory=10_000)
        bench.data(9, 8, 7, size=3000)
        assert sorted(bench.core.writers[0].pending) == [7, 8]
        assert bench.problems == [(Problem.MEMORY_FULL, 3500)]
        bench.data(10, size=8000)
        assert sorted(bench.core.writers[0].pending) == [7, 8]
        bench.fragments(1, *range(1, 30), size=3000)
        assert sorted(bench.core.writers[0].pending) == [7]
        bench.fragments(1, 30, size=3000)
        assert bench.got == [1]
        assert bench.core.held <= 10_000

    def test_the_account_is_about_right(self) -> None:
        """What it says it holds is what Python takes, so that the limit means something."""
        bench = Bench(memory=1 << 30)
        tracemalloc.start()
        before = tracemalloc.get_traced_memory()[0]
        bench.data(*range(2, 500), size=64)
        for number in range(600, 610):
            bench.fragments(number, *range(1, 400), size=40_000)
        taken = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
        assert 0.5 * taken < bench.core.held < 2 * taken


class TestRefusing:
    def test_a_refused_sample_waits_and_is_not_acknowledged(self) -> None:
        bench = Bench()
        bench.data(1)
        bench.refuses = True
        bench.data(2, 3, 4)
        bench.beat(1, 4, final=False)
        (ack,) = bench.take(AckNack)
        assert (ack.base, ack.missing) == (2, ())
        bench.core.resume(bench.now)
        assert (bench.got, bench.sent) == ([1], [])
        bench.refuses = False
        bench.core.resume(bench.now)
        assert bench.got == [1, 2, 3, 4]
        (ack,) = bench.take(AckNack)
        assert (ack.base, ack.missing, ack.final) == (5, (), True)
        assert bench.at_rest()

    @pytest.mark.parametrize("how", ["gap", "heartbeat"])
    def test_what_is_passed_over_meanwhile_is_passed_over_later(self, how: str) -> None:
        bench = Bench()
        bench.beat(1, 1)
        bench.refuses = True
        bench.data(1, 5)
        if how == "gap":
            bench.gap(2, 5)
        else:
            bench.beat(5, 5)
        bench.data(6)
        bench.refuses = False
        bench.core.resume(bench.now)
        assert bench.got == [1, 5, 6]
        assert bench.problems == ([] if how == "gap" else [(Problem.SAMPLES_LOST, 3)])
        assert bench.at_rest()


class TestPatience:
    """Writers that speak first, and bear to be answered together with others."""

    def bench(self, **options: Any) -> Bench:
        bench = Bench(matched=False, together=10 * MILLISECOND)
        bench.now += 3 * MILLISECOND
        bench.match(patient=True, **options)
        return bench

    def test_a_patient_writer_is_asked_only_when_it_stays_silent(self) -> None:
        bench = self.bench()
        bench.wait(700 * MILLISECOND)
        assert bench.sent == []
        bench.wait(200 * MILLISECOND)
        (hello,) = bench.take(AckNack)
        assert (hello.missing, hello.final) == ((), False)
        bench = self.bench()
        bench.beat(1, 0)
        bench.wait(10 * SECOND)
        assert bench.sent == []

    def test_answers_leave_at_common_times(self) -> None:
        bench = self.bench()
        bench.beat(1, 2, final=False)
        bench.match(b"x" * 12, patient=True)
        bench.wait(3 * MILLISECOND)
        bench.beat(1, 2, final=False, writer=b"x" * 12)
        bench.data(1, 2)
        assert bench.sent == []
        bench.wait(4 * MILLISECOND)
        assert [(ack.base, ack.missing) for ack in bench.take(AckNack)] == [(3, ()), (1, (1, 2))]

    def test_what_is_known_already_is_acknowledged_and_not_asked_for(self) -> None:
        bench = self.bench(known=7)
        (ack,) = bench.take(AckNack)
        assert (ack.base, ack.missing, ack.final) == (8, (), True)
        bench.wait(10 * SECOND)
        bench.data(7, 8)
        assert (bench.got, bench.sent) == ([8], [])

    def test_what_was_delivered_may_be_relied_on(self) -> None:
        bench = self.bench()
        writer = guid_of(THEM, WRITER)
        assert bench.core.known_from(writer) == 0
        bench.data(1, 2)
        assert bench.core.known_from(writer) == 0, "there may have been others before"
        bench.beat(1, 2)
        assert (bench.core.known_from(writer), bench.core.next_of(writer)) == (2, 3)
        bench.data(4)
        assert bench.core.known_from(writer) == 0
        assert bench.core.known_from(guid_of(b"x" * 12, WRITER)) == 0


class TestLimits:
    def test_all_writers_share_the_room(self) -> None:
        bench = Bench(limit=3)
        bench.match(b"x" * 12)
        bench.refuses = True
        bench.data(1, 2)
        bench.data(1, 2, writer=b"x" * 12)
        bench.data(3)
        assert bench.problems == [(Problem.SAMPLES_FULL, 3)] * 2
        assert bench.core.rejected == 2
        bench.refuses = False
        bench.core.resume(bench.now)
        assert bench.got == [1, 2, 1]

    def test_what_comes_next_goes_before_what_came_early(self) -> None:
        bench = Bench(limit=2)
        bench.data(2, 3)
        bench.refuses = True
        bench.data(1)
        assert bench.problems == [(Problem.SAMPLES_FULL, 2)]
        bench.refuses = False
        bench.core.resume(bench.now)
        assert bench.got == [1, 2]
        bench.wait(SECOND)
        assert (3,) in {ack.missing for ack in bench.take(AckNack)}
        bench.data(3)
        assert bench.got == [1, 2, 3]
        assert bench.at_rest()

    def test_a_refused_sample_is_asked_for_again_when_others_have_all_the_room(self) -> None:
        bench = Bench(limit=1)
        bench.match(b"x" * 12)
        bench.refuses = True
        bench.data(1)
        bench.data(1, writer=b"x" * 12)
        bench.refuses = False
        bench.core.resume(bench.now)
        bench.sent.clear()
        bench.wait(SECOND)
        assert (1, (1,)) in {(ack.base, ack.missing) for ack in bench.take(AckNack)}

    def test_nothing_is_asked_for_that_there_is_no_room_for(self) -> None:
        bench = Bench(limit=2)
        bench.refuses = True
        bench.data(1, 2, 3, 4)
        bench.beat(1, 4, final=False)
        bench.wait(SECOND)
        (ack,) = bench.take(AckNack)
        assert (ack.base, ack.missing) == (1, ())


_NUMBERS = st.one_of(st.integers(1, 40), st.integers(1, 2**63 - 1))
_COUNTS = st.one_of(st.integers(0, 20), st.integers(0, 2**32 - 1))


@st.composite
def _events(draw: st.DrawFn) -> Event:
    """Anything the parser may make."""
    number, other, count = draw(_NUMBERS), draw(_NUMBERS), draw(_COUNTS)
    offsets = draw(st.lists(st.integers(0, 255), max_size=6, unique=True))
    kind = draw(st.sampled_from([Data, DataFrag, Heartbeat, HeartbeatFrag, Gap]))
    if kind is Data:
        return Data(THEM, None, None, 0, WRITER, number, bytes(draw(st.integers(0, 900))), None, False)
    if kind is DataFrag:
        size = draw(st.sampled_from([1, 7, 100]))
        total = draw(st.sampled_from([1, 2, 5, 2**20]))
        first = draw(st.integers(1, min(total, 50)))
        part = bytes(size)
        return DataFrag(THEM, None, None, 0, WRITER, number, first, 1, size, total * size, part, None, False)
    if kind is Heartbeat:
        first = min(number, other)
        last = max(number, other) - draw(st.integers(0, 1))
        return Heartbeat(
            THEM, None, 0, WRITER, first, max(last, first - 1), count, draw(st.booleans()), False
        )
    if kind is HeartbeatFrag:
        return HeartbeatFrag(THEM, None, 0, WRITER, number, draw(st.integers(1, 2**32 - 1)), count)
    return Gap(THEM, None, 0, WRITER, number, other, tuple(other + offset for offset in sorted(offsets)))


@given(st.lists(_events(), max_size=60), st.booleans(), st.sampled_from([0, 3]), st.sampled_from([0, 1, 5]))
def test_no_writer_can_upset_a_reader(events: list[Event], reliable: bool, refusals: int, limit: int) -> None:
    bench = Bench(memory=3000, window=64, reliable=reliable, limit=limit, limit_of_one=limit // 2)
    good = b"g" * 12
    bench.match(good)
    for at, event in enumerate(events):
        assert isinstance(event, Data | DataFrag | Heartbeat | HeartbeatFrag | Gap)
        bench.refuses = bool(refusals and at % refusals == 0)
        before = len(bench.sent)
        tell(bench.core, event, bench.now)
        assert len(bench.sent) - before <= 9
        proxy = bench.core.writers[0]
        assert proxy.held <= 3000 + 1400  # a refused sample may be as large as a datagram
        assert len(proxy.pending) + len(proxy.irrelevant) <= 64 + 64
        assert len(proxy.pending) <= (limit or 64)
    bench.refuses = False
    bench.core.resume(bench.now)
    bench.wait(60 * SECOND)
    assert bench.core.deadline is None
    assert bench.got == sorted(set(bench.got))
    bench.got.clear()
    bench.data(1, 3, 2, writer=good)
    if reliable and limit:  # what has no room comes again
        bench.data(*([1, 2, 3] * 3), writer=good)
    assert bench.got == ([1, 2, 3] if reliable else [1, 3])
    bench.core.unmatch_writer(guid_of(THEM, WRITER))
    assert bench.core.held == 0
