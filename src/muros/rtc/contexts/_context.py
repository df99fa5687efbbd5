"""ExecutionContext: what all kinds share. RTC 1.1, 5.2.2.5 and 5.2.2.6.

A context takes requests from any thread (start, activate, a new rate, ...) and has them done by its conductor, the one
thread that runs its callbacks at a time; which thread that is, and when passes run, is what the kinds differ in
(`_threads`, `_synchronous`). The lock guards the queue and is never held while anything of a component is called.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import ClassVar, Final

from muros.findings import Finding, Severity
from muros.rtc.codes import ExecutionKind, LifeCycleState, PeerLostError, ReturnCode, RtcError
from muros.rtc.contexts._cycle import Cycle, Member
from muros.rtc.contexts._options import RATE, ContextOptions
from muros.rtc.contexts._participant import ContextEvent, ContextProfile, Participant, Report, name_of
from muros.rtc.contexts._requests import Request, is_conducting, wait
from muros.rtc.contexts._schedule import Schedule, is_rate
from muros.rtc.contexts._states import TRANSITIONS, Ask
from muros.rtc.contexts._statistics import ContextStatistics

__all__ = ["ExecutionContext"]

_OK: Final = ReturnCode.RTC_OK
_NO: Final = ReturnCode.PRECONDITION_NOT_MET


class ExecutionContext:
    """Calls components: in which order, when, in which thread.

    `name` is the one of rtc.conf, `rate` in passes per second; `properties` are shown in its profile, with type and
    rate. `clock` gives seconds and never goes back. `report` is given findings. RtcError for a rate that is none.

    No operation raises. PRECONDITION_NOT_MET: not in that state, BAD_PARAMETER: not a component of this context.
    Operations return when the callbacks they cause have run; from inside a callback of this context, at once: what was
    asked for is done when that has returned.
    """

    kind: ClassVar[ExecutionKind] = ExecutionKind.PERIODIC
    registered_name: ClassVar[str] = "ExecutionContext"

    def __init__(
        self,
        *,
        name: str = "",
        type_name: str = "",
        rate: float = RATE,
        options: ContextOptions | None = None,
        properties: Mapping[str, str] | None = None,
        clock: Callable[[], float] = time.monotonic,
        report: Report | None = None,
    ) -> None:
        if not is_rate(rate):
            raise RtcError(f"rate: {rate!r} is no rate; give passes per second, such as 1000")
        self.name: Final = name
        self.type_name: Final = type_name or self.registered_name
        self.options: Final = options or ContextOptions()
        self.properties: Final = dict(properties or {})
        self._clock: Final = clock
        self._report_to: Report = report or (lambda finding: None)
        self._changed: Final = threading.Condition(threading.Lock())
        self._requests: deque[Request] = deque()
        self._schedule: Final = Schedule(rate, catch_up=self.options.catch_up)
        self._cycle: Final = Cycle(self._tell, self._report, name=lambda: str(self))
        self._owner: Participant | None = None
        self._owned: tuple[Member, ...] = ()
        self._running = False
        self._started = False  # what the components were told last; only the conductor changes it
        self._closed = False
        self._collapsed = 0
        self._observers: dict[object, Callable[[ContextEvent], object]] = {}

    def __str__(self) -> str:
        owner = name_of(self._owner) if self._owner is not None else ""
        return f"{self.name or self.type_name} of {owner}" if owner else self.name or self.type_name

    # ---- what it is

    @property
    def owner(self) -> Participant | None:
        """The component it was made for; the first of those that share it."""
        return self._owner

    @property
    def participants(self) -> tuple[Participant, ...]:
        """The components it calls, but for the owner, in the order of calling."""
        return tuple(
            member.participant for member in self._cycle.members if member.participant is not self._owner
        )

    @property
    def rate(self) -> float:
        """Passes per second."""
        return self._schedule.rate

    @property
    def statistics(self) -> ContextStatistics:
        """What it measured of its passes."""
        return self._schedule.statistics(self._collapsed)

    def profile(self) -> ContextProfile:
        """How tools see it."""
        properties = {
            **self.properties,
            "type": self.type_name,
            "rate": f"{self.rate:.6f}".rstrip("0").rstrip("."),
        }
        return ContextProfile(self.kind, self.rate, self._owner, self.participants, properties)

    def on_event(self, callback: Callable[[ContextEvent], object]) -> Callable[[], None]:
        """Call `callback` with every event from now on, in the thread that runs the callbacks. Returns what ends it.

        It must return soon: components wait meanwhile. What it raises is a finding.
        """
        key = object()
        with self._changed:
            self._observers = {**self._observers, key: callback}

        def cancel() -> None:
            with self._changed:
                self._observers = {k: v for k, v in self._observers.items() if k is not key}

        return cancel

    # ---- running

    def is_running(self) -> bool:
        """Whether it has been started and not stopped since."""
        return self._running

    @property
    def is_here(self) -> bool:
        """Whether this process runs its callbacks, and so its observers are told; not for a reference to another's."""
        return type(self)._post is not ExecutionContext._post

    @property
    def is_closed(self) -> bool:
        """Whether it has ended, or is about to."""
        return self._closed

    def start(self) -> ReturnCode:
        """Run: on_startup of all, then passes."""
        with self._changed:
            if self._running or self._closed:
                return _NO
            self._running = True

        return self._ask(Request("start", self._tell_running))

    def stop(self) -> ReturnCode:
        """Stand still: no pass begins from now on, on_shutdown of all; the states of components stay."""
        with self._changed:
            if not self._running:
                return _NO
            self._running = False

        return self._ask(Request("stop", self._tell_running))

    def set_rate(self, rate: float) -> ReturnCode:
        """Another rate, from the next pass on; on_rate_changed of all.

        BAD_PARAMETER: no rate; RTC_ERROR: a component answered an error, and is in Error if it was active.
        """
        if not is_rate(rate):
            return ReturnCode.BAD_PARAMETER

        def work() -> ReturnCode:
            self._schedule.set_rate(rate)
            return self._cycle.rate_changed()

        return self._ask(Request("change of the rate", work))

    def tick(self) -> ReturnCode:
        """A pass now, for contexts that are triggered from outside; UNSUPPORTED by others."""
        return ReturnCode.UNSUPPORTED

    def close(self) -> None:
        """Stop, let all components go, end its thread. May be called twice; from inside a callback, too."""
        with self._changed:
            if self._closed:
                return
            self._running, self._closed = False, True

        def work() -> ReturnCode:
            for member in self._cycle.members:
                self._cycle.ask(member, Ask.DEACTIVATE)
            self._tell_running()
            for member in self._cycle.members:
                self._cycle.dismiss(member, running=False)
            return _OK

        self._ask(Request("end", work))
        self._end()

    # ---- components

    def bind_owner(self, component: Participant, handle: int) -> None:
        """The context belongs to `component`, which knows it by `handle`: 0 and up.

        Of several that share one, the first is its owner.
        """
        member = Member(component, handle, owner=True)

        with self._changed:
            if self._owner is None:
                self._owner = component
            self._owned = (*self._owned, member)
        self._ask(Request("taking its owner in", lambda: self._admit(member)))

    def unbind_owner(self, component: Participant) -> None:
        """`component` ends: it is let go, with on_shutdown; the last of the owners closes the context."""
        with self._changed:
            mine = [member for member in self._owned if member.participant == component]
            self._owned = tuple(member for member in self._owned if member not in mine)
            if component == self._owner and self._owned:
                self._owner = self._owned[0].participant
        if not self._owned:
            self.close()
            return
        for member in mine:
            self._ask(self._removal(member))

    def add_component(self, component: Participant) -> ReturnCode:
        """Take a component in, inactive; with on_startup where the context runs.

        PRECONDITION_NOT_MET: it is here; RTC_ERROR: its process does not answer.
        """
        if self._closed or self._cycle.find(component):
            return _NO
        try:
            member = Member(component, component.attach_context(self))
        except Exception as error:
            why = str(error) if isinstance(error, PeerLostError) else f"{type(error).__name__}: {error}"
            self._note("rtc-member-lost", f"{name_of(component)} cannot be added", why)
            return ReturnCode.RTC_ERROR
        return self._ask(Request("taking a component in", lambda: self._admit(member)))

    def remove_component(self, component: Participant) -> ReturnCode:
        """Let a component go: on_deactivated if it is active, on_shutdown if the context runs."""
        member = self._cycle.find(component)
        if member is None or member.owner:
            return ReturnCode.BAD_PARAMETER
        return self._ask(self._removal(member))

    def activate_component(self, component: Participant) -> ReturnCode:
        """INACTIVE to ACTIVE, with on_activated. PRECONDITION_NOT_MET, too, where that failed: it is in Error.

        A context that stands still activates nobody: PRECONDITION_NOT_MET.
        """
        options = self.options
        if not self._running and self._cycle.find(component):
            return _NO
        return self._change(component, Ask.ACTIVATE, options.sync_activation, options.activation_timeout)

    def deactivate_component(self, component: Participant) -> ReturnCode:
        """ACTIVE to INACTIVE, with on_deactivated."""
        options = self.options
        return self._change(
            component, Ask.DEACTIVATE, options.sync_deactivation, options.deactivation_timeout
        )

    def reset_component(self, component: Participant) -> ReturnCode:
        """ERROR to INACTIVE, with on_reset; RTC_ERROR where that refused, and it stays in Error."""
        options = self.options
        return self._change(component, Ask.RESET, options.sync_reset, options.reset_timeout)

    def get_component_state(self, component: Participant) -> LifeCycleState:
        """Where a component stands here; CREATED_STATE for one that is not of this context."""
        member = self._cycle.find(component)
        return LifeCycleState.CREATED_STATE if member is None else member.state

    # ---- for the kinds

    def _post(self, request: Request) -> bool:
        """Put a request into the queue and see to it that somebody does it. False where nobody would any more."""
        raise NotImplementedError

    def _end(self) -> None:
        """The context is closed: what is in the queue is the last that is done."""
        raise NotImplementedError

    def _execute(self) -> None:
        """One pass over the components."""
        self._cycle.execute()

    def _serve(self) -> None:
        """Do all that was asked, in the order of asking; for the conductor, between passes."""
        while True:
            with self._changed:
                if not self._requests:
                    return
                request = self._requests.popleft()
            request.perform()
            self._drop_lost()

    def _pass(self) -> None:
        """One pass, measured; for the conductor."""
        self._schedule.begin(self._clock())
        self._execute()
        self._schedule.end(self._clock())
        self._drop_lost()

    # ---- inside

    def _change(self, component: Participant, ask: Ask, sync: bool, timeout: float) -> ReturnCode:
        """A transition of a component, waited for or not."""
        member = self._cycle.find(component)
        if member is None:
            return ReturnCode.BAD_PARAMETER
        if (self._expected(member), ask) not in TRANSITIONS:
            return _NO
        request = Request(ask.value, lambda: self._cycle.ask(member, ask), member, ask)
        return self._ask(request, sync=sync, timeout=timeout)

    def _expected(self, member: Member) -> LifeCycleState:
        """The member's state when all that was asked for before has been done, and done well."""
        state = member.state
        with self._changed:
            for request in self._requests:
                if request.member is member and request.ask is not None:
                    transition = TRANSITIONS.get((state, request.ask))
                    state = transition.to if transition is not None else state
        return state

    def _ask(self, request: Request, *, sync: bool = True, timeout: float = 0.0) -> ReturnCode:
        """Have something done by the conductor, and wait for it if `sync`."""
        if not self._post(request):
            return _NO
        if not sync or is_conducting(self):
            return request.code if request.is_finished else _OK
        seconds = max(timeout, self.options.patience)
        done = wait(request, self, seconds)
        if done or done is None:
            return request.code if request.is_finished else _OK
        return self._called_off(request, seconds)

    def _called_off(self, request: Request, seconds: float) -> ReturnCode:
        """Nobody waits any longer. What only makes things run is taken back if it has not begun."""
        with self._changed:
            back = request in self._requests and request.ask in (Ask.ACTIVATE, Ask.RESET)
            if back:
                self._requests.remove(request)
        subject = name_of(request.member.participant) if request.member is not None else ""
        whose = f"{request.what} of {subject}" if subject else request.what
        self._note(
            "rtc-transition-slow",
            f"{whose} has not ended within {seconds:g} s",
            "it was called off, as another callback of the context still runs"
            if back
            else "a callback still runs",
            "Let callbacks return soon, or raise transition_timeout of the context",
            subject,
        )
        return request.code if request.is_finished else ReturnCode.RTC_ERROR

    def _tell_running(self) -> ReturnCode:
        """Let the components know whether the context runs, if that has changed; for the conductor."""
        if self._started is not self._running:
            self._started = not self._started
            if self._started:
                self._cycle.startup()
            else:
                self._schedule.stop()
                self._cycle.shutdown()
        return _OK

    def _admit(self, member: Member) -> ReturnCode:
        if not self._cycle.admit(member):
            return _NO
        if self._started:
            self._cycle.startup((member,))
        return _OK

    def _removal(self, member: Member) -> Request:
        def work() -> ReturnCode:
            self._cycle.dismiss(member, running=self._started)
            return _OK

        return Request("letting a component go", work)

    def _drop_lost(self) -> None:
        if self._cycle.has_lost:
            self._cycle.has_lost = False
            for member in self._cycle.members:
                if member.lost:
                    self._cycle.dismiss(member, running=False)

    def _tell(self, event: ContextEvent) -> None:
        for observer in tuple(self._observers.values()):
            try:
                observer(event)
            except Exception as error:
                self._note(
                    "rtc-observer-raised",
                    f"a listener of its events failed at {event.kind.value}",
                    f"{type(error).__name__}: {error}",
                    severity=Severity.ERROR,
                )

    def _note(
        self,
        code: str,
        what: str,
        why: str = "",
        remedy: str = "",
        subject: str = "",
        severity: Severity = Severity.WARNING,
    ) -> None:
        self._report(Finding(code, str(self), what, why, remedy, severity, subject))

    def _report(self, finding: Finding) -> None:
        with suppress(Exception):  # who is told of failures has failed: there is nobody left to tell
            self._report_to(finding)
