"""What programs do with components of other processes, under the old names: `OpenRTM_aist.CORBA_RTCUtil.activate(...)`.

Components and ports are CORBA references; for one that is None a function answers BAD_PARAMETER, False, None or
nothing. Contexts are told by handles: 0 and up those that the component owns, 1000 and up those it takes part in.
Where a process does not answer, CORBA's exceptions (`CORBA.TRANSIENT` ...) come to the program.
"""
# ruff: noqa: N999 (the names are those that programs know)

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final

from OpenRTM_aist import NVUtil
from OpenRTM_aist._codes import codes
from OpenRTM_aist._manager import Manager
from OpenRTM_aist._properties import Properties

__all__ = [
    "activate",
    "add_rtc_to_default_ec",
    "already_connected",
    "connect",
    "connect_by_name",
    "connect_multi",
    "create_connector",
    "deactivate",
    "disconnect",
    "disconnect_all_by_name",
    "disconnect_all_by_ref",
    "disconnect_by_port_name",
    "disconnect_by_portname_connector_id",
    "disconnect_by_portname_connector_name",
    "disconnect_by_portref_connector_id",
    "disconnect_by_portref_connector_name",
    "get_active_configuration",
    "get_active_configuration_name",
    "get_actual_ec",
    "get_component_profile",
    "get_configuration",
    "get_connector_ids",
    "get_connector_ids_by_portref",
    "get_connector_names",
    "get_connector_names_by_portref",
    "get_current_rate",
    "get_default_rate",
    "get_ec_id",
    "get_inport_names",
    "get_outport_names",
    "get_parameter_by_key",
    "get_participants_rtc",
    "get_port_by_name",
    "get_port_by_url",
    "get_port_names",
    "get_state",
    "get_svcport_names",
    "is_alive_in_default_ec",
    "is_existing",
    "is_in_active",
    "is_in_error",
    "is_in_inactive",
    "remove_rtc_to_default_ec",
    "reset",
    "set_active_configuration",
    "set_configuration",
    "set_configuration_parameter",
    "set_current_rate",
    "set_default_rate",
]

PARTICIPATING: Final = 1000
"""The handle of the first context that a component takes part in and does not own."""


# The component


def get_component_profile(rtc: Any) -> Properties:
    """What the component says of itself."""
    return Properties() if rtc is None else NVUtil.toProperties(rtc.get_component_profile().properties)


def is_existing(rtc: Any) -> bool:
    """Whether its process answers, and knows it."""
    from muros.rtc.corba._naming import lives

    return rtc is not None and lives(rtc)


def is_alive_in_default_ec(rtc: Any) -> bool:
    """Whether it is alive in the first context that it owns."""
    ec = get_actual_ec(rtc)
    return ec is not None and bool(rtc.is_alive(ec))


# Contexts and states


def get_actual_ec(rtc: Any, ec_id: int = 0) -> Any:
    """The context of a handle; None where there is none."""
    if rtc is None or ec_id < 0:
        return None
    contexts = rtc.get_owned_contexts() if ec_id < PARTICIPATING else rtc.get_participating_contexts()
    place = ec_id % PARTICIPATING
    return contexts[place] if place < len(contexts) else None


def get_ec_id(rtc: Any, ec: Any) -> int:
    """The handle of a context; -1 where it is none of the component's."""
    if rtc is None or ec is None:
        return -1
    for first, contexts in ((0, rtc.get_owned_contexts()), (PARTICIPATING, rtc.get_participating_contexts())):
        for place, one in enumerate(contexts):
            if one is not None and one._is_equivalent(ec):
                return first + place
    return -1


def activate(rtc: Any, ec_id: int = 0) -> Any:
    """Make the component active in a context; the return code."""
    return _ask_context(rtc, ec_id, lambda ec: ec.activate_component(rtc))


def deactivate(rtc: Any, ec_id: int = 0) -> Any:
    """Make the component inactive in a context; the return code."""
    return _ask_context(rtc, ec_id, lambda ec: ec.deactivate_component(rtc))


def reset(rtc: Any, ec_id: int = 0) -> Any:
    """Bring the component from the error state to the inactive one; the return code."""
    return _ask_context(rtc, ec_id, lambda ec: ec.reset_component(rtc))


def get_state(rtc: Any, ec_id: Any = 0, *more: Any) -> Any:
    """Whether there is such a context, and the component's state in it: `there, state = get_state(rtc)`.

    As in version 1, `get_state(states, rtc, ec_id)` puts the state into a list of one element and answers the first.
    """
    if isinstance(rtc, list):
        there, state = get_state(ec_id, *more)
        rtc[:] = [state]
        return there
    ec = get_actual_ec(rtc, ec_id)
    return (False, codes().CREATED_STATE) if ec is None else (True, ec.get_component_state(rtc))


def is_in_inactive(rtc: Any, ec_id: int = 0) -> bool:
    return bool(get_state(rtc, ec_id) == (True, codes().INACTIVE_STATE))


def is_in_active(rtc: Any, ec_id: int = 0) -> bool:
    return bool(get_state(rtc, ec_id) == (True, codes().ACTIVE_STATE))


def is_in_error(rtc: Any, ec_id: int = 0) -> bool:
    return bool(get_state(rtc, ec_id) == (True, codes().ERROR_STATE))


def get_current_rate(rtc: Any, ec_id: int) -> float:
    """How often a second a context runs its components. LookupError where there is no such context."""
    ec = get_actual_ec(rtc, ec_id)
    if ec is None:
        raise LookupError(f"the component has no context of the handle {ec_id}")
    return float(ec.get_rate())


def set_current_rate(rtc: Any, ec_id: int, rate: float) -> Any:
    """Have a context run its components `rate` times a second; the return code."""
    return _ask_context(rtc, ec_id, lambda ec: ec.set_rate(rate))


def get_default_rate(rtc: Any) -> float:
    return get_current_rate(rtc, 0)


def set_default_rate(rtc: Any, rate: float) -> Any:
    return set_current_rate(rtc, 0, rate)


def add_rtc_to_default_ec(localcomp: Any, othercomp: Any) -> Any:
    """Have the first context of `localcomp` run `othercomp`, too; the return code."""
    if othercomp is None:
        return codes().BAD_PARAMETER
    return _ask_context(localcomp, 0, lambda ec: ec.add_component(othercomp))


def remove_rtc_to_default_ec(localcomp: Any, othercomp: Any) -> Any:
    """Have the first context of `localcomp` run `othercomp` no longer; the return code."""
    if othercomp is None:
        return codes().BAD_PARAMETER
    return _ask_context(localcomp, 0, lambda ec: ec.remove_component(othercomp))


def get_participants_rtc(rtc: Any) -> list[Any]:
    """The other components that the first context of `rtc` runs."""
    ec = get_actual_ec(rtc)
    return [] if ec is None else list(ec.get_profile().participants)


# Ports


def get_port_names(rtc: Any) -> list[str]:
    """The full names of its ports: `ConsoleIn0.out`."""
    return _port_names(rtc, lambda kind: True)


def get_inport_names(rtc: Any) -> list[str]:
    return _port_names(rtc, lambda kind: kind == "DataInPort")


def get_outport_names(rtc: Any) -> list[str]:
    return _port_names(rtc, lambda kind: kind == "DataOutPort")


def get_svcport_names(rtc: Any) -> list[str]:
    return _port_names(rtc, lambda kind: kind == "CorbaPort")


def get_port_by_name(rtc: Any, port_name: str) -> Any:
    """The port of that name, with or without the component's before it; None where there is none."""
    for port in () if rtc is None else rtc.get_ports():
        full = port.get_port_profile().name
        if port_name in (full, full.rpartition(".")[2]):
            return port
    return None


def get_port_by_url(port_name: str) -> Any:
    """The port at `rtcname://HOST/NAME.PORT` or `rtcloc://HOST:PORT/CATEGORY/NAME.PORT`; None where there is none."""
    component, _, port = port_name.rpartition(".")
    found = Manager.instance().getNaming().string_to_component(component)
    return get_port_by_name(found[0], port) if found else None


def get_connector_names(rtc: Any, port_name: str) -> list[str]:
    """The names of the connections of a component's port."""
    return get_connector_names_by_portref(get_port_by_name(rtc, port_name))


def get_connector_names_by_portref(port: Any) -> list[str]:
    return [connector.name for connector in _connectors(port)]


def get_connector_ids(rtc: Any, port_name: str) -> list[str]:
    """The ids of the connections of a component's port."""
    return get_connector_ids_by_portref(get_port_by_name(rtc, port_name))


def get_connector_ids_by_portref(port: Any) -> list[str]:
    return [connector.connector_id for connector in _connectors(port)]


# Connections


def create_connector(name: str, prop_arg: Properties | None, port0: Any, port1: Any = None) -> Any:
    """The profile of a request that joins two ports, or one with whatever it finds (`fsm_event_name`, topics)."""
    import RTC

    prop = Properties(prop_arg) if prop_arg is not None else Properties()
    for key, text in (
        ("dataport.dataflow_type", "push"),
        ("dataport.interface_type", "corba_cdr"),
        ("dataport.subscription_type", "flush"),
    ):
        if not prop.getProperty(key):
            prop.setProperty(key, text)
    request = RTC.ConnectorProfile(name, "", [port0] if port1 is None else [port0, port1], [])
    NVUtil.copyFromProperties(request.properties, prop)
    return request


def already_connected(localport: Any, otherport: Any) -> bool:
    """Whether a connection joins the two."""
    return any(_among(otherport, connector.ports) for connector in _connectors(localport))


def connect(name: str, prop: Properties | None, port0: Any, port1: Any) -> Any:
    """Join two ports; the return code."""
    if port0 is None or (port1 is not None and port0._is_equivalent(port1)):
        return codes().BAD_PARAMETER
    return port0.connect(create_connector(name, prop, port0, port1))[0]


def connect_multi(name: str, prop: Properties | None, port: Any, target_ports: Iterable[Any]) -> Any:
    """Join a port with each of several; those that are joined already stay so. RTC_OK if all is well."""
    if port is None:
        return codes().BAD_PARAMETER
    wanted = [one for one in target_ports if one is not None and not one._is_equivalent(port)]
    answers = [connect(name, prop, port, one) for one in wanted if not already_connected(port, one)]
    return codes().RTC_OK if all(code == codes().RTC_OK for code in answers) else codes().BAD_PARAMETER


def connect_by_name(
    name: str, prop: Properties | None, rtc0: Any, port_name0: str, rtc1: Any, port_name1: str
) -> Any:
    """Join two ports told by their names; the return code."""
    port0, port1 = get_port_by_name(rtc0, port_name0), get_port_by_name(rtc1, port_name1)
    return codes().BAD_PARAMETER if port0 is None or port1 is None else connect(name, prop, port0, port1)


def disconnect(connector_prof: Any) -> Any:
    """End a connection; the return code. Any of its ports whose process answers will do."""
    from omniORB import CORBA

    lost: Exception | None = None
    for port in connector_prof.ports:
        try:
            return disconnect_by_portref_connector_id(port, connector_prof.connector_id)
        except CORBA.SystemException as error:
            lost = error
    if lost is not None:
        raise lost
    return codes().BAD_PARAMETER


def disconnect_by_portref_connector_name(port_ref: Any, conn_name: str) -> Any:
    """End the connection of that name; the return code, BAD_PARAMETER where there is none."""
    return _disconnect_first(port_ref, lambda connector: connector.name == conn_name)


def disconnect_by_portname_connector_name(port_name: str, conn_name: str) -> Any:
    """The same for a port told as in `get_port_by_url`."""
    return disconnect_by_portref_connector_name(get_port_by_url(port_name), conn_name)


def disconnect_by_portref_connector_id(port_ref: Any, conn_id: str) -> Any:
    """End the connection of that id; the return code."""
    return codes().BAD_PARAMETER if port_ref is None else port_ref.disconnect(conn_id)


def disconnect_by_portname_connector_id(port_name: str, conn_id: str) -> Any:
    """The same for a port told as in `get_port_by_url`."""
    return disconnect_by_portref_connector_id(get_port_by_url(port_name), conn_id)


def disconnect_by_port_name(localport: Any, othername: str) -> Any:
    """End the connection with the port of that full name; the return code, BAD_PARAMETER where there is none."""
    if localport is None or localport.get_port_profile().name == othername:
        return codes().BAD_PARAMETER

    def joins(connector: Any) -> bool:
        return any(port.get_port_profile().name == othername for port in connector.ports if is_existing(port))

    return _disconnect_first(localport, joins)


def disconnect_all_by_ref(port_ref: Any) -> Any:
    """End all connections of a port; the return code."""
    return codes().BAD_PARAMETER if port_ref is None else port_ref.disconnect_all()


def disconnect_all_by_name(port_name: str) -> Any:
    """The same for a port told as in `get_port_by_url`."""
    return disconnect_all_by_ref(get_port_by_url(port_name))


# Configuration


def get_configuration(rtc: Any, conf_name: str) -> Properties:
    """The parameters of a configuration set. SDOPackage's exceptions where there is none of that name."""
    return NVUtil.toProperties(rtc.get_configuration().get_configuration_set(conf_name).configuration_data)


def get_parameter_by_key(rtc: Any, confset_name: str, value_name: str) -> str:
    """One parameter of a configuration set, empty where it has none of that name."""
    return get_configuration(rtc, confset_name).getProperty(value_name)


def get_active_configuration_name(rtc: Any) -> str:
    return str(rtc.get_configuration().get_active_configuration_set().id)


def get_active_configuration(rtc: Any) -> Properties:
    """The parameters of the active set."""
    return NVUtil.toProperties(rtc.get_configuration().get_active_configuration_set().configuration_data)


def set_configuration(rtc: Any, confset_name: str, value_name: str, value: str) -> bool:
    """Set a parameter of a set, and make the set active. False where the component refuses."""
    return _set(rtc, lambda conf: conf.get_configuration_set(confset_name), value_name, value)


def set_active_configuration(rtc: Any, value_name: str, value: str) -> bool:
    """Set a parameter of the active set. False where the component refuses."""
    return _set(rtc, lambda conf: conf.get_active_configuration_set(), value_name, value)


def set_configuration_parameter(conf: Any, confset: Any, value_name: str, value: str) -> bool:
    """Set a parameter of `confset`, here and in the configuration `conf`, which keeps it until the set is activated."""
    values = NVUtil.toProperties(confset.configuration_data)
    values.setProperty(value_name, value)
    NVUtil.copyFromProperties(confset.configuration_data, values)
    return bool(conf.set_configuration_set_values(confset))


def _ask_context(rtc: Any, ec_id: int, ask: Callable[[Any], Any]) -> Any:
    ec = get_actual_ec(rtc, ec_id)
    return codes().BAD_PARAMETER if ec is None else ask(ec)


def _port_names(rtc: Any, wanted: Callable[[str], bool]) -> list[str]:
    profiles = [] if rtc is None else [port.get_port_profile() for port in rtc.get_ports()]
    return [one.name for one in profiles if wanted(NVUtil.toString(one.properties, "port.port_type"))]


def _connectors(port: Any) -> list[Any]:
    return [] if port is None else list(port.get_connector_profiles())


def _among(port: Any, ports: Iterable[Any]) -> bool:
    return any(one is not None and one._is_equivalent(port) for one in ports)


def _disconnect_first(port: Any, wanted: Callable[[Any], bool]) -> Any:
    found = next((connector for connector in _connectors(port) if wanted(connector)), None)
    return codes().BAD_PARAMETER if found is None else disconnect(found)


def _set(rtc: Any, choose: Callable[[Any], Any], value_name: str, value: str) -> bool:
    from omniORB import CORBA

    try:
        conf = rtc.get_configuration()
        confset = choose(conf)
        set_configuration_parameter(conf, confset, value_name, value)
        return bool(conf.activate_configuration_set(confset.id))
    except CORBA.UserException:
        return False
