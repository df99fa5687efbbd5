"""What threads ask of a context, and how they wait for it without waiting for each other in a circle.

Callbacks of one context run in one thread at a time: its *conductor*. Everybody else puts a request into the queue and
waits for its end. A thread that runs callbacks itself, of whichever contexts, may wait for another context only if that
one does not wait for it in turn; otherwise what it asks for stands and is done when it has returned.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from muros.rtc.codes import ReturnCode
from muros.rtc.contexts._cycle import Member
from muros.rtc.contexts._states import Ask

__all__ = ["Request", "conducting", "inside_callback", "is_conducting", "wait"]


class Request:
    """Something to be done by the conductor: `work`, whose code is the answer.

    `what` completes "... takes long". `member` and `ask` say which transition it is, if one.
    """

    __slots__ = ("_finished", "ask", "code", "member", "what", "work")

    def __init__(
        self, what: str, work: Callable[[], ReturnCode], member: Member | None = None, ask: Ask | None = None
    ) -> None:
        self.what: Final = what
        self.work: Final = work
        self.member: Final = member
        self.ask: Final = ask
        self.code = ReturnCode.RTC_OK
        self._finished = threading.Event()

    @property
    def is_finished(self) -> bool:
        """Whether the work has been done: `code` counts."""
        return self._finished.is_set()

    def perform(self) -> None:
        """Do the work; for the conductor."""
        try:
            self.code = self.work()
        except BaseException:
            self.code = ReturnCode.RTC_ERROR
            raise
        finally:
            self._finished.set()

    def wait(self, seconds: float) -> bool:
        """Wait until it is done; False when the time is over before."""
        return self._finished.wait(seconds)


class _Here(threading.local):
    """The contexts whose callbacks the thread is running, outermost first."""

    contexts: tuple[object, ...] = ()


_here: Final = _Here()
_waiting: Final[dict[int, tuple[tuple[object, ...], object]]] = {}
"""By thread: the contexts whose callbacks wait, and the one they wait for."""
_lock: Final = threading.Lock()


@contextmanager
def conducting(context: object) -> Iterator[None]:
    """The calling thread runs callbacks of `context` meanwhile."""
    before = _here.contexts
    _here.contexts = (*before, context)
    try:
        yield
    finally:
        _here.contexts = before


def is_conducting(context: object) -> bool:
    """Whether the calling thread is inside a callback of `context`."""
    return any(other is context for other in _here.contexts)


def inside_callback() -> bool:
    """Whether the calling thread is inside a callback of any context of this process."""
    return bool(_here.contexts)


def wait(request: Request, context: object, seconds: float) -> bool | None:
    """Wait for `context` to do what was asked. False: not done in time. None: it would wait for us in turn."""
    here = _here.contexts
    if not here:
        return request.wait(seconds)
    thread = threading.get_ident()
    with _lock:
        if _leads_to(context, here):
            return request.is_finished or None
        _waiting[thread] = (here, context)
    try:
        return request.wait(seconds)
    finally:
        with _lock:
            del _waiting[thread]


def _leads_to(context: object, here: tuple[object, ...]) -> bool:
    """Whether `context` is one of `here`, or waits for one of them, directly or by others."""
    reached = [context]
    for one in reached:
        if any(one is other for other in here):
            return True
        for waiting, target in _waiting.values():
            if any(one is other for other in waiting) and not any(target is other for other in reached):
                reached.append(target)
    return False
