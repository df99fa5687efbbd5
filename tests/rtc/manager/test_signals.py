"""Signals as a wish to end."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading

import pytest

from muros.rtc.manager import ended_by_signals
from tests.rtc.manager._processes import wait_until

WAITING = """
import threading
from muros.rtc.manager import ended_by_signals
with ended_by_signals(lambda: print("wish", flush=True)):
    print("ready", flush=True)
    threading.Event().wait()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_comes_twice_at_once_is_one_wish(number: signal.Signals) -> None:
    """`timeout` sends its own twice; the names of components would be left behind if that ended the process."""
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
