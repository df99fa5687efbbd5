"""What hosts check of what rclc is given, and the errors that say it in one line.

Errors are TypeErrors and ValueErrors whose ``code`` is the return code of the C library.
"""

from __future__ import annotations

import math
from typing import Any

from muros.client.qos import Qos, profile
from muros.rclc.errors import InvalidNameError

INVALID_ARGUMENT = 11
TOPIC_NAME_INVALID = 103
SERVICE_NAME_INVALID = 104
NODE_INVALID_NAMESPACE = 202


class WrongTypeError(TypeError):
    """Something of another kind was expected."""

    code = INVALID_ARGUMENT


class WrongValueError(ValueError):
    """A value that makes no sense."""

    code = INVALID_ARGUMENT


def be_text(name: Any, what: str) -> None:
    """Raises WrongTypeError unless it is a text."""
    if not isinstance(name, str):
        raise WrongTypeError(f"{what} is a str, not {name!r}")


def be_callable(callback: Any, what: str) -> None:
    """Raises WrongTypeError unless it can be called."""
    if not callable(callback):
        raise WrongTypeError(f"{what} is a function, not {callback!r}")


def be_period(period: Any) -> None:
    """Raises WrongValueError unless it is a period that a timer can have, in seconds."""
    if not isinstance(period, int | float) or not math.isfinite(period) or period < 0:
        raise WrongValueError(
            f"the period of a timer is {period!r}: it must be a number of seconds, at least 0"
        )


def be_handle(handle: Any, who: str = "an executor") -> None:
    """Raises WrongTypeError unless it is something that executors run."""
    if isinstance(handle, type) or not (hasattr(handle, "ready") and hasattr(handle, "run")):
        raise WrongTypeError(
            f"{who} cannot run {handle!r}: add subscriptions, timers, services, clients, guard conditions"
        )


def be_message(kind: Any) -> None:
    """Raises WrongTypeError unless it is the class of a message."""
    if isinstance(kind, type) and hasattr(kind, "TYPE"):
        if hasattr(kind, "write"):
            return
        raise WrongTypeError(f"{kind.TYPE} is no message: topics carry messages such as std_msgs/msg/Int32")
    raise no_class(kind, "a message class such as std_msgs.msg.Int32")


def be_service(kind: Any) -> None:
    """Raises WrongTypeError unless it is the class of a service."""
    if isinstance(kind, type) and hasattr(kind, "TYPE"):
        if hasattr(kind, "Request") and hasattr(kind, "Response"):
            return
        raise WrongTypeError(f"{kind.TYPE} is no service such as example_interfaces/srv/AddTwoInts")
    raise no_class(kind, "a service class such as example_interfaces.srv.AddTwoInts")


def be_qos(qos: Any) -> None:
    """Raises WrongTypeError unless it is a QoS or the name of a profile, WrongValueError for a name that is none."""
    if not isinstance(qos, str | Qos):
        raise WrongTypeError(f"qos is the name of a profile such as 'sensor_data', or a Qos, not {qos!r}")
    try:
        profile(qos)
    except ValueError as error:
        raise WrongValueError(str(error)) from None


def no_class(kind: Any, wanted: str) -> WrongTypeError:
    """The error about what is no class that is wanted."""
    if hasattr(kind, "TYPE"):
        return WrongTypeError(f"give {wanted}: the class {called(type(kind))} itself, not an object of it")
    return WrongTypeError(f"give {wanted}, not {kind!r}")


def fits(message: Any, kind: Any) -> bool:
    """Whether a message is of a type, by whatever class, or a sample without type that is serialised already."""
    if isinstance(message, type):
        return False
    if hasattr(message, "TYPE"):
        return bool(message.TYPE == kind.TYPE)
    return callable(getattr(message, "size", None))


def other(message: Any, kind: Any, verb: str) -> WrongTypeError:
    """The error about a message of another type."""
    got = message.TYPE if hasattr(message, "TYPE") else repr(message)
    return WrongTypeError(f"{verb} takes {kind.TYPE} here, not {got}")


def called(kind: Any) -> str:
    """The name of a class."""
    name: str = kind.__name__
    return name


def invalid(error: ValueError, code: int) -> InvalidNameError:
    """The same error as one about names, with a code of its own."""
    made = InvalidNameError(str(error))
    made.code = code
    return made


def is_token(name: str) -> bool:
    """Whether a name may be that of a node, or a part of a longer one."""
    return name.isascii() and name.isidentifier()
