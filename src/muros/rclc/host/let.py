"""Logical execution time on hosts: what a callback publishes, answers and asks is held back by its thread.

See `let`. A callback that overruns may go on beside the others here (LOW_PRIORITY): then all callbacks run in a
worker thread, one after the other, while the thread of the executor keeps the periods. At the end of a period a
callback that has not ended is late: its worker goes on with low priority, and another one calls what comes behind it.
The late one is not called again before it has ended; its outputs leave at the end of the period in which it does.
"""

from __future__ import annotations

import os
import queue
import threading
import weakref
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from muros.client.raw import Raw
from muros.rclc.errors import CapacityError
from muros.rclc.host.handles import describe, tell_problem
from muros.rclc.host.outlet import body, outlet
from muros.rclc.let import OVERRUN, Let, Task
from muros.rclc.overruns import LOW_PRIORITY

if TYPE_CHECKING:
    from muros.rclc.host.executor import Executor


_LOW = 10
"""How much nicer than the program is what goes on with low priority."""


class HostTask(Task):
    """One handle of an executor with LET; see `muros.rclc.let.Task`. What its callback sends is held back here."""

    done = True
    """Whether its callback has ended."""

    error: Exception | None = None
    """What its callback has raised in a worker."""

    finished = 0.0
    """The tick at which its callback has ended."""

    def publish(self, writer: Any, message: Any) -> bool:
        """Takes a message as it is now. CapacityError when the publisher has published too many."""
        sample = Raw(body(message))
        self.hold(writer, lambda: writer.publish(sample))
        return True

    def hold(self, sender: Any, send: Callable[[], object]) -> None:
        """Has `send` called at the end of the period."""
        count = sum(other is sender for other, _ in self.outputs)
        if count >= self.messages:
            raise CapacityError(
                f"{count} messages of {count} of {sender.name} wait for the end of the period. "
                f"Give add() or the executor messages={count + 1}."
            )
        self.outputs.append((sender, send))


class HostOutputs:
    """What callbacks send, held back for each thread."""

    def open(self, task: HostTask) -> HostTask | None:
        """From now on what this thread sends is held back; by whom it was before."""
        outer, outlet.task = outlet.task, task
        return outer

    def close(self, outer: HostTask | None) -> None:
        """No more, but by whom it was before."""
        outlet.task = outer

    def flush(self, task: HostTask) -> None:
        """Has everything leave that waits."""
        for _, send in task.outputs:
            if send() is False:
                task.lost += 1


class HostLet(Let):
    """The periods of an executor of hosts."""

    executor: Executor

    def __init__(self, executor: Executor, period: float, overrun: int, messages: int) -> None:
        super().__init__(executor, period, overrun, messages, HostOutputs())  # type: ignore[arg-type]
        self._worker: _Worker | None = None
        self._queue: list[HostTask] = []

    def task(self, handle: Any) -> HostTask:
        """The task of a handle, made at the first need."""
        task = self._tasks.get(handle)
        if task is None:
            task = self._tasks[handle] = HostTask(handle, 0, self.messages)
            handle.eager = False
        assert isinstance(task, HostTask)
        return task

    def start(self, now: int, timed: bool = True, due: bool = True) -> bool:
        """Starts a period: reads all inputs. Whether there is anything to call."""
        try:
            return super().start(now, timed, due)
        except Exception as error:
            if not self.executor.survives(None, error, "the trigger or an input at the start of a period"):
                raise
            return False

    def begin(self, start: float, period: float) -> None:
        """Starts a period of so many ms at the tick `start`, and calls what is to be called, or has it called."""
        self.period = period  # type: ignore[assignment]
        self.start(start)  # type: ignore[arg-type]
        if self.overrun != LOW_PRIORITY:
            self.execute()
            return
        for task in self._released:
            assert isinstance(task, HostTask)
            task.state = "RUNNING"
            task.result = "NO_ERROR"
            task.done = False
            self._queue.append(task)
        self._released = []
        self._hand_on()

    def finish(self) -> None:
        """Ends a period: what is due leaves, what is late goes on with low priority."""
        if self.overrun == LOW_PRIORITY:
            self._look()
        super().finish()

    def over(self, task: Task) -> bool:
        """Whether the let of a task is over, and its callback has ended."""
        return super().over(task) and (not isinstance(task, HostTask) or task.done)

    def survives(self, task: Task, error: Exception) -> bool:
        """Whether the executor goes on although a callback has raised."""
        return self.executor.survives(task.handle, error)

    def tell(self, task: Task, late: float) -> None:
        """Tells of an overrun: `on_overrun` each time, `on_problem` the 1st, 2nd, 4th, 8th... time."""
        executor = self.executor
        if executor.on_overrun is not None:
            executor.on_overrun(self.task(task.handle), late / 1000)
        if task.overruns & (task.overruns - 1) == 0:
            tell_problem(executor.context, OVERRUN, self._told(self.task(task.handle), late))

    def _told(self, task: HostTask, late: float) -> str:
        """An overrun in words, with its cause."""
        let = task.let or self.period
        if not task.done:
            what = f"has not ended {late:.3g} ms behind its let of {let:g} ms and goes on with low priority"
        else:
            what = f"took {task.took:.3g} ms and ended {late:.3g} ms behind its let of {let:g} ms"
        cause = "Give it less to do, or more time"
        if task.done and task.took < let:
            cause = "Those before it left it too little: give them less to do, or it more time"
        return (
            f"{describe(task.handle)}, {what}; {task.overruns} so far. "
            f"{cause}: add(..., let=), Executor(..., period=)."
        )

    def close(self) -> None:
        """Ends the worker; a callback that has not ended does so by itself."""
        if self._worker is not None:
            self._worker.end()
            self._worker = None

    # With LOW_PRIORITY

    def _hand_on(self) -> None:
        """Gives a worker what waits to be called."""
        if self._queue:
            if self._worker is None:
                self._worker = _Worker(self)
            for task in self._queue:
                self._worker.orders.put((self, task))
            self._queue = []

    def _look(self) -> None:
        """At the end of a period: who has raised, who was late, who still is."""
        for task in list(self._tasks.values()):
            assert isinstance(task, HostTask)
            if task.state != "RUNNING" or task.end > self._number:
                continue
            if task.done:
                late = task.finished - self._deadline(task)
                if late > 0 and task.result == "NO_ERROR":
                    self.late(task, late)  # type: ignore[arg-type]
                if task.error is not None:
                    self._raised(task)
            elif task.result == "NO_ERROR":
                self.late(task, max(self.executor.context.clock() - self._deadline(task), 0))  # type: ignore[arg-type]
        self._replace()

    def _deadline(self, task: HostTask) -> float:
        return task.released + (task.let or self.period)

    def _raised(self, task: HostTask) -> None:
        error, task.error = task.error, None
        assert error is not None
        task.result = "HANDLING_ERROR"
        task.outputs.clear()
        if not self.survives(task, error):
            task.state = "INACTIVE"
            raise error

    def _replace(self) -> None:
        """Leaves a worker that is busy to its callback, and has another one do what it has not begun."""
        worker = self._worker
        task = None if worker is None else worker.current
        if worker is None or task is None:
            return
        self._worker = None
        while True:
            try:
                waiting = worker.orders.get_nowait()
            except queue.Empty:
                break
            if waiting is not None:
                self._queue.append(waiting[1])
        worker.end()
        if task.result == "OVERRUN":
            worker.lower()
        self._hand_on()


class _Worker:
    """A thread that runs tasks one after the other; while it has none it holds on to nobody."""

    def __init__(self, let: HostLet) -> None:
        self.orders: queue.SimpleQueue[tuple[HostLet, HostTask] | None] = queue.SimpleQueue()
        self.current: HostTask | None = None
        self._thread = threading.Thread(target=self._work, daemon=True, name="muros LET")
        self._thread.start()
        weakref.finalize(let, self.orders.put, None)

    def end(self) -> None:
        """It ends behind what it has been given."""
        self.orders.put(None)

    def lower(self) -> None:
        """From now on it runs behind others, as far as the system knows priorities of threads.

        Not at the lowest: while it runs Python it holds the interpreter's lock, for which the others wait.
        """
        number = self._thread.native_id
        if number is None:
            return
        with suppress(AttributeError, OSError):
            os.sched_setscheduler(number, os.SCHED_OTHER, os.sched_param(0))
            os.setpriority(os.PRIO_PROCESS, number, os.getpriority(os.PRIO_PROCESS, 0) + _LOW)

    def _work(self) -> None:
        while (order := self.orders.get()) is not None:
            self._run(*order)
            del order

    def _run(self, let: HostLet, task: HostTask) -> None:
        self.current = task
        outer = let.outputs.open(task)
        begun = let.executor.context.clock()
        try:
            let.run(task)
        except Exception as error:
            task.error = error
        finally:
            let.outputs.close(outer)
            task.input = None
            task.finished = let.executor.context.clock()
            task.took = task.finished - begun
            self.current = None
            task.done = True
