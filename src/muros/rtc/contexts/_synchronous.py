"""Contexts without a thread: whoever calls does the work, as simulators need it."""

from __future__ import annotations

from typing import ClassVar

from muros.rtc.codes import ExecutionKind, ReturnCode
from muros.rtc.contexts._context import ExecutionContext
from muros.rtc.contexts._requests import Request, conducting, is_conducting

__all__ = ["SynchronousExecutionContext"]


class SynchronousExecutionContext(ExecutionContext):
    """`tick` runs a pass in the caller's thread; transitions run in the thread that asks for them, at once.

    A thread that comes while another is inside leaves its request to that one and waits.
    """

    kind: ClassVar[ExecutionKind] = ExecutionKind.PERIODIC
    registered_name: ClassVar[str] = "SynchExtTriggerEC"
    _busy = False
    _over = False

    def tick(self) -> ReturnCode:
        """One pass, which has run when this returns.

        PRECONDITION_NOT_MET: the context does not run, or this is a callback of it; RTC_ERROR: another thread's pass
        does not end.
        """
        if not self._running or is_conducting(self):
            return ReturnCode.PRECONDITION_NOT_MET

        def work() -> ReturnCode:
            if self._running:
                self._pass()
            return ReturnCode.RTC_OK

        return self._ask(Request("tick", work))

    def _post(self, request: Request) -> bool:
        with self._changed:
            if self._over:
                return False
            self._requests.append(request)
        self._conduct()
        return True

    def _end(self) -> None:
        self._over = True

    def _conduct(self) -> None:
        """Do all that was asked, unless a thread is at it, which then goes on to this."""
        while True:
            with self._changed:
                if self._busy or not self._requests:
                    return
                self._busy = True
            try:
                with conducting(self):
                    self._serve()
            finally:
                with self._changed:
                    self._busy = False
