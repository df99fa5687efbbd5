"""Guard conditions: a program wakes its own executor."""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.rclc.context import Context

_NEVER = const(1000000)


class GuardCondition:
    """After ``trigger()`` an executor calls ``callback()`` once."""

    def __init__(self, context: "Context", callback: "Callable[[], object]") -> None:
        self.context = context
        self.callback = callback
        self.eager = True
        self._triggered = False
        context.handles.append(self)

    def trigger(self) -> None:
        """Makes it ready."""
        self._triggered = True

    def ready(self, now: int) -> bool:
        """Whether it was triggered."""
        return self._triggered

    def run(self, now: int) -> None:
        """Calls the callback."""
        self._triggered = False
        self.callback()

    def left(self, now: int) -> int:
        """Only a trigger makes it ready."""
        return _NEVER

    def destroy(self) -> None:
        """Takes it away."""
        if self in self.context.handles:
            self.context.handles.remove(self)
