"""What programs ask of executors and of what they run now and then. Boards borrow this."""

from muros.compat import borrow, const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.client import Client
    from muros.rclc.executor import Executor
    from muros.rclc.timer import Timer

_TIMEOUT = const(10)  # seconds
_ON_NEW_DATA = const(0)


def add(
    self: "Executor",
    handle: "Any",
    callback: "Callable[..., object] | None" = None,
    when: int = _ON_NEW_DATA,
    let: float = 0,
    messages: int = 0,
) -> None:
    """Runs a handle from now on, and no other executor does, behind those added before; with ``callback`` if given.

    ``when`` ALWAYS calls a subscription in each pass, with None when nothing has come. ``let``, in seconds, is how long
    an executor with LET gives the callback (0: one period), ``messages`` how many one publisher may publish meanwhile
    (0: as the executor says). Raises CapacityError when the executor is full, HandleError for what it cannot run.
    """
    if self.handles is self.context.handles:
        self.handles = []
    borrow("muros.rclc.handle_error").check_new(self, handle)
    handle.eager = self.trigger is None
    if when or self.let is not None:
        borrow("muros.rclc.periods").prepare(self, handle, when, let, messages)
    _leave(handle)
    if callback is not None:
        handle.callback = callback
    handle.handles = self.handles
    self.handles.append(handle)


def remove(self: "Executor", handle: "Any") -> None:
    """Runs a handle no more; the others keep their order. HandleError when it is not here."""
    borrow("muros.rclc.handle_error").check_there(self, handle)
    self.handles.remove(handle)


def stop(self: "Executor") -> None:
    """Ends ``spin`` and ``spin_period`` when the pass that runs, or with LET the period, is over."""
    self.stopped = True


def destroy(self: "Any") -> None:
    """Takes a handle away, with all that waits."""
    _leave(self)
    if self.entity is not None:
        self.entity.destroy()
    self.cancelled = True  # a timer
    self.depth = 0  # a service
    self._waiting = self._answers = self._asked = []


def exchange_period(self: "Timer", period: float) -> float:
    """Sets the period in seconds, used from the next call on; returns the old one."""
    old = self.period / 1000
    self.period = int(period * 1000 + 0.5)
    return old


def call(self: "Client", request: "Any", timeout: float = _TIMEOUT) -> "Any":
    """Sends a request and waits for its response; None when it does not come within ``timeout`` seconds.

    Not for callbacks: those run in an executor, where ``send`` belongs.
    """
    answers: "list[Any]" = []
    context = self.context
    middleware = context.middleware
    end = ticks_add(context.clock(), int(timeout * 1000))
    sent = False
    while not answers:
        now = context.clock()
        left = ticks_diff(end, now)
        if left <= 0:
            return None
        middleware.spin_once(now)
        sent = sent or (self.entity.room() and self.send(request, answers.append, timeout))
        if self.ready(now):
            self.run(now)
        else:
            middleware.wait(min(left, middleware.deadline(now)))
    return answers[0]


def wait_for_service(self: "Client", timeout: float = _TIMEOUT) -> bool:
    """Waits until somebody serves what is asked, at most ``timeout`` seconds; whether somebody does. Not for callbacks.

    Through an agent that publishes the graph, as that of muros and that of micro-ROS do; see ``graph``.
    """
    from muros.rclc.graph import wait_for_service as wait

    return wait(self, timeout)


def __getattr__(name: str) -> "Any":
    return getattr(borrow("muros.rclc.periods"), name)


def _leave(handle: "Any") -> None:
    """Takes a handle out of the list of its executor, or of what none has claimed."""
    handles = handle.handles or handle.context.handles
    if handle in handles:
        handles.remove(handle)
