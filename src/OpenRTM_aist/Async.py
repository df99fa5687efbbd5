"""A call that is made meanwhile: `OpenRTM_aist.Async_tInvoker(consumer._ptr(), function).invoke()`."""
# ruff: noqa: N801, N802, N999 (the names are those that programs know)

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from OpenRTM_aist.Task import Task

__all__ = ["Async_ref_t", "Async_ref_tInvoker", "Async_t", "Async_tInvoker"]


class Async_t(Task):
    """`func(obj, *args)` in a thread of its own, begun by `invoke`."""

    def __init__(self, obj: Any, func: Callable[..., Any], *args: Any) -> None:
        super().__init__()
        self._over = False
        self.setTask(func, obj, *args)

    def invoke(self) -> None:
        """Begin the call."""
        self.activate()

    def finished(self) -> bool:
        """Whether the call is over, well or badly."""
        return self._over

    def svc(self) -> Any:
        try:
            return super().svc()
        finally:
            self._over = True


def Async_tInvoker(obj: Any, func: Callable[..., Any], *args: Any) -> Async_t:
    """A call of `func(obj, *args)`, to be begun by `invoke`."""
    return Async_t(obj, func, *args)


Async_ref_t = Async_t
Async_ref_tInvoker = Async_tInvoker
