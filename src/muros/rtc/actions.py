"""The actions of a component: what execution contexts and the component's life call, and who listens to that.

Each action has a name in the language's style and the one of the RTC specification; a component may define either,
and both names mean the same (`joined_names`). RTC 1.1, 5.2.2.4 to 5.2.2.10 and 5.3.
"""

from __future__ import annotations

from enum import Enum
from typing import Any, Final, Literal, TypeAlias

from muros.rtc.codes import ReturnCode, RtcError

__all__ = [
    "ACTIONS",
    "Action",
    "ActionPoint",
    "ComponentEvent",
    "InvalidReturnError",
    "join_names",
    "return_code_of",
    "rtc_name_of",
]


class Action(Enum):
    """What components are called for; the value is the method's name."""

    INITIALIZE = "on_initialize"
    FINALIZE = "on_finalize"
    STARTUP = "on_startup"
    SHUTDOWN = "on_shutdown"
    ACTIVATED = "on_activated"
    DEACTIVATED = "on_deactivated"
    ABORTING = "on_aborting"
    ERROR = "on_error"
    RESET = "on_reset"
    EXECUTE = "on_execute"
    STATE_UPDATE = "on_state_update"
    RATE_CHANGED = "on_rate_changed"

    @property
    def rtc_name(self) -> str:
        """The method's name in the RTC specification: `onExecute` of `on_execute`."""
        return rtc_name_of(self.value)


ACTIONS: Final = tuple(Action)

ActionPoint: TypeAlias = tuple[Literal["PRE", "POST"], Action]
"""What listeners are added for: PRE is called with the context's handle, POST with the handle and the return code.

The handle of `INITIALIZE` and `FINALIZE`, which no context calls, is 0.
"""


class ComponentEvent(Enum):
    """What else a component's listeners hear of, with what they are called with."""

    ADD_PORT = "ADD_PORT"  # the port
    REMOVE_PORT = "REMOVE_PORT"  # the port
    EC_ATTACHED = "EC_ATTACHED"  # the handle
    EC_DETACHED = "EC_DETACHED"  # the handle
    FINALIZED = "FINALIZED"  # nothing


def rtc_name_of(name: str) -> str:
    """A method's name as the RTC specification writes it: `onExecute` of `on_execute`."""
    first, *rest = name.split("_")
    return first + "".join(word.capitalize() for word in rest)


class InvalidReturnError(RtcError):
    """An action returned what is no return code."""


def join_names(component: type) -> None:
    """Let a class that defines an action by one of its names have it by the other as well.

    Raises RtcError where a class defines both: which one is to run?
    """
    own = vars(component)
    for action in ACTIONS:
        defined = [name for name in (action.value, action.rtc_name) if name in own]
        if len(defined) == 2 and own[defined[0]] is not own[defined[1]]:
            raise RtcError(
                f"{component.__name__} defines both {defined[0]} and {defined[1]}, which are one action: keep one"
            )
        if len(defined) == 1:
            other = action.rtc_name if defined[0] == action.value else action.value
            setattr(component, other, own[defined[0]])


def return_code_of(value: Any) -> ReturnCode:
    """The return code that an action's value means.

    None is RTC_OK; members of the enumerations that IDL compilers make count by their number.
    Raises InvalidReturnError for other values.
    """
    if value is None:
        return ReturnCode.RTC_OK
    number = getattr(value, "_v", value)
    if isinstance(number, int) and not isinstance(number, bool):
        try:
            return ReturnCode(number)
        except ValueError:
            pass
    raise InvalidReturnError(f"{value!r} is no return code: return RTC_OK, another ReturnCode, or nothing")
