"""Executors of boards that keep periods or ask for more than handles and a trigger. Boards borrow this.

What such an executor does in each pass is in ``let`` and ``always``, which stay.
"""

from muros.compat import const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

_ALWAYS = const(1)
_LET = const(1)
_RCLCPP = const(0)
_GO_ON = const(1)
_LOW_PRIORITY = const(5)
_MESSAGES = const(10)


def take_options(executor: "Any", options: "dict[str, Any]") -> None:
    """Sets up an executor; ``options`` as for ``Executor``. Raises ValueError for what boards have not."""
    executor.period = int(options.pop("period", 0) * 1000 + 0.5)
    semantics = options.pop("semantics", 0)
    overrun = options.pop("overrun", 1)
    messages = options.pop("messages", _MESSAGES)
    executor.on_error = options.pop("on_error", None)
    if semantics not in (_RCLCPP, _LET):
        raise ValueError("semantics is %r: it must be RCLCPP or LET" % semantics)
    if options or not _GO_ON <= overrun < _LOW_PRIORITY:
        raise ValueError("no board has executors with %s" % (", ".join(options) or "overrun=%r" % overrun))
    if semantics:
        from muros.rclc.let import Let, attach
        from muros.rclc.let_outputs import Outputs

        outputs = Outputs(executor.context.middleware)
        attach(executor, Let(executor, executor.period, overrun, messages, outputs))
    elif executor.on_error is not None:
        from muros.rclc.always import attach as watch

        watch(executor)


def prepare(executor: "Any", handle: "Any", when: int, let: float, messages: int) -> None:
    """Sets up a handle that is about to be added."""
    if when and not handle.take:
        from muros.rclc.handle_error import HandleError

        raise HandleError("%r cannot run ALWAYS: only subscriptions can" % handle)
    own = executor.let
    if own is not None:
        task = own.task(handle)
        task.let = int(let * 1000 + 0.5)
        task.always = when == _ALWAYS
        task.messages = messages or own.messages
    elif when:
        if not hasattr(executor, "always"):
            from muros.rclc.always import attach as watch

            watch(executor)
        executor.always.append(handle)


def spin_period(executor: "Any", period: float = 0) -> None:
    """Makes one pass each ``period`` seconds until the context is closed or ``stop`` is called.

    Late ones are caught up. The period may be that of the executor.
    """
    executor.period_end = None
    while executor.context.running and not executor.stopped:
        spin_one_period(executor, period)
    executor.stopped = False


def spin_one_period(executor: "Any", period: float = 0) -> None:
    """Makes one pass and waits for the end of the period: the first begins now, each other where the last has ended."""
    ms = int(period * 1000 + 0.5) if period else executor.period
    if not ms:
        raise ValueError("spin_period needs a period: spin_period(0.01), or Executor(context, period=0.01)")
    clock = executor.context.clock
    middleware = executor.context.middleware
    let = executor.let
    start = executor.period_end
    if start is None:
        start = clock()
    executor.period_end = ticks_add(start, ms)
    if let is None:
        executor.beat(clock())
    else:
        let.period = ms
        middleware.spin_once(clock())
        let.start(start)
        let.execute()
    left = ticks_diff(executor.period_end, clock())
    while left > 0 and executor.context.running and (let is not None or not executor.stopped):
        middleware.wait(min(left, middleware.deadline(clock())))
        middleware.spin_once(clock())
        left = ticks_diff(executor.period_end, clock())
    if let is not None:
        let.finish()
