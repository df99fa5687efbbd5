"""The life of one component in one execution context, as a table. RTC 1.1, 5.2.2.3.

    INACTIVE --activate--> ACTIVE --deactivate--> INACTIVE
    ACTIVE --fail--> ERROR --reset--> INACTIVE

A component fails when on_activated, on_execute, on_state_update or on_rate_changed answers anything but RTC_OK while
it is active; an activation that fails has therefore made it active first. What on_deactivated, on_aborting, on_error,
on_startup and on_shutdown answer changes nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from muros.rtc.codes import LifeCycleState

__all__ = ["DO", "POST_DO", "TRANSITIONS", "Ask", "Transition"]


class Ask(Enum):
    """What moves a component from one state to another."""

    ACTIVATE = "activate"
    DEACTIVATE = "deactivate"
    RESET = "reset"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Transition:
    """One arrow: what is called on the way, where it leads, and what a refusal of the last call means."""

    calls: tuple[str, ...]
    to: LifeCycleState
    refused: Ask | LifeCycleState | None = None
    """None: what the calls answer changes nothing. A state: the component is there instead. An ask: it follows."""


_INACTIVE: Final = LifeCycleState.INACTIVE_STATE
_ACTIVE: Final = LifeCycleState.ACTIVE_STATE
_ERROR: Final = LifeCycleState.ERROR_STATE

TRANSITIONS: Final[Mapping[tuple[LifeCycleState, Ask], Transition]] = {
    (_INACTIVE, Ask.ACTIVATE): Transition(("on_activated",), _ACTIVE, refused=Ask.FAIL),
    (_ACTIVE, Ask.DEACTIVATE): Transition(("on_deactivated",), _INACTIVE),
    (_ACTIVE, Ask.FAIL): Transition(("on_deactivated", "on_aborting"), _ERROR),
    (_ERROR, Ask.RESET): Transition(("on_reset",), _INACTIVE, refused=_ERROR),
}
"""All that is not here is a precondition that is not met."""

DO: Final[Mapping[LifeCycleState, str]] = {_ACTIVE: "on_execute", _ERROR: "on_error"}
"""What each pass calls, by state; who is in none of them makes no context run."""

POST_DO: Final[Mapping[LifeCycleState, str]] = {_ACTIVE: "on_state_update"}
"""What each pass calls when all components have done theirs."""
