"""The executor of hosts: what boards have, checks, errors that say whose they are, and the same for asyncio programs.

Theory of operation. Each way of spinning is written once, as a generator that makes passes and yields how many
milliseconds it may wait in between. Who waits is somebody else: ``_drive`` has the middleware wait, ``_drive_async``
an asyncio program (see ``host.awaiting``). So both do the same at the same times.

A pass lets the middleware work, asks the trigger, and runs what is ready in the order of adding. With LET a pass is
a period, see ``let`` and ``host.let``.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Generator
from typing import Any, TypeVar

from muros.client.session import Session
from muros.rclc import context as context_
from muros.rclc import executor as executor_
from muros.rclc import handles
from muros.rclc.errors import RclError
from muros.rclc.handle_error import HandleError
from muros.rclc.host.awaiting import Sleeper, pause
from muros.rclc.host.checks import WrongTypeError, WrongValueError, be_callable, be_handle
from muros.rclc.host.handles import describe, tell_problem, ticks
from muros.rclc.host.let import HostLet, HostTask
from muros.rclc.overruns import GO_ON, LOW_PRIORITY
from muros.rclc.semantics import ALWAYS, LET, ON_NEW_DATA, RCLCPP

CALLBACK = 51
"""The code with which ``on_problem`` is told that a callback has raised, by executors that go on."""

Trigger = Callable[[list[Any]], bool]
OnError = Callable[[Any, Exception], object]
Result = TypeVar("Result")
Steps = Generator[float, None, Result]
"""What runs an executor: yields milliseconds that may pass."""


class Executor(executor_.Executor):
    """Runs the handles of a context, in the order of adding; without ``add`` what no other executor has claimed.

    - ``handles`` bounds how many may be added, 0: any number.
    - ``trigger(handles)`` decides before each pass whether anything is taken; see ``triggers``.
    - ``semantics``: RCLCPP or LET. ``period``, in seconds, is that of ``spin_period`` and of LET's ``spin``.
    - ``timeout``: seconds that one round of ``spin`` waits at most.
    - ``on_error``: what happens when a callback raises. None: ``spin`` raises it, with a note whose callback it was.
      GO_ON: it is told to ``on_problem`` and counted in ``errors``. A function is called with the handle and the error,
      and the executor goes on if it returns True.
    - With LET: ``overrun`` is GO_ON, CANCEL_CURRENT, CANCEL_WITHOUT_OUTPUT, CANCEL_NEXT or LOW_PRIORITY; ``messages``
      how many one publisher may publish in one run; ``on_overrun(task, seconds)`` is told of each.

    Ctrl-C ends ``spin`` and ``spin_period``: they take leave of the graph and return. Raises TypeError and ValueError.
    """

    def __init__(
        self,
        context: context_.Context,
        handles: int = 0,
        trigger: Trigger | None = None,
        *,
        semantics: int = RCLCPP,
        period: float | None = None,
        timeout: float = 1.0,
        on_error: OnError | int | None = None,
        overrun: int = GO_ON,
        messages: int = 10,
        on_overrun: Callable[[HostTask, float], object] | None = None,
    ) -> None:
        if not isinstance(context, context_.Context):
            raise WrongTypeError(f"Executor needs a context, not {context!r}")
        _be_count(handles, 0, "handles", "how many may be added, or 0 for any number")
        _be_count(messages, 1, "messages", "how many one publisher may publish in one run, at least 1")
        for function, name in ((trigger, "trigger"), (on_overrun, "on_overrun")):
            if function is not None:
                be_callable(function, name)
        if on_error not in (None, GO_ON):
            be_callable(on_error, "on_error")
        if semantics not in (RCLCPP, LET):
            raise WrongValueError(f"semantics is {semantics!r}: it must be RCLCPP or LET")
        if overrun not in range(GO_ON, LOW_PRIORITY + 1):
            raise WrongValueError(
                f"overrun is {overrun!r}: it must be GO_ON, CANCEL_CURRENT, CANCEL_WITHOUT_OUTPUT, CANCEL_NEXT or "
                "LOW_PRIORITY"
            )
        super().__init__(context, handles, trigger)
        self.period = 0.0 if period is None else _milliseconds(period)
        self.timeout = _milliseconds(timeout, "timeout")
        self.on_error = on_error
        self.errors = 0
        self.on_overrun = on_overrun
        self.let: HostLet | None = HostLet(self, self.period, overrun, messages) if semantics == LET else None
        self.always: list[Any] = []
        """The subscriptions that are called in each pass."""
        self.sleeper: Sleeper | None = None
        """What waits in an asyncio program."""
        self.period_end: float | None = None

    # What is run

    def add(
        self,
        handle: Any,
        callback: Callable[..., object] | None = None,
        when: int = ON_NEW_DATA,
        let: float = 0.0,
        messages: int = 0,
    ) -> None:
        """Runs a handle from now on, behind those added before; with ``callback`` in place of its own.

        One executor runs it: if another one of the context did, that one does no more.

        ``when`` ALWAYS calls a subscription in each pass, with None when nothing has come. With LET, ``let`` is how
        many seconds the callback has from the start of the period (0: the period), ``messages`` how many one
        publisher may publish meanwhile (0: as the executor says).

        Raises CapacityError when the executor is full, HandleError for a handle of another context and for one that is
        here already, TypeError for anything else.
        """
        be_handle(handle)
        if callback is not None:
            be_callable(callback, "the callback of a handle")
        if when not in (ON_NEW_DATA, ALWAYS):
            raise WrongValueError(f"when is {when!r}: it must be ON_NEW_DATA or ALWAYS")
        if (let or messages) and self.let is None:
            raise WrongValueError(
                "let and messages are for executors with LET: Executor(context, semantics=LET)"
            )
        if let:
            _milliseconds(let, "let")
        _be_count(messages, 0, "messages", "how many one publisher may publish in one run")
        if handle.context is not self.context:
            raise HandleError(
                f"{describe(handle)}, belongs to another context: an executor runs handles of its own"
            )
        if handle in self.handles and self.handles is not self.context.handles:
            raise HandleError(f"{describe(handle)}, was added already: an executor runs each handle once")
        if when == ALWAYS and not handle.take:
            raise HandleError(f"{describe(handle)}, cannot run ALWAYS: only subscriptions can")
        handles.add(self, handle, callback)
        if self.let is not None:
            task = self.let.task(handle)
            task.let = round(let * 1000, 6)  # type: ignore[assignment]  # boards count whole ones
            task.always = when == ALWAYS
            task.messages = messages or self.let.messages
        elif when == ALWAYS:
            self.always.append(handle)

    def add_node(self, node: context_.Node) -> None:
        """Adds what was made on a node and no other executor has, in the order of making.

        Raises CapacityError when the executor is full, HandleError for a node of another context.
        """
        if node.context is not self.context:
            raise HandleError(
                f"node {node.name!r} belongs to another context: an executor runs handles of its own"
            )
        for handle in list(self.context.handles):
            if handle in node.entities:
                self.add(handle)

    def remove(self, handle: Any) -> None:
        """Runs a handle no more; the others keep their order.

        Raises HandleError (``code`` 1) when it is not here, TypeError for what is no handle.
        """
        be_handle(handle)
        if handle not in self.handles:
            error = HandleError(f"{describe(handle)}, is not in this executor")
            error.code = RclError.code
            raise error
        handles.remove(self, handle)
        if handle in self.always:
            self.always.remove(handle)
        if self.let is not None:
            self.let.drop(handle)

    @property
    def tasks(self) -> list[HostTask]:
        """With LET: what is known of each handle, in the order of adding."""
        return [] if self.let is None else [self.let.task(handle) for handle in self.handles]

    @property
    def overruns(self) -> int:
        """With LET: how many callbacks ended behind their let."""
        return 0 if self.let is None else self.let.overruns

    # Spinning

    def spin(self) -> None:
        """Runs until the context is closed, ``stop`` is called or Ctrl-C is pressed."""
        try:
            self._drive(self._spin())
        except KeyboardInterrupt:
            self.context.close()

    def spin_some(self, timeout: float | None = 0.0) -> bool:
        """Waits until something is ready and makes one pass; whether anything ran.

        At most ``timeout`` seconds, None: as long as it takes.
        """
        patience = _patience(timeout)
        if patience > 0:
            return self._drive(self._round(patience))
        ran = self.work(self.context.clock(), True)
        self.stopped = False
        return ran

    spin_once = spin_some

    def round(self, timeout: int) -> bool:
        """``spin_some`` with ``timeout`` in ms."""
        return self.spin_some(timeout / 1000)

    def spin_until(self, condition: Callable[[], object], timeout: float | None = None) -> bool:
        """Runs until ``condition()`` is true, at most ``timeout`` seconds; whether it is.

        With LET and a period it runs whole periods, as ``spin`` does.
        """
        return self._drive(self._until(condition, timeout))

    def spin_one_period(self, period: float | None = None) -> None:
        """Makes one pass and waits for the end of the period.

        The first period begins now, each other one where the last has ended: late ones are caught up.
        """
        self._drive(self._one_period(self._period(period)))

    def spin_period(self, period: float | None = None) -> None:
        """Makes one pass each ``period`` seconds, until the context is closed, ``stop`` is called or Ctrl-C pressed."""
        ms = self._period(period)
        try:
            self._drive(self._periods(ms))
        except KeyboardInterrupt:
            self.context.close()

    async def spin_async(self) -> None:
        """``spin`` beside the other tasks of an asyncio program. Cancelling the task ends it."""
        await self._drive_async(self._spin())

    async def spin_some_async(self, timeout: float | None = 0.0) -> bool:
        """``spin_some`` beside the other tasks of an asyncio program."""
        return await self._drive_async(self._round(_patience(timeout)))

    async def spin_until_async(self, condition: Callable[[], object], timeout: float | None = None) -> bool:
        """``spin_until`` beside the other tasks of an asyncio program."""
        return await self._drive_async(self._until(condition, timeout))

    async def spin_one_period_async(self, period: float | None = None) -> None:
        """``spin_one_period`` beside the other tasks of an asyncio program."""
        await self._drive_async(self._one_period(self._period(period)))

    async def spin_period_async(self, period: float | None = None) -> None:
        """``spin_period`` beside the other tasks of an asyncio program. Cancelling the task ends it."""
        await self._drive_async(self._periods(self._period(period)))

    def stop(self) -> None:
        """Ends what spins when the pass that runs, or with LET the period, is over; from any thread.

        Called while nothing spins it ends the next one as soon as it would wait. The context stays open.
        """
        self.stopped = True
        self.wake()
        if self.sleeper is not None:
            self.sleeper.rouse()

    def wake(self) -> None:
        """Ends a wait, from any thread, as far as the middleware can be woken."""
        wake = getattr(self.context.middleware, "wake", None)
        if wake is not None:
            wake()

    # Passes

    def work(self, now: int, late: bool = False) -> bool:
        """Lets the middleware work and makes one pass at ``now``; whether anything ran.

        ``late``: the pass is due, so a trigger that does not ask for news has its ALWAYS subscriptions called.
        """
        trigger = self.trigger
        self._serve(now)
        if self.let is not None:
            return bool(self.let.work(now, late))
        if self.always:
            if not self._wanted(now, late):
                return False
        elif trigger is not None and not self._triggered(trigger):
            return False
        ran = False
        always, handles = self.always, self.handles
        for handle in handles[:]:  # a callback may take handles away
            if (handle.ready(now) or handle in always) and handle in handles:
                ran = True
                try:
                    handle.run(now)
                except Exception as error:
                    if not self.survives(handle, error):
                        raise
        return ran

    def survives(self, handle: Any, error: Exception, where: str = "") -> bool:
        """Whether the executor goes on although a callback of a handle has raised; says whose it was, or ``where``."""
        self.errors += 1
        where = where if handle is None else describe(handle)
        if where:
            error.add_note(f"raised by {where}")
        if self.on_error is None:
            return False
        if callable(self.on_error):
            return bool(self.on_error(handle, error))
        if self.errors & (self.errors - 1) == 0:
            who = f"{where}," if where else "a callback"
            told = f"{who} raised {_line(error)}. The executor goes on, {self.errors} so far."
            tell_problem(self.context, CALLBACK, told)
        return True

    def _wanted(self, now: int, late: bool) -> bool:
        """Whether there is to be a pass, where subscriptions are called without news too."""
        news = any(handle.ready(now) for handle in self.handles)
        if self.trigger is None:
            return news
        return (news or late) and self._triggered(self.trigger)

    def _triggered(self, trigger: Trigger) -> bool:
        """What a trigger says; no when it raises and the executor goes on."""
        try:
            return trigger(self.handles)
        except Exception as error:
            if not self.survives(None, error, "the trigger"):
                raise
            return False

    # Ways of spinning

    def _spin(self) -> Steps[None]:
        if self.let is not None and self.period:
            yield from self._periods(self.period)
            return
        while self._going():
            yield from self._round(self.timeout)
            yield 0.0

    def _round(self, timeout: float, over: Callable[[], object] | None = None) -> Steps[bool]:
        """Waits for one pass, at most ``timeout`` ms and until ``over()``; asked whenever anything has come."""
        context = self.context
        now = context.clock()
        end = now + timeout
        while not self.work(now, now >= end):
            if now >= end or not self._going() or (over is not None and over()):
                return False
            left = min(end - now, context.middleware.deadline(now))
            for handle in self.handles:
                left = min(left, handle.left(now))
            yield left
            now = context.clock()
        return True

    def _until(self, condition: Callable[[], object], timeout: float | None) -> Steps[bool]:
        be_callable(condition, "the condition of spin_until")
        end = self.context.clock() + _patience(timeout)
        self.period_end = None
        while not condition():
            left = end - self.context.clock()
            if left <= 0 or not self._going():
                return False
            if self.let is not None and self.period:
                yield from self._one_period(self.period)
            else:
                yield from self._round(min(left, self.timeout), condition)
            yield 0.0
        return True

    def _periods(self, period: float) -> Steps[None]:
        self.period_end = None
        try:
            while self._going():
                yield from self._one_period(period)
                yield 0.0
        finally:
            if self.let is not None:
                self.let.close()

    def _one_period(self, period: float) -> Steps[None]:
        clock = self.context.clock
        start = clock() if self.period_end is None else self.period_end
        self.period_end = end = start + period
        let = self.let
        if let is None:
            self.work(clock(), True)
        else:
            self._serve(clock())
            let.begin(start, period)
        now = clock()
        while now < end and self.context.running and not (let is None and self.stopped):
            yield min(end - now, max(self.context.middleware.deadline(now), 0))
            now = clock()
            self._serve(now)
        if let is not None:
            let.finish()

    def _serve(self, now: int) -> None:
        """Lets the middleware work; what a callback has raised meanwhile is told or comes out."""
        if self.trigger is not None or self.let is not None:
            for handle in self.handles:
                handle.eager = False  # those that nobody has added, too
        try:
            self.context.middleware.spin_once(now)
        except Exception as error:
            if not self.survives(getattr(error, "raised_by", None), error):
                raise

    def _going(self) -> bool:
        return self.context.running and not self.stopped

    def _drive(self, steps: Steps[Result]) -> Result:
        """Has the middleware wait between the steps."""
        try:
            while True:
                left = next(steps)
                if left > 0:
                    self._wait(left)
        except StopIteration as done:
            result: Result = done.value
            return result
        finally:
            self.stopped = False

    async def _drive_async(self, steps: Steps[Result]) -> Result:
        """Has the running asyncio loop go on between the steps."""
        try:
            while True:
                await pause(self, next(steps))
        except StopIteration as done:
            result: Result = done.value
            return result
        finally:
            self.stopped = False

    def _wait(self, left: float) -> None:
        """Waits until something may have come, at most so many ms."""
        middleware = self.context.middleware
        if not isinstance(middleware, Session):
            middleware.wait(left)  # type: ignore[arg-type]  # boards count whole ones
        elif left >= 1:
            middleware.wait(int(left))
        elif self.context.clock is ticks:
            time.sleep(left / 1000)  # transports count whole ones
        else:
            middleware.wait(1)

    def _period(self, period: float | None) -> float:
        if period is not None:
            return _milliseconds(period)
        if not self.period:
            raise WrongValueError(
                "there is no period: give one, spin_period(0.01) or Executor(context, period=0.01)"
            )
        return self.period


def _milliseconds(seconds: Any, name: str = "period") -> float:
    if not isinstance(seconds, int | float) or not 0 < seconds < math.inf:
        raise WrongValueError(f"{name} is {seconds!r}: it must be a number of seconds above 0")
    return round(seconds * 1000, 6)


def _patience(seconds: float | None) -> float:
    if seconds is None:
        return math.inf
    if not isinstance(seconds, int | float) or math.isnan(seconds):
        raise WrongValueError(f"timeout is {seconds!r}: it must be a number of seconds, or None for no limit")
    return seconds * 1000


def _be_count(count: Any, least: int, name: str, what: str) -> None:
    if not isinstance(count, int) or count < least:
        raise WrongValueError(f"{name} is {count!r}: it must be {what}")


def _line(error: Exception) -> str:
    """An error in one line, with the place where it was raised."""
    place, trace = "", error.__traceback__
    while trace is not None:
        place = f" ({os.path.basename(trace.tb_frame.f_code.co_filename)}:{trace.tb_lineno})"
        trace = trace.tb_next
    text = " ".join(str(error).split())
    return f"{type(error).__name__}{': ' if text else ''}{text}{place}"
