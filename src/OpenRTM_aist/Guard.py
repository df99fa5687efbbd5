"""A lock that is held as long as a variable is: `guard = OpenRTM_aist.ScopedLock(mutex)`."""
# ruff: noqa: N999

from __future__ import annotations

from typing import Any

__all__ = ["ScopedLock"]


class ScopedLock:
    """Holds `mutex` until the object goes (`del guard`, the end of the function), or until a `with` ends."""

    def __init__(self, mutex: Any) -> None:
        self._held: Any = None
        mutex.acquire()
        self._held = mutex

    def __enter__(self) -> ScopedLock:
        return self

    def __exit__(self, *_: object) -> None:
        self.__del__()

    def __del__(self) -> None:
        held, self._held = self._held, None
        if held is not None:
            held.release()
