"""The allowance: bursts at once, the rate in the long run, and no more however it is asked."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from muros.rtps._sending import Allowance


def test_a_burst_is_allowed_and_then_a_pause() -> None:
    allowance = Allowance(100, 10)
    for _ in range(4):
        assert allowance.allows(50)
        allowance.spend(30)
    assert not allowance.allows(50)
    assert not allowance.allows(51)  # 20 more than allowed were spent: that takes two
    assert not allowance.allows(52)
    assert allowance.allows(53)


def test_rest_is_not_saved_up() -> None:
    allowance = Allowance(100, 10)
    allowance.spend(100)
    assert allowance.allows(10**9)
    allowance.spend(100)
    assert not allowance.allows(10**9)


@given(st.integers(1, 300), st.integers(1, 50), st.lists(st.tuples(st.integers(0, 30), st.integers(1, 200))))
def test_no_more_leaves_than_allowed(burst: int, pace: int, steps: list[tuple[int, int]]) -> None:
    allowance = Allowance(burst, pace)
    start = now = 1000
    spent = largest = 0
    assert allowance.allows(now)
    for pause, size in steps:
        now += pause
        while allowance.allows(now):
            allowance.spend(size)
            spent, largest = spent + size, max(largest, size)
        assert spent <= burst * (2 + (now - start) / pace) + largest


@given(st.integers(1, 300), st.integers(1, 50), st.integers(1, 7))
def test_whoever_asks_often_gets_as_much_as_whoever_asks_rarely(burst: int, pace: int, step: int) -> None:
    allowance = Allowance(burst, pace)
    spent = 0
    for now in range(0, 100 * pace + 1, step):
        while allowance.allows(now):
            allowance.spend(1)
            spent += 1
    # What is earned is rounded down each time, but never lost altogether.
    assert spent >= min(burst * 40, 100 * pace // step // 2)
