"""Signals as a wish to end."""

from __future__ import annotations

import signal

import pytest

from muros.rtc.manager import ended_by_signals


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_comes_twice_at_once_is_one_wish(number: signal.Signals) -> None:
    """`timeout` sends its own twice; the names of components would be left behind if that ended the process."""
    ends: list[int] = []

    def end() -> None:
        ends.append(number)
        signal.raise_signal(signal.SIGTERM)

    before = signal.getsignal(number)
    with ended_by_signals(end):
        signal.raise_signal(number)
        assert ends == [number]
        later = {signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)}
        assert later == {signal.SIG_DFL}, "who signals again does not wait"
    assert signal.getsignal(number) is before
