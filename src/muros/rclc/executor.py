"""The executor: runs what is ready, in the order of adding.

One pass looks at every handle in turn; what is ready gives one piece of work to its callback. Between passes the
executor lets the middleware work and waits for whatever comes first: a message, a timer, or a deadline of the
middleware.
"""

from muros.compat import const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Context

_TIMEOUT = const(1000)  # ms that one round of ``spin`` waits at most
_NEVER = const(1000000)


class Executor:
    """Runs the handles (subscriptions, timers, services, clients, guard conditions) of a context.

    Without ``add`` it runs everything of the context that no other executor has claimed, in the order of making.
    ``handles`` bounds how many may be added (0: any number). ``trigger(handles)``, if given, decides before each pass
    whether anything is taken.
    """

    def __init__(
        self,
        context: "Context",
        handles: int = 0,
        trigger: "Callable[[list[Any]], bool] | None" = None,
    ) -> None:
        self.context = context
        self.capacity = handles
        self.trigger = trigger
        self.handles: "list[Any]" = context.handles

    def add(self, handle: "Any", callback: "Callable[..., object] | None" = None) -> None:
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

    def remove(self, handle: "Any") -> None:
        """Runs a handle no more; the others keep their order. ValueError when it is not here."""
        self.handles.remove(handle)

    def spin(self) -> None:
        """Runs until the context is closed."""
        while self.context.running:
            self.round(_TIMEOUT)

    def spin_some(self, timeout: float = 0.0) -> bool:
        """Waits up to ``timeout`` seconds until something is ready and makes one pass; whether anything ran."""
        return self.round(int(timeout * 1000))

    spin_once = spin_some

    def spin_period(self, period: float) -> None:
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

    def round(self, timeout: int) -> bool:
        """``spin_some`` with ``timeout`` in ms; allocates nothing."""
        middleware = self.context.middleware
        now = self.context.clock()
        end = ticks_add(now, timeout)
        while not self.work(now):
            left = ticks_diff(end, now)
            if left <= 0 or not self.context.running:
                return False
            left = min(left, middleware.deadline(now))
            for handle in self.handles:
                left = min(left, handle.left(now))
            middleware.wait(left)
            now = self.context.clock()
        return True

    def work(self, now: int) -> bool:
        """Lets the middleware work and makes one pass at ``now``; whether anything ran."""
        self.context.middleware.spin_once(now)
        if self.trigger is not None and not self.trigger(self.handles):
            return False
        ran = False
        for handle in self.handles:
            if handle.ready(now):
                handle.run(now)
                ran = True
        return ran


class Handle:
    """What executors run. ``eager``: without waiting for a trigger; ``entity`` is what the middleware made for it."""

    eager = True
    entity: "Any" = None
    handles: "list[Any] | None" = None  # those of the executor that it was added to

    def __init__(self, context: "Context") -> None:
        self.context = context
        context.handles.append(self)

    def left(self, now: int) -> int:
        """Milliseconds until it is ready of its own accord: it never is."""
        return _NEVER

    def destroy(self) -> None:
        """Takes it away."""
        handles = self.handles or self.context.handles
        if self in handles:
            handles.remove(self)
        if self.entity is not None:
            self.entity.destroy()
