"""Execution contexts over CORBA: what tools start, stop and ask. RTC 1.1, 5.2.2.5 and 5.4.2.11."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from muros.rtc.codes import ReturnCode, RtcError
from muros.rtc.contexts import ExecutionContext, Participant
from muros.rtc.corba._conversion import to_nv_list, to_return_code
from muros.rtc.corba._stubs import RTC, RTC__POA, OpenRTM__POA

if TYPE_CHECKING:
    from muros.rtc.corba._objects import Objects

__all__ = ["ContextServant", "servant_for"]


class _Operations:
    """The operations of RTC::ExecutionContextService on a context of this process."""

    def __init__(self, context: ExecutionContext, objects: Objects) -> None:
        self.context: Final = context
        self._objects = objects

    def is_running(self) -> bool:
        return self.context.is_running()

    def start(self) -> Any:
        return to_return_code(self.context.start())

    def stop(self) -> Any:
        return to_return_code(self.context.stop())

    def get_rate(self) -> float:
        return self.context.rate

    def set_rate(self, rate: float) -> Any:
        return to_return_code(self.context.set_rate(rate))

    def get_kind(self) -> Any:
        return RTC.ExecutionKind._items[self.context.kind]

    def add_component(self, comp: Any) -> Any:
        return self._with(comp, self.context.add_component)

    def remove_component(self, comp: Any) -> Any:
        return self._with(comp, self.context.remove_component)

    def activate_component(self, comp: Any) -> Any:
        return self._with(comp, self.context.activate_component)

    def deactivate_component(self, comp: Any) -> Any:
        return self._with(comp, self.context.deactivate_component)

    def reset_component(self, comp: Any) -> Any:
        return self._with(comp, self.context.reset_component)

    def get_component_state(self, comp: Any) -> Any:
        try:
            state = self.context.get_component_state(self._objects.participant_behind(comp))
        except RtcError:
            return RTC.CREATED_STATE
        return RTC.LifeCycleState._items[state]

    def get_profile(self) -> Any:
        profile = self.context.profile()
        others = [self._objects.participant(one) for one in profile.participants]
        return RTC.ExecutionContextProfile(
            RTC.ExecutionKind._items[profile.kind],
            profile.rate,
            self._objects.participant(profile.owner),
            [one for one in others if one is not None],
            to_nv_list(profile.properties),
        )

    def _with(self, component: Any, operation: Callable[[Participant], ReturnCode]) -> Any:
        try:
            participant = self._objects.participant_behind(component)
        except RtcError as error:
            self._objects.refused(str(self.context), f"{operation.__name__} refused", error)
            return RTC.BAD_PARAMETER
        return to_return_code(operation(participant))


class ContextServant(_Operations, RTC__POA.ExecutionContextService):  # type: ignore[misc]
    """A context that runs by itself."""


class TriggeredServant(ContextServant, OpenRTM__POA.ExtTrigExecutionContextService):  # type: ignore[misc]
    """A context that others trigger."""

    def tick(self) -> None:
        self.context.tick()


def servant_for(context: ExecutionContext, objects: Objects) -> ContextServant:
    """A servant of the interface that the kind of context has."""
    triggered = type(context).tick is not ExecutionContext.tick
    return (TriggeredServant if triggered else ContextServant)(context, objects)
