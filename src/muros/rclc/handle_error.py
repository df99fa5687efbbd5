"""The error about handles that an executor cannot run, or does not have."""

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


def refuse(executor: "Executor", handle: object) -> None:
    """Raises the error about a handle that cannot be added."""
    if getattr(handle, "context", None) is not executor.context:
        raise HandleError("%r is no handle of this executor's context" % (handle,))
    if handle in executor.handles:
        raise HandleError("%r was added already: an executor runs each handle once" % (handle,))
    raise CapacityError(
        "executor is full: %d handles of %d in use. Create it with handles=%d."
        % (executor.capacity, executor.capacity, executor.capacity + 1)
    )


def absent(handle: object) -> None:
    """Raises the error about a handle that is not there."""
    error = HandleError("%r is not in this executor" % (handle,))
    error.code = _ERROR
    raise error
