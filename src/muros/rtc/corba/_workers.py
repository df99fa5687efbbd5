"""The threads that the ORB has made: known from their beginning to their end.

They end some time after the ORB has. A process that ends meanwhile would be aborted: Python stops threads that come
back to it, and these stand in C++ that must not be stopped. So who ends the ORB waits for them here.
"""

from __future__ import annotations

import threading
import time
from typing import Final

import omniORB

__all__ = ["wait_until_gone"]

PAUSE: Final = 0.001
"""Seconds between two looks at a thread that has said that it ends."""

_changed: Final = threading.Condition()
_workers: Final[set[threading.Thread]] = set()


def wait_until_gone(seconds: float) -> bool:
    """Wait until all threads of an ORB that has been destroyed are gone. False: `seconds` passed before."""
    deadline = time.monotonic() + seconds
    with _changed:
        ending = set(_workers)
        if not _changed.wait_for(lambda: not _workers, seconds):
            return False
        # The last of what a thread does in Python is to leave this list.
        while ending.intersection(threading.enumerate()):
            if time.monotonic() > deadline:
                return False
            _changed.wait(PAUSE)
    return True


def _told(event: int, worker: threading.Thread) -> None:
    with _changed:
        (_workers.add if event == omniORB.WTHREAD_CREATED else _workers.discard)(worker)
        _changed.notify_all()


omniORB.addWThreadHook(_told)
