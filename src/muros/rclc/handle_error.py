"""The error about handles that an executor cannot run, or does not have. Boards borrow this."""

from muros.compat import const
from muros.rclc.errors import CapacityError, RclError

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.rclc.executor import Executor

_ERROR = const(1)
_INVALID_ARGUMENT = const(11)


class HandleError(RclError):
    """A handle that this executor cannot run (``code`` 11, invalid argument), or does not have (1, error)."""

    code = _INVALID_ARGUMENT


def check_new(executor: "Executor", handle: object) -> None:
    """Raises HandleError for a handle that cannot be added, CapacityError when there is no room."""
    if getattr(handle, "context", None) is not executor.context:
        raise HandleError("%r is no handle of this executor's context" % (handle,))
    if handle in executor.handles:
        raise HandleError("%r was added already: an executor runs each handle once" % (handle,))
    if 0 < executor.capacity <= len(executor.handles):
        raise CapacityError(
            "executor is full: %d handles of %d in use. Create it with handles=%d."
            % (executor.capacity, executor.capacity, executor.capacity + 1)
        )


def check_there(executor: "Executor", handle: object) -> None:
    """Raises HandleError for a handle that is not there."""
    if handle not in executor.handles:
        error = HandleError("%r is not in this executor" % (handle,))
        error.code = _ERROR
        raise error
