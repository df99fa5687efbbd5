"""What execution contexts and their components know of each other: the calls, the events, the profile."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Protocol, TypeAlias

from muros.rtc.codes import ExecutionKind, LifeCycleState, ReturnCode

if TYPE_CHECKING:
    from muros.findings import Finding
    from muros.rtc.contexts._context import ExecutionContext

__all__ = ["ContextEvent", "ContextEventKind", "ContextProfile", "Participant", "Report", "name_of"]

Report: TypeAlias = "Callable[[Finding], None]"
"""Who is told what was dropped or refused."""


class Participant(Protocol):
    """A component as contexts call it: one of this process, or one behind CORBA. RTC 1.1, 5.2.2.4 and 5.3.1.2.

    Two that stand for the same component are equal and have the same hash. No call raises what the component's own
    code raised: that is RTC_ERROR. A component of another process that does not answer raises `PeerLostError`;
    the context then goes on without it.

    What it is called in findings and in the groups of a multilayer context is its `instance_name`, where it has one.
    """

    def attach_context(self, context: ExecutionContext) -> int:
        """The context takes the component in; answers the handle by which it calls, 1000 and up."""
        ...

    def detach_context(self, handle: int) -> ReturnCode: ...

    def on_startup(self, handle: int) -> ReturnCode: ...

    def on_shutdown(self, handle: int) -> ReturnCode: ...

    def on_activated(self, handle: int) -> ReturnCode: ...

    def on_deactivated(self, handle: int) -> ReturnCode: ...

    def on_aborting(self, handle: int) -> ReturnCode: ...

    def on_error(self, handle: int) -> ReturnCode: ...

    def on_reset(self, handle: int) -> ReturnCode: ...

    def on_execute(self, handle: int) -> ReturnCode: ...

    def on_state_update(self, handle: int) -> ReturnCode: ...

    def on_rate_changed(self, handle: int) -> ReturnCode: ...


class ContextEventKind(Enum):
    """What happened in a context."""

    STARTUP = "startup"
    SHUTDOWN = "shutdown"
    RATE_CHANGED = "rate changed"
    STATE_CHANGED = "state changed"
    ADMITTED = "admitted"
    DISMISSED = "dismissed"


@dataclass(frozen=True, slots=True)
class ContextEvent:
    """Something that happened in a context, told after the components' callbacks for it have run."""

    kind: ContextEventKind
    component: Participant | None = None
    """Whose state changed, or who came or went; None where the event is the context's own."""
    handle: int = -1
    """By which the component knows the context."""
    old: LifeCycleState | None = None
    new: LifeCycleState | None = None


@dataclass(frozen=True, slots=True)
class ContextProfile:
    """A context as tools see it. RTC 1.1, 5.2.2.8."""

    kind: ExecutionKind
    rate: float
    """Passes per second."""
    owner: Participant | None
    participants: tuple[Participant, ...]
    properties: Mapping[str, str]


def name_of(participant: object) -> str:
    """What a component is called."""
    for thing in (participant, getattr(participant, "component", None)):
        name = getattr(thing, "instance_name", "")
        if isinstance(name, str) and name:
            return name
    return str(participant)
