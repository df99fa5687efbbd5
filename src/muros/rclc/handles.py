"""What programs ask of executors and of what they run now and then. Boards borrow this."""

from muros.compat import const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.client import Client
    from muros.rclc.executor import Executor, Handle
    from muros.rclc.timer import Timer

_TIMEOUT = const(10)  # seconds


def add(self: "Executor", handle: "Any", callback: "Callable[..., object] | None" = None) -> None:
    """Runs a handle from now on, behind those added before; with ``callback`` in place of its own.

    Raises CapacityError when the executor is full.
    """
    if self.handles is self.context.handles:
        self.handles = []
    if self.capacity and len(self.handles) >= self.capacity:
        from muros.rclc.errors import CapacityError

        raise CapacityError(
            "executor is full: %d handles of %d in use. Create it with handles=%d."
            % (self.capacity, self.capacity, self.capacity + 1)
        )
    if handle in self.context.handles:
        self.context.handles.remove(handle)
    if callback is not None:
        handle.callback = callback
    handle.eager = self.trigger is None
    handle.handles = self.handles
    self.handles.append(handle)


def remove(self: "Executor", handle: "Any") -> None:
    """Runs a handle no more; the others keep their order. ValueError when it is not here."""
    self.handles.remove(handle)


def spin_period(self: "Executor", period: float) -> None:
    """Makes one pass each ``period`` seconds until the context is closed; late ones are caught up."""
    due = self.context.clock()
    while self.context.running:
        due = ticks_add(due, int(period * 1000))
        self.work(self.context.clock())
        left = ticks_diff(due, self.context.clock())
        while left > 0:
            self.context.middleware.wait(left)
            self.context.middleware.spin_once(self.context.clock())
            left = ticks_diff(due, self.context.clock())


def destroy(self: "Handle") -> None:
    """Takes a handle away, with all that waits."""
    handles = self.handles or self.context.handles
    if self in handles:
        handles.remove(self)
    if self.entity is not None:
        self.entity.destroy()
    self.cancelled = True  # a timer
    self.depth = 0  # a service
    for name in ("_waiting", "_answers", "_asked"):
        if hasattr(self, name):
            getattr(self, name).clear()


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
    middleware = self.context.middleware
    end = ticks_add(self.context.clock(), int(timeout * 1000))
    sent = False
    while not answers:
        now = self.context.clock()
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
