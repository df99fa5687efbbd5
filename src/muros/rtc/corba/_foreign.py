"""Components and execution contexts of other processes, as contexts and components of this one use them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from omniORB import CORBA

from muros.rtc.codes import ExecutionKind, LifeCycleState, ReturnCode, RtcError
from muros.rtc.contexts import ContextProfile, ExecutionContext, Participant
from muros.rtc.corba._conversion import from_return_code, texts_of
from muros.rtc.corba._lost import asked_again, is_there, peer, quick_answer
from muros.rtc.corba._naming import is_same
from muros.rtc.corba._stubs import RTC

if TYPE_CHECKING:
    from muros.rtc.corba._objects import Objects

__all__ = ["ForeignComponent", "ForeignContext"]


class ForeignComponent:
    """A component of another process as a `Participant`. PeerLostError when it does not answer.

    One that is no data flow component has no on_execute: RTC_OK.
    """

    def __init__(self, reference: Any, objects: Objects) -> None:
        self.reference: Final = reference
        self._objects = objects
        self._hash = objects.orb.hash_of(reference)
        self._name: str | None = None
        self._component: Any = None
        self._flow: Any = None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ForeignComponent) and is_same(self.reference, other.reference)

    def __hash__(self) -> int:
        return self._hash

    @property
    def instance_name(self) -> str:
        """Its name; "" while it does not answer."""
        if self._name is None:
            try:
                with quick_answer():
                    component = asked_again(lambda: self.reference._narrow(RTC.RTObject))
                    profile = asked_again(component.get_component_profile) if component else None
                    self._name = str(profile.instance_name) if profile else ""
            except CORBA.Exception:
                return ""
        return self._name

    def attach_context(self, context: ExecutionContext) -> int:
        with peer(self._who()):
            self._flow = asked_again(lambda: self.reference._narrow(RTC.DataFlowComponentAction))
            self._component = self.reference._narrow(RTC.LightweightRTObject)
            if self._component is None:
                raise RtcError("the object that is to be added to a context is no component")
            return int(self._component.attach_context(self._objects.context(context)))

    def detach_context(self, handle: int) -> ReturnCode:
        return self._call("detach_context", handle)

    def on_startup(self, handle: int) -> ReturnCode:
        return self._call("on_startup", handle)

    def on_shutdown(self, handle: int) -> ReturnCode:
        return self._call("on_shutdown", handle)

    def on_activated(self, handle: int) -> ReturnCode:
        return self._call("on_activated", handle)

    def on_deactivated(self, handle: int) -> ReturnCode:
        return self._call("on_deactivated", handle)

    def on_aborting(self, handle: int) -> ReturnCode:
        return self._call("on_aborting", handle)

    def on_error(self, handle: int) -> ReturnCode:
        return self._call("on_error", handle)

    def on_reset(self, handle: int) -> ReturnCode:
        return self._call("on_reset", handle)

    def on_execute(self, handle: int) -> ReturnCode:
        return self._flows("on_execute", handle)

    def on_state_update(self, handle: int) -> ReturnCode:
        return self._flows("on_state_update", handle)

    def on_rate_changed(self, handle: int) -> ReturnCode:
        return self._flows("on_rate_changed", handle)

    def _call(self, operation: str, handle: int) -> ReturnCode:
        with peer(self._who()):
            target = self._component or self.reference
            return from_return_code(getattr(target, operation)(handle))

    def _flows(self, operation: str, handle: int) -> ReturnCode:
        if self._flow is None:
            return ReturnCode.RTC_OK
        with peer(self._who()):
            return from_return_code(getattr(self._flow, operation)(handle))

    def _who(self) -> str:
        return self._name or "a component of another process"


class ForeignContext(ExecutionContext):
    """A context of another process that calls components of this one.

    No operation raises: one that does not answer gives RTC_ERROR, CREATED_STATE, no rate, nobody.
    """

    registered_name = "ForeignContext"

    def __init__(self, reference: Any, objects: Objects) -> None:
        super().__init__(name="a context of another process")
        self.reference: Final = reference
        self._objects = objects
        self._hash = objects.orb.hash_of(reference)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ForeignContext) and is_same(self.reference, other.reference)

    def __hash__(self) -> int:
        return self._hash

    @property
    def rate(self) -> float:
        return float(self._asked("get_rate", 0.0))

    @property
    def owner(self) -> Participant | None:
        return self.profile().owner

    @property
    def participants(self) -> tuple[Participant, ...]:
        return self.profile().participants

    def profile(self) -> ContextProfile:
        try:
            found = asked_again(lambda: self._service().get_profile())
            return ContextProfile(
                ExecutionKind(found.kind._v),
                float(found.rate),
                self._objects.participant_behind(found.owner) if found.owner is not None else None,
                tuple(self._objects.participant_behind(one) for one in found.participants if one is not None),
                texts_of(found.properties),
            )
        except (CORBA.Exception, RtcError, ValueError):
            return ContextProfile(ExecutionKind.OTHER, 0.0, None, (), {})

    def is_there(self) -> bool:
        """Whether its process says so; one that does not answer in time may be busy."""
        return is_there(self.reference)

    def is_running(self) -> bool:
        return bool(self._asked("is_running", False))

    def start(self) -> ReturnCode:
        return self._coded("start")

    def stop(self) -> ReturnCode:
        return self._coded("stop")

    def set_rate(self, rate: float) -> ReturnCode:
        return self._coded("set_rate", rate)

    def close(self) -> None:
        """It is not this process's to end."""

    def bind_owner(self, component: Participant, handle: int) -> None:
        raise RtcError("a context of another process cannot be owned")

    def unbind_owner(self, component: Participant) -> None:
        """Nobody of this process owns it."""

    def add_component(self, component: Participant) -> ReturnCode:
        return self._coded("add_component", self._objects.participant(component))

    def remove_component(self, component: Participant) -> ReturnCode:
        return self._coded("remove_component", self._objects.participant(component))

    def activate_component(self, component: Participant) -> ReturnCode:
        return self._coded("activate_component", self._objects.participant(component))

    def deactivate_component(self, component: Participant) -> ReturnCode:
        return self._coded("deactivate_component", self._objects.participant(component))

    def reset_component(self, component: Participant) -> ReturnCode:
        return self._coded("reset_component", self._objects.participant(component))

    def get_component_state(self, component: Participant) -> LifeCycleState:
        state = self._asked("get_component_state", None, self._objects.participant(component))
        return LifeCycleState.CREATED_STATE if state is None else LifeCycleState(state._v)

    def _service(self) -> Any:
        return self.reference._narrow(RTC.ExecutionContextService)

    def _coded(self, operation: str, *arguments: object) -> ReturnCode:
        code = self._asked(operation, None, *arguments)
        return ReturnCode.RTC_ERROR if code is None else from_return_code(code)

    def _asked(self, operation: str, otherwise: object, *arguments: object) -> Any:
        try:
            return asked_again(lambda: getattr(self.reference, operation)(*arguments))
        except CORBA.Exception:
            return otherwise
