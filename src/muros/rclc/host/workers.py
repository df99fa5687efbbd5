"""Workers: one thread for each subscription, with a policy of its own.

    workers = Workers(context)
    workers.add(laser, on_laser, fifo(60))
    workers.add([imu, odometry], fuse, fifo(40))      # fuse(imu, odometry), when both have come
    workers.run()

A worker is READY or BUSY. While it is busy nothing is taken for it: what comes waits in the subscription, as much as
its depth says, and the oldest is dropped. This is the variant of the multi-threaded executor that was proposed for the
C library, with a carrier as dispatcher (see ``sharing``); triggers are new.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from enum import Enum
from typing import Any

from muros.rclc.host.checks import WrongValueError, be_callable
from muros.rclc.host.groups import ExecutorThread, Threads
from muros.rclc.scheduling import Policy
from muros.rclc.semantics import ALWAYS
from muros.rclc.triggers import all_of

__all__ = ["Worker", "WorkerState", "Workers"]


class WorkerState(Enum):
    """What a worker does."""

    READY = "ready"
    BUSY = "busy"
    ENDED = "ended"


class Worker:
    """Made by ``Workers.add``. ``runs`` counts how often its callback was called; ``thread`` is what runs it."""

    def __init__(self, thread: ExecutorThread, callback: Callable[..., object]) -> None:
        self.thread = thread
        self.runs = 0
        self._callback = callback
        self._busy = False

    @property
    def state(self) -> WorkerState:
        """READY, also before it is started; BUSY while the callback runs; ENDED when its thread has."""
        if self._busy:
            return WorkerState.BUSY
        return WorkerState.ENDED if self.thread.error is not None else WorkerState.READY

    def work(self, *messages: Any) -> None:
        """Calls the callback."""
        self._busy = True
        self.runs += 1
        try:
            self._callback(*messages)
        finally:
            self._busy = False


class Workers(Threads):
    """Threads that run one callback each. ``workers`` are those that were added; see ``Threads`` for the rest."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.workers: list[Worker] = []

    def add(
        self,
        subscriptions: Any,
        callback: Callable[..., object] | None = None,
        policy: Policy | None = None,
        *,
        cpus: Collection[int] | None = None,
        trigger: Callable[[list[Any]], bool] | None = None,
        name: str = "",
    ) -> Worker:
        """A worker for a subscription, or for several: then ``callback`` is given a message of each, in their order.

        Of several, ``trigger`` decides when they are taken (None: when each has something); a subscription without
        news gives None then. ``callback`` None is that of the one subscription, ``name`` that of its topic. Raises
        ValueError for none, else as ``Threads.executor``.
        """
        several = isinstance(subscriptions, Iterable)
        handles = list(subscriptions) if several else [subscriptions]
        if not handles:
            raise WrongValueError("a worker needs a subscription: add(subscription, callback)")
        if callback is None:
            callback = None if several else handles[0].callback
            be_callable(callback, "the callback of a worker")
        assert callback is not None
        if several and trigger is None:
            trigger = all_of(*handles)
        thread = self.executor(
            name or " ".join(getattr(handle, "topic", "") or type(handle).__name__ for handle in handles),
            policy,
            cpus=cpus,
            trigger=trigger,
        )
        worker = Worker(thread, callback)
        if several:
            _join(worker, thread, handles)
        else:
            thread.add(handles[0], worker.work)
        self.workers.append(worker)
        return worker


def _join(worker: Worker, thread: ExecutorThread, handles: list[Any]) -> None:
    """Has a worker called once in each pass, with what all handles have given."""
    given: list[Any] = []

    def keep(message: Any) -> None:
        given.append(message)
        if len(given) == len(handles):
            messages = list(given)
            given.clear()
            worker.work(*messages)

    for handle in handles:
        thread.add(handle, keep, when=ALWAYS)
