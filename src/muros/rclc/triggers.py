"""Triggers: when an executor takes what has come. ``Executor(context, trigger=all_of(laser, imu))``."""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    Trigger = Callable[[list[Any]], bool]


def all_of(*handles: "Any") -> "Trigger":
    """Each of ``handles`` has something new; without any, each handle of the executor."""
    return lambda added: _ready(handles or added) == len(handles or added)


def any_of(*handles: "Any") -> "Trigger":
    """At least one of ``handles`` has something new; without any, one of the executor's."""
    return lambda added: _ready(handles or added) > 0


def always(handles: "list[Any]") -> bool:
    """Nothing needs to be new: at a fixed rate, subscriptions that were added with ALWAYS are called in each pass."""
    return True


def one(handle: "Any") -> "Trigger":
    """This handle has something new."""
    return lambda added: _ready((handle,)) > 0


def _ready(handles: "Any") -> int:
    """How many of them have something new."""
    count = 0
    for handle in handles:
        if handle.ready(handle.context.clock()):
            count += 1
    return count
