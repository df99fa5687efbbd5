"""Errors of rclc. ``code`` is the return code that the C library gives in its place."""

from muros.compat import const

_ERROR = const(1)
_NODE_INVALID_NAME = const(201)


class RclError(Exception):
    """Anything that was asked wrongly of rclc."""

    code = _ERROR


class CapacityError(RclError):
    """There is no more room where a limit was set."""


class InvalidNameError(ValueError):
    """A name that is not made as ROS asks; on hosts ``code`` tells topics and services from nodes."""

    code = _NODE_INVALID_NAME
