"""The error about handles that an executor cannot run, or does not have."""

from muros.compat import const
from muros.rclc.errors import RclError

_ERROR = const(1)
_INVALID_ARGUMENT = const(11)


class HandleError(RclError):
    """A handle that this executor cannot run (``code`` 11, invalid argument), or does not have (1, error)."""

    code = _INVALID_ARGUMENT


def absent(handle: object) -> HandleError:
    """The error about a handle that is not there."""
    error = HandleError("%r is not in this executor" % handle)
    error.code = _ERROR
    return error
