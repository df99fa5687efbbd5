"""Guard conditions: a program wakes its own executor."""

from muros.compat import const
from muros.rclc.executor import Handle

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.rclc.context import Context


class GuardCondition(Handle):
    """After ``trigger()`` an executor calls ``callback()`` once."""

    def __init__(self, context: "Context", callback: "Callable[[], object]") -> None:
        super().__init__(context)
        self.callback = callback
        self._triggered = False

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
