"""SIGINT and SIGTERM as a wish to end: once is enough, and a second one does not wait.

The ORB's threads may be the ones that the system hands a signal to; Python then runs no handler before the main thread
comes back from whatever it waits in, which may be never. So a thread listens to the pipe that signals are written to
in whichever thread they come, and says what they mean. It may wait for locks, which a handler must not.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

__all__ = ["ended_by_signals"]

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
SAME_WISH: Final = 0.1
"""Seconds after a signal in which others are the same wish: `timeout` signals a process, and then its group."""
OVER: Final = b"\0"
"""What is written to the pipe after all signals."""


@contextmanager
def ended_by_signals(end: Callable[[], object]) -> Iterator[None]:
    """While it is entered, SIGINT and SIGTERM call `end`, in a thread; one that comes later ends the process at once.

    To be entered in the main thread.
    """
    source, sink = os.pipe()
    os.set_blocking(sink, False)
    listener = threading.Thread(target=_listen, args=(source, end), name="rtc-signals", daemon=True)
    # The handlers do nothing: a signal that comes while they are there and the pipe is not would be lost.
    before = signal.set_wakeup_fd(sink, warn_on_full_buffer=False)
    handlers = {number: signal.signal(number, lambda number, frame: None) for number in SIGNALS}
    listener.start()
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(before)
        os.write(sink, OVER)  # to close it would not do: a forked process may have it, too
        listener.join()
        os.close(sink)
        os.close(source)


def _listen(source: int, end: Callable[[], object]) -> None:
    """Call `end` for the first signal that comes out of a pipe; end the process for one after that."""
    ended: float | None = None
    numbers = b""
    while not numbers.endswith(OVER):
        numbers = os.read(source, 64)
        now = time.monotonic()
        for number in numbers:
            if number not in SIGNALS:
                continue
            if ended is None:
                end()
                ended = now = time.monotonic()
            elif now - ended > SAME_WISH:
                os._exit(128 + number)
