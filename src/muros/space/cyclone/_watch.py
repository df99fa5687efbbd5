"""Learning from Cyclone that something has happened, without Python being called from its threads.

Cyclone's threads may hold locks that a call from Python waits for while it holds the interpreter's lock. So they must
never need that one: a listener written in Python can end in both sides waiting for each other. A wait set cannot. One
thread of ours waits in it, outside the interpreter, and then asks the event loop for a call; it waits again when that
call is over. What is triggered is asked by `poll`, at any time.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from threading import Event, Thread
from typing import Any, Final

from muros.space._door import SpaceError

__all__ = ["Watch"]

AT_ONCE: Final = 256
"""Entities told of in one call."""

PAUSE: Final = 1_000_000_000
"""ns after which the waiting thread looks whether it is still wanted."""


class Watch:
    """Entities of Cyclone, known by numbers, that are watched for a change of the statuses in their masks."""

    def __init__(self, participant: Any) -> None:
        library = participant._dll_handle
        # Of the domain, so that entities of all its participants can be watched.
        domain = library.dds_get_parent(ctypes.c_int32(participant._ref))
        self._set = library.dds_create_waitset(ctypes.c_int32(domain))
        if self._set < 0:
            raise SpaceError(f"Cyclone DDS makes no wait set (code {self._set})")
        self._library = library
        self._wait = library.dds_waitset_wait
        self._wait.argtypes = (ctypes.c_int32, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int64)
        self._wait.restype = ctypes.c_int32
        self._found = (ctypes.c_ssize_t * AT_ONCE)()
        self._handled = Event()
        self._thread: Thread | None = None
        self._closed = False

    def add(self, entity: Any, number: int, mask: int) -> None:
        """Watch an entity."""
        entity.set_status_mask(mask)
        attach = self._library.dds_waitset_attach
        attach.argtypes = (ctypes.c_int32, ctypes.c_int32, ctypes.c_ssize_t)
        result = attach(self._set, entity._ref, number)
        if result != 0:
            raise SpaceError(f"Cyclone DDS cannot watch {entity!r} (code {result})")

    def poll(self) -> list[int]:
        """Numbers of entities with news, `AT_ONCE` at most."""
        n = self._wait(self._set, self._found, AT_ONCE, 0)
        return list(self._found[: min(n, AT_ONCE)]) if n > 0 else []

    def start(self, notify: Callable[[], None]) -> None:
        """Call `notify`, from a thread, when there is news; again only after `handled`."""
        if self._thread is None:
            self._thread = Thread(target=self._run, args=(notify,), name="muros cyclonedds", daemon=True)
            self._thread.start()

    def handled(self) -> None:
        """All that was told of has been looked at."""
        self._handled.set()

    def close(self) -> None:
        """Watch no longer."""
        self._closed = True
        self._handled.set()
        self._library.dds_waitset_set_trigger(self._set, ctypes.c_bool(True))
        if self._thread is not None:
            self._thread.join()
        self._library.dds_delete(self._set)

    def _run(self, notify: Callable[[], None]) -> None:
        while not self._closed:
            if self._wait(self._set, None, 0, PAUSE) == 0 or self._closed:
                continue
            self._handled.clear()
            notify()
            self._handled.wait()
