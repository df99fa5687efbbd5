"""Errors of parameters. ``code`` is the return code that the C library gives in its place."""

from muros.compat import const
from muros.rclc.errors import RclError

_TIMEOUT = const(2)
_INVALID_ARGUMENT = const(11)
_MODIFICATION_REJECTED = const(4001)
_TYPE_MISMATCH = const(4002)
_UNSUPPORTED_ON_LOW_MEM = const(4003)
_DISABLED_ON_CALLBACK = const(40004)  # spelled so upstream


class ParameterError(RclError):
    """Anything that was asked wrongly of parameters."""


class ParameterNotDeclaredError(ParameterError):
    """There is no parameter of that name."""


class InvalidParameterError(ParameterError):
    """What can be no parameter: a value of no type, a name that is no text, a range of other numbers."""

    code = _INVALID_ARGUMENT


class ParameterTypeError(ParameterError):
    """A parameter keeps the type that it was declared with."""

    code = _TYPE_MISMATCH


class ParameterRejectedError(ParameterError):
    """A change was refused: by the callback, by a range, or by the node that was asked."""

    code = _MODIFICATION_REJECTED


class ParameterMemoryError(ParameterError):
    """Not in the low-memory profile."""

    code = _UNSUPPORTED_ON_LOW_MEM


class ParameterChangingError(ParameterError):
    """The callback of a change wants to change something itself."""

    code = _DISABLED_ON_CALLBACK


class ParameterTimeoutError(ParameterError):
    """The node that was asked did not answer in time."""

    code = _TIMEOUT
