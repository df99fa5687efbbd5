"""Components of the tests: they answer as told, and remember what they were called for."""

import threading
from collections.abc import Callable, Collection, Mapping
from itertools import count

from muros.rtc.codes import PeerLostError, ReturnCode
from muros.rtc.contexts import ExecutionContext

OK = ReturnCode.RTC_OK
NO = ReturnCode.PRECONDITION_NOT_MET


class Actor:
    """A participant. `returns` and `raises_in` by callback, as in the captured traces (onExecute, ...).

    `trace` has repeated passes once, as those do; `calls` has all, with the handle.
    """

    def __init__(
        self,
        name: str = "actor",
        *,
        returns: Mapping[str, str] | None = None,
        raises_in: Collection[str] = (),
        trace: list[str] | None = None,
    ) -> None:
        self.instance_name = name
        self.returns = {key: ReturnCode[code] for key, code in (returns or {}).items()}
        self.raises_in = set(raises_in)
        self.log: list[str] = [] if trace is None else trace
        self.calls: list[tuple[str, int]] = []
        self.during: dict[str, Callable[[], object]] = {}
        self.attached: dict[int, ExecutionContext] = {}
        self.lost = False
        self._lock = threading.Lock()

    @property
    def trace(self) -> list[str]:
        return without_repeats(self.log)

    def count(self, name: str) -> int:
        return sum(1 for call, _ in self.calls if call == name)

    def attach_context(self, context: ExecutionContext) -> int:
        self._check()
        with self._lock:
            handle = next(number for number in count(1000) if number not in self.attached)
            self.attached[handle] = context
        return handle

    def detach_context(self, handle: int) -> ReturnCode:
        self._check()
        del self.attached[handle]
        return OK

    def on_initialize(self) -> ReturnCode:
        return self._do("onInitialize", -1)

    def on_finalize(self) -> ReturnCode:
        return self._do("onFinalize", -1)

    def on_startup(self, handle: int) -> ReturnCode:
        return self._do("onStartup", handle)

    def on_shutdown(self, handle: int) -> ReturnCode:
        return self._do("onShutdown", handle)

    def on_activated(self, handle: int) -> ReturnCode:
        return self._do("onActivated", handle)

    def on_deactivated(self, handle: int) -> ReturnCode:
        return self._do("onDeactivated", handle)

    def on_aborting(self, handle: int) -> ReturnCode:
        return self._do("onAborting", handle)

    def on_error(self, handle: int) -> ReturnCode:
        return self._do("onError", handle)

    def on_reset(self, handle: int) -> ReturnCode:
        return self._do("onReset", handle)

    def on_execute(self, handle: int) -> ReturnCode:
        return self._do("onExecute", handle)

    def on_state_update(self, handle: int) -> ReturnCode:
        return self._do("onStateUpdate", handle)

    def on_rate_changed(self, handle: int) -> ReturnCode:
        return self._do("onRateChanged", handle)

    def _do(self, name: str, handle: int) -> ReturnCode:
        self._check()
        self.log.append(name)
        self.calls.append((name, handle))
        self.during.get(name, lambda: None)()
        if name in self.raises_in:
            raise RuntimeError("as told")
        return self.returns.get(name, OK)

    def _check(self) -> None:
        if self.lost:
            raise PeerLostError("no answer")


def without_repeats(trace: list[str]) -> list[str]:
    """A trace in which passes that follow each other stand once."""
    shown: list[str] = []
    for name in trace:
        shown.append(name)
        for length in (1, 2):
            if shown[-length:] == shown[-2 * length : -length]:
                del shown[-length:]
    return shown
