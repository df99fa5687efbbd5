"""The RTC profile of a component that runs, in whichever style it is written."""

from __future__ import annotations

from muros.rtc.actions import ACTIONS as RTC_ACTIONS
from muros.rtc.codes import Polarity, PortType
from muros.rtc.component import Component
from muros.rtc.ports import Port
from muros.rtc.profile_xml._model import (
    ACTIONS,
    DataPortProfile,
    ParameterProfile,
    RtcProfile,
    ServiceInterfaceProfile,
    ServicePortProfile,
)

__all__ = ["profile_of"]

DIRECTIONS = {PortType.DATA_IN: "DataInPort", PortType.DATA_OUT: "DataOutPort"}


def profile_of(component: Component) -> RtcProfile:
    """What an editor would know of `component`: its profile, actions, parameters and ports.

    It must be initialized, for that is when ports and parameters are made. IDL files are not known.
    """
    values = component.properties
    sets = {one.id: one.values for one in component.configuration.sets()}
    hints = {hint: sets.get(hint, {}) for hint in ("__type__", "__constraints__", "__widget__")}
    parameters = [
        ParameterProfile(
            name,
            hints["__type__"].get(name, "string"),
            text,
            "",
            hints["__constraints__"].get(name, ""),
            hints["__widget__"].get(name, ""),
        )
        for name, text in sets.get("default", {}).items()
    ]
    rate = values.get("exec_cxt.periodic.rate", "").strip()
    limit = values.get("max_instance", "").strip()
    return RtcProfile(
        values["implementation_id"],
        values["version"],
        values["vendor"],
        values["category"],
        values["description"],
        execution_type=values.get("exec_cxt.periodic.type", "PeriodicExecutionContext"),
        execution_rate=float(rate) if rate.replace(".", "", 1).isdigit() else None,
        max_instances=int(limit) if limit.isdigit() else 0,
        language=values.get("language", "Python"),
        actions=_actions(component),
        parameters=tuple(parameters),
        data_ports=tuple(_data_port(port) for port in component.ports if port.port_type in DIRECTIONS),
        service_ports=tuple(
            _service_port(port) for port in component.ports if port.port_type is PortType.SERVICE
        ),
    )


def _actions(component: Component) -> dict[str, bool]:
    """Which actions the component's own classes define, by either name."""
    user = getattr(component, "outer", component)  # that of a component in the style of OpenRTM-aist
    classes = [
        kind for kind in type(user).__mro__ if not kind.__module__.startswith(("muros.", "OpenRTM_aist"))
    ]
    defined = {name for kind in classes for name in vars(kind)}
    said = {}
    for action in RTC_ACTIONS:
        name = action.rtc_name[0].upper() + action.rtc_name[1:]
        if name in ACTIONS:
            said[name] = bool({action.value, action.rtc_name} & defined)
    return said


def _data_port(port: Port) -> DataPortProfile:
    kind = port.profile().properties.get("dataport.data_type", "")
    return DataPortProfile(port.name, DIRECTIONS[port.port_type], _idl_name(kind))


def _service_port(port: Port) -> ServicePortProfile:
    interfaces = [
        ServiceInterfaceProfile(
            one.instance_name, one.instance_name, one.type_name, one.polarity is Polarity.PROVIDED
        )
        for one in port.profile().interfaces
    ]
    return ServicePortProfile(port.name, tuple(interfaces))


def _idl_name(repository_id: str) -> str:
    """`RTC::TimedLong` of `IDL:RTC/TimedLong:1.0`."""
    if repository_id.startswith("IDL:"):
        return repository_id.split(":")[1].replace("/", "::")
    return repository_id
