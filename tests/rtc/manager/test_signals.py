"""Signals as a wish to end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from typing import Any

import pytest

from muros.rtc.manager import _signals, ended_by_signals
from muros.rtc.manager._signals import SIGNALS
from tests.rtc.manager._processes import wait_until

WAITING = """
import threading
from muros.rtc.manager import ended_by_signals
with ended_by_signals(lambda: print("wish", flush=True)):
    print("ready", flush=True)
    threading.Event().wait()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_comes_twice_at_once_is_one_wish(
    number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`timeout` sends its own twice; the names of components would be left behind if that ended the process."""
    monkeypatch.setattr(_signals, "SAME_WISH", 60.0)  # however long this process is not let run in between
    ends: list[int] = []
    ended = threading.Event()

    def end() -> None:
        ends.append(number)
        ended.set()

    before = signal.getsignal(number)
    with ended_by_signals(end):
        signal.raise_signal(number)
        signal.raise_signal(signal.SIGTERM)
        assert ended.wait(10)
    assert ends == [number]
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("moment", ["beginning", "ending"])
def test_no_signal_is_lost_as_it_begins_to_listen_or_ends(
    moment: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each comes while its handler does nothing: just after it is there, or just before it goes."""
    install = signal.signal
    changes = 0
    wishes: list[str] = []

    def interrupted(number: signal.Signals, handler: Any) -> Any:
        nonlocal changes
        changes += 1
        if moment == "ending" and changes == len(SIGNALS) + 1:
            signal.raise_signal(number)
        before = install(number, handler)
        if moment == "beginning" and changes == 1:
            signal.raise_signal(number)
        return before

    monkeypatch.setattr(signal, "signal", interrupted)
    with ended_by_signals(lambda: wishes.append(moment)):
        pass
    assert wishes == [moment]


def test_a_signal_that_another_thread_gets_counts() -> None:
    """As the ORB's threads may; the main thread waits for a lock meanwhile, and runs no handler."""
    ended, leave = threading.Event(), threading.Event()
    other = threading.Thread(target=leave.wait)
    other.start()
    try:
        with ended_by_signals(ended.set):
            assert other.ident is not None
            signal.pthread_kill(other.ident, signal.SIGTERM)
            assert ended.wait(10)
    finally:
        leave.set()
        other.join()


def test_a_wish_may_need_a_lock_of_the_main_thread() -> None:
    lock = threading.Lock()
    ended = threading.Event()

    def end() -> None:
        with lock:
            ended.set()

    with ended_by_signals(end):
        with lock:
            signal.raise_signal(signal.SIGINT)
            assert not ended.is_set()
        assert ended.wait(10)


def test_a_process_forked_meanwhile_is_not_waited_for() -> None:
    """It has the pipe, too, and may run longer."""
    with ended_by_signals(lambda: None):
        sink = signal.set_wakeup_fd(-1)
        signal.set_wakeup_fd(sink, warn_on_full_buffer=False)
        forked = os.dup(sink)
    os.close(forked)


def test_a_second_signal_ends_the_process_at_once() -> None:
    with subprocess.Popen([sys.executable, "-c", WAITING], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            process.terminate()
            assert process.stdout.readline() == "wish\n"

            def has_ended() -> bool:
                process.terminate()
                return process.poll() is not None

            wait_until(has_ended)
            assert process.returncode == 128 + signal.SIGTERM
            assert process.stdout.read() == ""
        finally:
            process.kill()
