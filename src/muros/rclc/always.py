"""Passes of boards' executors that call subscriptions without data, or go on after an error, or with LET.

Only those load it, and keep it.
"""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any


def attach(executor: "Any") -> None:
    """Has an executor make passes that call subscriptions without data, and decide about errors."""
    executor.always = []
    if not hasattr(executor, "on_error"):
        executor.on_error = None
    replace(executor, lambda now, due=False: work(executor, now, due))


def replace(executor: "Any", work: "Any") -> None:
    """Has an executor make passes of its own; those at the end of a wait, or of periods, are due without news too."""
    executor.work = work
    executor.beat = lambda now: work(now, True)
    executor.round = lambda timeout: (
        type(executor).round(executor, timeout) or work(executor.context.clock(), True)
    )


def work(executor: "Any", now: int, beat: bool) -> bool:
    """One pass; ``beat``: also when nothing is new, if there is a trigger and it says so."""
    executor.context.middleware.spin_once(now)
    handles = executor.handles
    news = False
    for handle in handles:
        news = news or handle.ready(now)
    if executor.trigger is None:
        if not news:
            return False
    elif not (news or beat) or not executor.trigger(handles):
        return False
    ran = False
    for handle in handles:
        if handle.ready(now) or handle in executor.always:
            ran = True
            try:
                handle.run(now)
            except Exception as error:
                if executor.on_error is None or not executor.on_error(handle, error):
                    raise
    return ran
