"""A thread under its old name: override `svc`, then `activate`."""
# ruff: noqa: N802, N999 (the names are those that programs know)

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

__all__ = ["Task"]


class Task:
    """Work for a thread of its own, which does not keep the program alive. What `svc` raises is printed."""

    def __init__(self) -> None:
        self._call: Callable[[], Any] | None = None
        self._thread: threading.Thread | None = None

    def setTask(self, func: Callable[..., Any], *args: Any) -> None:
        """Have `svc` call this."""
        self._call = lambda: func(*args)

    def svc(self) -> Any:
        """The work."""
        return 0 if self._call is None else self._call()

    def activate(self) -> None:
        """Begin, if it does not run."""
        if self._thread is None or not self._thread.is_alive():
            self._thread = threading.Thread(target=self.svc, name=type(self).__name__, daemon=True)
            self._thread.start()

    def wait(self, timeout: float | None = None) -> None:
        """Wait for its end, `timeout` seconds at most."""
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout)

    def finalize(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the thread, which may go on."""
        self._thread = None

    def open(self, args: Any = None) -> int:
        return 0

    def close(self, flags: Any = 0) -> int:
        return 0

    def suspend(self) -> int:
        return 0

    def resume(self) -> int:
        return 0
