"""Contexts with a thread of their own: periodic ones, and those that run when something triggers them.

Theory of operation. The thread is the conductor. It does what was asked, then, if the context runs and somebody is
active or in Error, a pass when one is due; otherwise it waits for a request and costs nothing. To be on time it sleeps
to the deadline itself, less what the system usually wakes it too late by (`Anticipation`); only a wait that is long
enough for somebody to become impatient is one on the condition, which requests end early. So a component is activated
at once also where passes are seconds apart.

Threads of Python run one at a time, and one that computes lets others on after 5 ms by default: a context at 1 kHz
would reach 185 Hz beside it. A periodic context therefore shortens that time for the process.
"""

from __future__ import annotations

import sys
import threading
import time
from typing import Any, ClassVar, Final

from muros.rtc.codes import ExecutionKind, ReturnCode
from muros.rtc.contexts._context import ExecutionContext
from muros.rtc.contexts._requests import Request, conducting
from muros.rtc.contexts._schedule import Anticipation

__all__ = ["EventDrivenExecutionContext", "ExtTrigExecutionContext", "PeriodicExecutionContext"]

_SLEEP: Final = 0.02
"""Seconds before a deadline from which on the thread sleeps and requests wait."""


_TURNS: Final = 10
"""Times in a period that a thread of Python which computes is to let others on."""

_SHORTEST_TURN: Final = 1e-4
"""Seconds; what is shorter costs all threads more than it gives."""


class _ThreadedContext(ExecutionContext):
    """The thread, its beginning and its end."""

    _thread: threading.Thread | None = None
    _ending = False
    _over = False

    def _post(self, request: Request) -> bool:
        with self._changed:
            if self._over:
                return False
            self._requests.append(request)
            if self._thread is None:
                self._thread = threading.Thread(target=self._main, name=f"rtc {self}", daemon=True)
                self._thread.start()
            self._changed.notify_all()
        return True

    def _end(self) -> None:
        with self._changed:
            self._ending = True
            self._over |= self._thread is None
            self._changed.notify_all()
            thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(self.options.patience)

    def _main(self) -> None:
        with conducting(self):
            self._be_scheduled()
            while True:
                self._serve()
                with self._changed:
                    if self._ending and not self._requests:
                        self._over = True
                        break
                self._turn()
        self._stopped()

    def _turn(self) -> None:
        """Wait for what comes next, a request or a pass that is due, and run the pass."""
        raise NotImplementedError

    def _stopped(self) -> None:
        """The thread ends."""

    def _wakes(self) -> bool:
        """Whether the thread is asked for something; with the lock."""
        return self._ending or bool(self._requests)

    def _be_scheduled(self) -> None:
        """Have the system treat the calling thread as the options say; what it does not permit is a finding."""
        options = self.options
        if not options.cpus and not options.policy:
            return
        from muros.rclc.scheduling import apply, fifo, round_robin

        policy = None
        if options.policy:
            make = fifo if options.policy == "FIFO" else round_robin
            policy = make(options.priority) if options.priority else make()
        problem = apply(policy, options.cpus or None)
        if problem:
            self._note(
                "rtc-context-not-scheduled",
                "its thread is not scheduled as asked",
                problem,
                "It runs as other threads do; permit it, or take scheduling and cpu_affinity out",
            )


class PeriodicExecutionContext(_ThreadedContext):
    """A pass every period, on an absolute schedule. RTC 1.1, 5.3.1.

    Passes that come too late are left out, but for `ContextOptions.catch_up` of them.
    """

    kind: ClassVar[ExecutionKind] = ExecutionKind.PERIODIC
    registered_name: ClassVar[str] = "PeriodicExecutionContext"

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._anticipation: Final = Anticipation()

    def set_rate(self, rate: float) -> ReturnCode:
        """Another rate; see `ExecutionContext.set_rate`."""
        code = super().set_rate(rate)
        self._take_turns()
        return code

    def _turn(self) -> None:
        schedule = self._schedule
        with self._changed:
            if not (self._running and self._cycle.busy):
                schedule.stop()
                while not self._wakes():
                    self._changed.wait()
                return
            if not schedule.is_started:
                self._take_turns()
                schedule.start(self._clock())
            long = schedule.deadline - self._clock() - _SLEEP
            if long > 0:
                self._changed.wait_for(self._wakes, long)
            if self._wakes():
                return
        self._sleep_until(schedule.deadline)
        if self._requests:
            self._serve()
        if self._running and self._cycle.busy:
            self._pass()

    def _take_turns(self) -> None:
        """Have the interpreter let threads on often enough for this one to be on time."""
        wanted = self.options.switch_interval
        if wanted is None:
            wanted = max(_SHORTEST_TURN, 1.0 / (_TURNS * self.rate))
        if 0 < wanted < sys.getswitchinterval():
            sys.setswitchinterval(wanted)

    def _sleep_until(self, deadline: float) -> None:
        early = self._anticipation
        moment = deadline - early.seconds
        left = moment - self._clock()
        time.sleep(max(left, 0.0))  # a thread that is late gives way to others, too
        if left > 0:
            now = self._clock()
            early.learn(now - moment)
            while now < deadline:
                now = self._clock()


class ExtTrigExecutionContext(_ThreadedContext):
    """A pass at every `tick`, in its own thread; components change state without one.

    A tick that comes while another waits for its pass makes none of its own, but is counted. The rate is only what is
    told: the ticks decide.
    """

    kind: ClassVar[ExecutionKind] = ExecutionKind.PERIODIC
    registered_name: ClassVar[str] = "ExtTrigExecutionContext"
    _ticked = False

    def tick(self) -> ReturnCode:
        """A pass as soon as the one that runs is over; does not wait for it. PRECONDITION_NOT_MET: it does not run."""
        with self._changed:
            if not self._running:
                return ReturnCode.PRECONDITION_NOT_MET
            if self._ticked:
                self._collapsed += 1
            self._ticked = True
            self._changed.notify_all()
        return ReturnCode.RTC_OK

    def _turn(self) -> None:
        with self._changed:
            while not self._ticked and not self._wakes():
                self._changed.wait()
            if self._wakes():
                return
            self._ticked = False
        if self._running:
            self._pass()


class EventDrivenExecutionContext(ExtTrigExecutionContext):
    """A pass whenever something has happened: `tick` says so. RTC 1.1, 5.3.2 (stimulus response)."""

    kind: ClassVar[ExecutionKind] = ExecutionKind.EVENT_DRIVEN
    registered_name: ClassVar[str] = "EventDrivenExecutionContext"
