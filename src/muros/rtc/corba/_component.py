"""Components over CORBA: a component of this process as tools, managers, contexts and editors call it.

The interface is OpenRTM's data flow component: RTC 1.1, 5.4.2 (RTObject), 5.2.2 (the life of a component and its
actions) and SDO 1.1 (identity, configuration, organizations). Actions may be called by contexts of other processes,
with the handles that `attach_context` gave them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from muros.rtc.actions import ComponentEvent
from muros.rtc.codes import ReturnCode, RtcError
from muros.rtc.corba._configuration import ConfigurationServant
from muros.rtc.corba._conversion import to_nv_list, to_return_code
from muros.rtc.corba._foreign import ForeignContext
from muros.rtc.corba._fsm import FsmServant
from muros.rtc.corba._lost import is_there
from muros.rtc.corba._observer import Observers
from muros.rtc.corba._stubs import RTC, OpenRTM__POA, SDOPackage
from muros.rtc.fsm import FSM_SERVICE, fsm_service_of
from muros.rtc.organization import Organization, organizations_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.rtc.component import Component
    from muros.rtc.contexts import ExecutionContext
    from muros.rtc.corba._objects import Objects

__all__ = ["ComponentServant"]


class ComponentServant(OpenRTM__POA.DataFlowComponent):  # type: ignore[misc]
    """OpenRTM::DataFlowComponent of a component; active until `Objects.withdraw`."""

    def __init__(self, component: Component, objects: Objects) -> None:
        self.component: Final = component
        self._objects = objects
        self._observers: Final = Observers(component)
        self._configuration = ConfigurationServant(component, self._observers, objects)
        self._fsm: FsmServant | None = None
        self._closed = False
        component.listeners.add(ComponentEvent.REMOVE_PORT, objects.drop_port)

    def close(self) -> None:
        """End what stands behind it: observers, configuration, state machine service."""
        self._closed = True
        self.component.listeners.remove(ComponentEvent.REMOVE_PORT, self._objects.drop_port)
        self._observers.close()
        for servant in (self._configuration, self._fsm):
            if servant is not None:
                self._objects.orb.deactivate(servant)

    # RTObject

    def get_component_profile(self) -> Any:
        profile = self.component.profile()
        return RTC.ComponentProfile(
            profile.instance_name,
            profile.type_name,
            profile.description,
            profile.version,
            profile.vendor,
            profile.category,
            [self._objects.port_profile(one) for one in profile.ports],
            RTC.RTObject._nil,
            to_nv_list(profile.properties),
        )

    def get_ports(self) -> list[Any]:
        return [self._objects.port(port) for port in self.component.ports]

    # LightweightRTObject

    def initialize(self) -> Any:
        """Its manager has done so."""
        return RTC.PRECONDITION_NOT_MET

    def finalize(self) -> Any:
        if self.component.participating_contexts:
            return RTC.PRECONDITION_NOT_MET
        return to_return_code(self.component.exit())

    def exit(self) -> Any:
        return to_return_code(self.component.exit())

    def is_alive(self, exec_context: Any) -> bool:
        return self.component.is_initialized and self.get_context_handle(exec_context) >= 0

    def attach_context(self, exec_context: Any) -> int:
        try:
            return self.component.attach_context(self._objects.context_behind(exec_context))
        except RtcError as error:
            self._objects.refused(self.component.instance_name, "attach_context refused", error)
            return -1

    def detach_context(self, exec_handle: int) -> Any:
        return to_return_code(self.component.detach_context(exec_handle))

    def get_context(self, exec_handle: int) -> Any:
        try:
            return self._objects.context(self.component.context_of(exec_handle))
        except RtcError:
            return RTC.ExecutionContext._nil

    def get_owned_contexts(self) -> list[Any]:
        return [self._objects.context(context) for context in self.component.owned_contexts]

    def get_participating_contexts(self) -> list[Any]:
        self.part_with_the_gone()
        return [self._objects.context(context) for context in self.component.participating_contexts]

    def get_context_handle(self, cxt: Any) -> int:
        try:
            context: ExecutionContext = self._objects.context_behind(cxt)
        except RtcError:
            return -1
        return self.component.handle_of(context)

    # Actions, for contexts of other processes

    def on_initialize(self) -> Any:
        """Its manager has called this, and nobody else may."""
        return RTC.PRECONDITION_NOT_MET

    def on_finalize(self) -> Any:
        """`exit` calls this, and nobody else may."""
        return RTC.PRECONDITION_NOT_MET

    def on_startup(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_startup, exec_handle)

    def on_shutdown(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_shutdown, exec_handle)

    def on_activated(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_activated, exec_handle)

    def on_deactivated(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_deactivated, exec_handle)

    def on_aborting(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_aborting, exec_handle)

    def on_error(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_error, exec_handle)

    def on_reset(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_reset, exec_handle)

    def on_execute(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_execute, exec_handle)

    def on_state_update(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_state_update, exec_handle)

    def on_rate_changed(self, exec_handle: int) -> Any:
        return self._act(self.component.participation.on_rate_changed, exec_handle)

    def _act(self, action: Callable[[int], ReturnCode], handle: int) -> Any:
        """Only contexts that the component takes part in may call: nobody else knows a handle."""
        try:
            self.component.context_of(handle)
        except RtcError:
            return RTC.BAD_PARAMETER
        return to_return_code(action(handle))

    # SDO

    def get_owned_organizations(self) -> list[Any]:
        return [self._objects.organization(one) for one in organizations_of(self.component).owned]

    def get_organizations(self) -> list[Any]:
        self.part_with_the_gone()
        return [
            self._objects.organization(one) if isinstance(one, Organization) else one
            for one in organizations_of(self.component).joined
        ]

    def get_sdo_id(self) -> str:
        return self.component.instance_name

    def get_sdo_type(self) -> str:
        return self.component.properties.get("description", "")

    def get_device_profile(self) -> Any:
        return self._configuration.device

    def get_service_profiles(self) -> list[Any]:
        service = self._fsm_service()
        return [] if service is None else [SDOPackage.ServiceProfile(FSM_SERVICE, FSM_SERVICE, [], service)]

    def get_service_profile(self, id: str) -> Any:
        for profile in self.get_service_profiles():
            if id in (profile.id, profile.interface_type):
                return profile
        raise SDOPackage.InvalidParameter(f"{self.component.instance_name} provides no service '{id}'")

    def get_sdo_service(self, id: str) -> Any:
        return self.get_service_profile(id).service

    def get_configuration(self) -> Any:
        if self._closed:
            raise SDOPackage.NotAvailable(f"{self.component.instance_name} has ended")
        return self._objects.orb.activate(self._configuration)

    def get_monitoring(self) -> Any:
        raise SDOPackage.InterfaceNotImplemented("components have no monitoring")

    def get_status_list(self) -> list[Any]:
        return []

    def get_status(self, name: str) -> Any:
        raise SDOPackage.InvalidParameter(f"{self.component.instance_name} has no status '{name}'")

    # What others leave behind

    def belongs_elsewhere(self) -> bool:
        """Whether it has contexts or organizations of other processes."""
        contexts, organizations = (
            self.component.participating_contexts,
            organizations_of(self.component).joined,
        )
        return any(isinstance(one, ForeignContext) for one in contexts) or any(
            not isinstance(one, Organization) for one in organizations
        )

    def part_with_the_gone(self) -> None:
        """Let go of contexts and organizations whose processes have ended: tools would fail at each of them.

        A member of a composite that has gone runs by itself again.
        """
        component = self.component
        for context in component.participating_contexts:
            if isinstance(context, ForeignContext) and not context.is_there():
                component.participation.part(component.handle_of(context))
        if organizations_of(component).leave_those(_has_gone):
            for owned in component.owned_contexts:
                owned.start()

    def _fsm_service(self) -> Any | None:
        service = fsm_service_of(self.component)
        if service is None or self._closed:
            return None
        if self._fsm is None or self._fsm.service is not service:
            self._fsm = FsmServant(service)
        return self._objects.orb.activate(self._fsm)


def _has_gone(organization: object) -> bool:
    return not isinstance(organization, Organization) and not is_there(organization)
