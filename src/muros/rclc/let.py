"""Logical execution time (LET): when a program reads and writes does not depend on how long it computes.

Time is divided into periods. At the start of a period every handle takes what is there; then the callbacks run, in the
order of adding, each on what was taken; what they publish, answer and ask is held back and leaves at the end of the
period, in the order of adding. So the same inputs give the same outputs at the same instants, whether the computer is
quick or slow, as long as no callback is later than its *let*: the time that it has from the start of the period.

A let may be longer than the period. It is rounded up to whole periods: so long the callback is not called again, and
its outputs leave at the end of the last of them.

A callback that ends later than its let overruns. That is counted, told, and has the consequence that ``overrun`` names.
An executor without a period has periods as long as its passes are: outputs leave at the end of the pass.

Boards load this only for executors that ask for it. There what is published is held back by standing in for the
backlog of the session, see ``let_outputs``; hosts do it for each thread, see ``host.let``.
"""

from muros.compat import const, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.rclc.executor import Executor

OVERRUN = 50
"""The code with which ``on_problem`` is told of an overrun."""

_CANCEL_CURRENT = const(2)
_CANCEL_WITHOUT_OUTPUT = const(3)
_CANCEL_NEXT = const(4)


class Task:
    """One handle of an executor with LET.

    ``state`` is INACTIVE, RELEASED (it has taken its input) or RUNNING, until its let is over; ``result``, of its last
    run, NO_ERROR, OVERRUN or HANDLING_ERROR (its callback has raised, and nothing of what it published leaves).
    ``overruns`` counts; ``skipped`` counts runs that were cancelled, ``lost`` outputs that could not leave.
    ``let`` is in ms, 0 for the period; ``messages`` is how many one publisher may publish in one run.
    """

    state = "INACTIVE"
    result = "NO_ERROR"
    took = 0  # ms, the last run
    overruns = 0
    skipped = 0
    lost = 0
    input: "Any" = None
    released = 0  # the tick at which the period began in which it was released
    begun = 0  # the number of that period
    end = 0  # the number of the period at whose end its outputs leave

    def __init__(self, handle: "Any", let: int, messages: int) -> None:
        self.handle = handle
        self.let = let
        self.messages = messages
        self.always = False
        self.outputs: "list[Any]" = []


class Let:
    """The periods of an executor, in ms.

    ``outputs`` holds back what is published from ``open(task)`` to ``close(what open gave)``, until ``flush(task)``.
    """

    def __init__(
        self, executor: "Executor", period: int, overrun: int, messages: int, outputs: "Any"
    ) -> None:
        self.executor = executor
        self.period = period
        self.overrun = overrun
        self.messages = messages
        self.outputs = outputs
        self.overruns = 0
        self._tasks: "dict[Any, Task]" = {}
        self._released: "list[Task]" = []  # what this period calls, in the order of adding
        self._number = 0
        self._start = 0
        self._skip = False
        self._calling = False

    def task(self, handle: "Any") -> Task:
        """The task of a handle, made at the first need."""
        task = self._tasks.get(handle)
        if task is None:
            task = self._tasks[handle] = Task(handle, 0, self.messages)
            handle.eager = False
        return task

    def drop(self, handle: "Any") -> None:
        """Forgets a handle, and what it has yet to publish."""
        self._tasks.pop(handle, None)

    def work(self, now: int, due: bool = True) -> bool:
        """A whole period at once, of what the middleware has handed on; whether anything ran.

        If it is not ``due``, then only when there is news.
        """
        ran = self.start(now, False, due)
        self.execute()
        self.finish()
        return ran

    def start(self, now: int, timed: bool = True, due: bool = True) -> bool:
        """Starts a period at the tick ``now``: reads all inputs. Whether there is anything to call.

        A period that is ``timed`` ends at a time of its own: callbacks may be too late.
        """
        if self._calling:
            from muros.rclc.errors import RclError

            raise RclError("an executor with LET cannot be spun by one of its callbacks")
        self._number += 1
        self._start = now
        self._timed = timed
        executor = self.executor
        if len(self._tasks) > len(executor.handles):
            for handle in list(self._tasks):
                if handle not in executor.handles:
                    self.drop(handle)
        if self._skip:
            self._skip = False
            return False
        ready: "list[Task]" = []
        news = False
        for handle in executor.handles:
            task = self.task(handle)
            if task.state == "INACTIVE":
                if handle.ready(now):
                    news = True
                elif not task.always:
                    continue
                ready.append(task)
        if executor.trigger is None:
            if not news:
                return False
        elif not (news or due) or not executor.trigger(executor.handles):
            return False
        for task in ready:
            if task.handle.take:
                task.input = task.handle.take()
            task.state = "RELEASED"
            task.begun = task.end = self._number
            task.released = now
            if self.period and task.let > self.period:
                task.end += -(-task.let // self.period) - 1
        self._released = ready
        return len(ready) > 0

    def execute(self) -> None:
        """Calls what was released."""
        while self._released:
            task = self._released.pop(0)
            clock = self.executor.context.clock
            begun = clock()
            self.call(task)
            if self._timed:
                now = clock()
                task.took = ticks_diff(now, begun)
                late = ticks_diff(now, self._start) - (task.let or self.period)
                if late > 0:
                    self.late(task, late)

    def call(self, task: Task) -> None:
        """Calls the callback of a task."""
        task.state = "RUNNING"
        task.result = "NO_ERROR"
        self._calling = True
        outer = self.outputs.open(task)
        try:
            self.run(task)
        except Exception as error:
            task.result = "HANDLING_ERROR"
            task.outputs.clear()
            if not self.survives(task, error):
                self.cancel()
                raise
        finally:
            self.outputs.close(outer)
            self._calling = False
            task.input = None

    def run(self, task: Task) -> None:
        """Has a handle work on what was taken."""
        handle = task.handle
        if handle not in self.executor.handles:
            return  # a callback of this period has taken it away
        if not handle.take:
            handle.run(self._start)
        elif handle.callback is not None:
            handle.callback(task.input)

    def survives(self, task: Task, error: Exception) -> bool:
        """Whether the executor goes on although a callback has raised."""
        on_error = self.executor.on_error
        return on_error is not None and bool(on_error(task.handle, error))

    def cancel(self) -> None:
        """Calls no more in this period."""
        for task in self._released:
            task.state = "INACTIVE"
            task.input = None
            task.skipped += 1
        self._released = []

    def late(self, task: Task, late: int) -> None:
        """A task has ended ``late`` ms behind its let: counts, tells, and does what follows."""
        task.overruns += 1
        self.overruns += 1
        if task.result == "NO_ERROR":
            task.result = "OVERRUN"
        self.tell(task, late)
        if self.overrun == _CANCEL_NEXT:
            self._skip = True
        elif self.overrun == _CANCEL_CURRENT or self.overrun == _CANCEL_WITHOUT_OUTPUT:
            self.cancel()
            if self.overrun == _CANCEL_WITHOUT_OUTPUT:
                for handle in self._tasks:
                    other = self._tasks[handle]
                    if other.begun == self._number:
                        other.outputs.clear()

    def tell(self, task: Task, late: int) -> None:
        """Tells of an overrun, the 1st, 2nd, 4th, 8th... time."""
        told = self.executor.context.middleware.on_problem
        if told is not None and task.overruns & task.overruns - 1 == 0:
            told(
                OVERRUN,
                "a callback took %d ms and ended %d ms behind its let of %d ms, for the %d. time"
                % (task.took, late, task.let or self.period, task.overruns),
            )

    def finish(self) -> None:
        """Ends a period: what is due leaves."""
        for handle in list(self.executor.handles):
            task = self._tasks.get(handle)
            if task is not None and task.state == "RUNNING" and self.over(task):
                task.state = "INACTIVE"
                self.outputs.flush(task)
                task.outputs.clear()

    def over(self, task: Task) -> bool:
        """Whether the let of a task is over."""
        return task.end <= self._number


def attach(executor: "Any", let: Let) -> None:
    """Has an executor of a board make passes that are periods."""
    from muros.rclc.always import replace

    def work(now: int, due: bool = False) -> bool:
        executor.context.middleware.spin_once(now)
        return let.work(now, due)

    executor.let = let
    replace(executor, work)
