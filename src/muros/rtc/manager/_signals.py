"""SIGINT and SIGTERM as a wish to end: once is enough, and a second one does not wait."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

__all__ = ["ended_by_signals"]

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
SAME_WISH: Final = 0.1
"""Seconds after a signal in which others are the same wish: `timeout` signals a process, and then its group."""


@contextmanager
def ended_by_signals(end: Callable[[], object]) -> Iterator[None]:
    """While it is entered, SIGINT and SIGTERM call `end`; one that comes later ends the process at once.

    To be entered in the main thread.
    """

    def handle(number: int, frame: FrameType | None) -> None:
        _set_all(signal.SIG_IGN)
        end()
        time.sleep(SAME_WISH)
        _set_all(signal.SIG_DFL)  # not a handler: the main thread may be in a call that lets none run

    before = {number: signal.signal(number, handle) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _set_all(handler: signal.Handlers) -> None:
    for number in SIGNALS:
        signal.signal(number, handler)
