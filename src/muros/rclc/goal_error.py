"""The error of goals, in a module of its own: what programs catch must not be borrowed."""

from muros.compat import const
from muros.rclc.errors import RclError

_EVENT_INVALID = const(2301)


class GoalError(RclError):
    """A goal cannot do that in its state (code 2301), or has ended (2300)."""

    code = _EVENT_INVALID
