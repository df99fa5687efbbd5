"""When passes are due, in virtual time."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtc.contexts import Spread
from muros.rtc.contexts._schedule import MOST_ANTICIPATED, Anticipation, Schedule, is_rate
from muros.rtc.contexts._statistics import Window


def run(schedule: Schedule, passes: list[float], *, late: float = 0.0, start: float = 0.0) -> list[float]:
    """Passes that take as long as said, each begun `late` after it was due; when they began."""
    now = start
    schedule.start(now)
    begun = []
    for duration in passes:
        now = max(now, schedule.deadline + late)
        begun.append(now)
        schedule.begin(now)
        now += duration
        schedule.end(now)
    return begun


def test_late_passes_do_not_shift_those_after_them() -> None:
    schedule = Schedule(100.0)
    begun = run(schedule, [0.004] * 1000, late=0.001)
    assert begun[-1] == pytest.approx(999 * 0.01 + 0.001, abs=1e-9)
    statistics = schedule.statistics()
    assert (statistics.passes, statistics.missed) == (1000, 0)
    assert statistics.rate == pytest.approx(100.0)
    spread = statistics.deviation
    assert (spread.p50, spread.p99, spread.max) == pytest.approx((0.001, 0.001, 0.001))
    assert statistics.duration.max == pytest.approx(0.004)


def test_a_pass_that_takes_too_long_leaves_out_those_that_are_over() -> None:
    schedule = Schedule(100.0)
    begun = run(schedule, [0.001, 0.035, 0.001, 0.001])
    assert begun == pytest.approx([0.0, 0.01, 0.045, 0.05])
    assert schedule.statistics().missed == 2


def test_a_pass_a_little_too_long_makes_the_next_late_but_misses_none() -> None:
    schedule = Schedule(100.0)
    begun = run(schedule, [0.013, 0.001, 0.001])
    assert begun == pytest.approx([0.0, 0.013, 0.02])
    assert schedule.statistics().missed == 0


def test_missed_passes_are_made_up_for_as_far_as_asked() -> None:
    schedule = Schedule(100.0, catch_up=2)
    begun = run(schedule, [0.001, 0.065, 0.001, 0.001, 0.001, 0.001])
    assert begun == pytest.approx([0.0, 0.01, 0.075, 0.076, 0.077, 0.08])
    assert schedule.statistics().missed == 3


def test_another_rate_counts_from_the_pass_that_was_due_last() -> None:
    schedule = Schedule(10.0)
    run(schedule, [0.0, 0.0, 0.0])
    assert schedule.deadline == pytest.approx(0.3)
    schedule.set_rate(100.0)
    assert (schedule.rate, schedule.deadline) == pytest.approx((100.0, 0.21))
    schedule.set_rate(1.0)
    assert schedule.deadline == pytest.approx(1.2)


def test_another_rate_before_the_first_pass() -> None:
    schedule = Schedule(10.0)
    schedule.set_rate(20.0)
    assert not schedule.is_started
    schedule.start(5.0)
    schedule.set_rate(40.0)
    assert schedule.deadline == 5.0


def test_nothing_is_due_while_it_is_stopped() -> None:
    schedule = Schedule(10.0)
    assert schedule.deadline == math.inf
    run(schedule, [0.0, 0.0])
    schedule.stop()
    assert not schedule.is_started
    schedule.begin(3.0)
    schedule.end(3.5)
    assert schedule.deadline == math.inf
    schedule.start(7.0)
    assert schedule.deadline == 7.0
    assert schedule.statistics().passes == 3


@pytest.mark.parametrize("rate", [0, -1.0, math.nan, math.inf, 5e-324, "10", None])
def test_what_is_no_rate_is_refused(rate: float) -> None:
    assert not is_rate(rate)
    with pytest.raises(ValueError, match="passes per second"):
        Schedule(rate)
    with pytest.raises(ValueError, match="passes per second"):
        Schedule(1.0).set_rate(rate)


def test_catch_up_is_a_number_of_passes() -> None:
    with pytest.raises(ValueError, match="catch_up"):
        Schedule(1.0, catch_up=-1)


@given(
    rate=st.floats(0.1, 1e4),
    durations=st.lists(st.floats(0.0, 50.0), min_size=1, max_size=60),
    catch_up=st.integers(0, 4),
    start=st.floats(0.0, 1e6),
)
def test_every_pass_that_was_due_was_run_or_missed(
    rate: float, durations: list[float], catch_up: int, start: float
) -> None:
    """And none begins before it is due, and what is made up for is never more than was allowed."""
    schedule = Schedule(rate, catch_up=catch_up)
    begun = run(schedule, [duration / rate for duration in durations], start=start)
    statistics = schedule.statistics()
    due = round((schedule.deadline - start) * rate)
    assert due == statistics.passes + statistics.missed
    for number, moment in enumerate(begun):
        assert moment >= start + number / rate - 1e-6
    end = begun[-1] + durations[-1] / rate
    assert schedule.deadline >= end - (catch_up + 1) / rate - 1e-6


def test_a_window_keeps_the_last() -> None:
    window = Window(3)
    assert window.values() == []
    for number in range(5):
        window.add(number)
    assert window.values() == [2.0, 3.0, 4.0]
    window.clear()
    window.add(9.0)
    assert window.values() == [9.0]
    with pytest.raises(ValueError, match="at least 1"):
        Window(0)


def test_spread() -> None:
    assert Spread.of([]) == Spread(0.0, 0.0, 0.0)
    assert Spread.of([7.0]) == Spread(7.0, 7.0, 7.0)
    assert Spread.of(range(101)) == Spread(50, 99, 100)


@given(st.lists(st.floats(-1.0, 10.0)))
def test_what_is_anticipated_stays_within_bounds(lates: list[float]) -> None:
    early = Anticipation()
    for late in lates:
        early.learn(late)
        assert 0.0 <= early.seconds <= MOST_ANTICIPATED


def test_the_median_lateness_is_learnt() -> None:
    early = Anticipation()
    for number in range(500):
        early.learn((60e-6, 80e-6, 100e-6, 5e-3, 70e-6)[number % 5])
    assert early.seconds == pytest.approx(80e-6, rel=0.15)
