"""The executor: runs what is ready, in the order of adding.

One pass looks at every handle in turn; what is ready gives one piece of work to its callback. Between passes the
executor lets the middleware work and waits for whatever comes first: a message, a timer, or a deadline of the
middleware. What programs ask of executors and handles now and then boards borrow, see ``handles``; what only some
executors do, logical execution time and callbacks without data, is in ``let`` and ``always``, which put a pass of their
own in the place of ``work``. Hosts have more, see ``host.executor``.
"""

from muros.compat import const, lending, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc import handles, periods
    from muros.rclc.context import Context

_TIMEOUT = const(1000)  # ms that one round of ``spin`` waits at most
_NEVER = const(1000000)


class Executor:
    """Runs the handles (subscriptions, timers, services, clients, guard conditions) of a context.

    Without ``add`` it runs everything of the context that no other executor has claimed, in the order of making.
    ``handles`` bounds how many may be added (0: any number). ``trigger(handles)``, if given, decides before each pass
    whether anything is taken.

    ``options``: ``period``, in seconds, is that of ``spin_period``. ``semantics`` is RCLCPP or LET; with LET
    ``overrun`` is what follows when a callback is late, ``messages`` how many one publisher may publish in one run.
    ``on_error(handle, error)`` is told what a callback raises: the executor goes on if it returns True.
    """

    stopped = False
    period: float = 0  # ms
    let: "Any" = None
    period_end: "Any" = None  # a tick

    def __init__(
        self,
        context: "Context",
        handles: int = 0,
        trigger: "Callable[[list[Any]], bool] | None" = None,
        **options: "Any",
    ) -> None:
        self.context = context
        self.capacity = handles
        self.trigger = trigger
        self.handles: "list[Any]" = context.handles
        if options:
            self.take_options(options)

    if TYPE_CHECKING:
        on_error: "Any"

        take_options = periods.take_options
        add = handles.add
        remove = handles.remove
        spin_one_period = periods.spin_one_period
        spin_period = periods.spin_period
        stop = handles.stop
    else:
        lends = "muros.rclc.handles"
        __getattr__ = lending

    def spin(self) -> None:
        """Runs until the context is closed or ``stop`` is called."""
        while self.context.running and not self.stopped:
            self.round(_TIMEOUT)
        self.stopped = False

    def spin_some(self, timeout: float = 0.0) -> bool:
        """Waits up to ``timeout`` seconds until something is ready and makes one pass; whether anything ran."""
        return self.round(int(timeout * 1000))

    spin_once = spin_some

    def round(self, timeout: int) -> bool:
        """``spin_some`` with ``timeout`` in ms; allocates nothing."""
        context = self.context
        now = context.clock()
        end = ticks_add(now, timeout)
        while not self.work(now):
            left = ticks_diff(end, now)
            if left <= 0 or not context.running:
                return False
            left = min(left, context.middleware.deadline(now))
            for handle in self.handles:
                left = min(left, handle.left(now))
            context.middleware.wait(max(left, 1))  # a trigger lets what is ready wait
            now = context.clock()
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

    beat = work  # what is due without news, too


class Handle:
    """What executors run. ``eager``: without waiting for a trigger; ``entity`` is what the middleware made for it."""

    eager = True
    entity: "Any" = None
    handles: "list[Any] | None" = None  # those of the executor that it was added to
    take: "Any" = None  # a subscription's
    _answers: "Any" = None  # a service's that wait

    if TYPE_CHECKING:
        cancelled: bool
        depth: int

        def destroy(self) -> None:
            """Takes it away, with all that waits."""
    else:
        lends = "muros.rclc.handles"
        __getattr__ = lending

    def __init__(self, context: "Context") -> None:
        self.context = context
        context.handles.append(self)

    def ready(self, now: int) -> bool:
        """Whether there is something to run."""
        return self.left(now) == 0

    def left(self, now: int) -> int:
        """Milliseconds until it is ready of its own accord: it never is."""
        return _NEVER
