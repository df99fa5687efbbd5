"""Components under their old names.

An old component is an object of its own, so that the names it uses for itself meet none of ours; behind it stands a
muros component (`_Behind`) that contexts, ports and other processes know, and that calls the old one's actions.
"""
# ruff: noqa: N802, N815 (the names are those that components know)

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable
from typing import Any, ClassVar

from muros.rtc.actions import ACTIONS, Action, ComponentEvent
from muros.rtc.codes import ReturnCode
from muros.rtc.component import Component
from muros.rtc.configuration import ConfigEvent, ConfigurationSet
from muros.rtc.manager._logger import LEVELS, LOGGER_NAME
from muros.rtc.ports import Port
from OpenRTM_aist._adapter import Adapter
from OpenRTM_aist._codes import codes, to_code
from OpenRTM_aist._config_admin import ConfigAdmin, to_properties
from OpenRTM_aist._data_ports import InPort, OutPort
from OpenRTM_aist._listening import Listening, Registry
from OpenRTM_aist._ports import (
    PortBase,
    PortConnectListenerType,
    PortConnectRetListenerType,
    connect_call,
    connect_ret_call,
)
from OpenRTM_aist._properties import Properties
from OpenRTM_aist._strings import stringTo

__all__ = [
    "ConfigurationParamListener",
    "ConfigurationParamListenerType",
    "ConfigurationSetListener",
    "ConfigurationSetListenerType",
    "ConfigurationSetNameListener",
    "ConfigurationSetNameListenerType",
    "DataFlowComponentBase",
    "Delete",
    "ExecutionContextActionListener",
    "ExecutionContextActionListenerType",
    "Logger",
    "PortActionListener",
    "PortActionListenerType",
    "PostComponentActionListener",
    "PostComponentActionListenerType",
    "PreComponentActionListener",
    "PreComponentActionListenerType",
    "RTObject_impl",
]


class _Behind(Component):
    """What muros knows of an old component."""

    def __init__(self, outer: RTObject_impl) -> None:
        super().__init__()
        self.outer = outer

    @classmethod
    def declarations(cls) -> tuple[()]:
        return ()


def _forward(action: Action) -> Callable[..., Any]:
    def call(self: _Behind, *handle: int) -> Any:
        return getattr(self.outer, action.rtc_name)(*handle)

    return call


for _action in ACTIONS:
    setattr(_Behind, _action.value, _forward(_action))
    setattr(_Behind, _action.rtc_name, getattr(_Behind, _action.value))


# Listeners of a component


class _Points:
    """Numbers for moments, as components give them."""

    events: ClassVar[tuple[Any, ...]]

    @classmethod
    def event(cls, number: int) -> Any:
        return cls.events[number]


_ORDER = (
    Action.INITIALIZE,
    Action.FINALIZE,
    Action.STARTUP,
    Action.SHUTDOWN,
    Action.ACTIVATED,
    Action.DEACTIVATED,
    Action.ABORTING,
    Action.ERROR,
    Action.RESET,
    Action.EXECUTE,
    Action.STATE_UPDATE,
    Action.RATE_CHANGED,
)


class PreComponentActionListenerType(_Points):
    """Before an action; listeners are given the context's handle."""

    (
        PRE_ON_INITIALIZE,
        PRE_ON_FINALIZE,
        PRE_ON_STARTUP,
        PRE_ON_SHUTDOWN,
        PRE_ON_ACTIVATED,
        PRE_ON_DEACTIVATED,
        PRE_ON_ABORTING,
        PRE_ON_ERROR,
        PRE_ON_RESET,
        PRE_ON_EXECUTE,
        PRE_ON_STATE_UPDATE,
        PRE_ON_RATE_CHANGED,
        PRE_COMPONENT_ACTION_LISTENER_NUM,
    ) = range(13)
    events = tuple(("PRE", action) for action in _ORDER)


class PostComponentActionListenerType(_Points):
    """After an action; listeners are given the context's handle and the return code."""

    (
        POST_ON_INITIALIZE,
        POST_ON_FINALIZE,
        POST_ON_STARTUP,
        POST_ON_SHUTDOWN,
        POST_ON_ACTIVATED,
        POST_ON_DEACTIVATED,
        POST_ON_ABORTING,
        POST_ON_ERROR,
        POST_ON_RESET,
        POST_ON_EXECUTE,
        POST_ON_STATE_UPDATE,
        POST_ON_RATE_CHANGED,
        POST_COMPONENT_ACTION_LISTENER_NUM,
    ) = range(13)
    events = tuple(("POST", action) for action in _ORDER)


class PortActionListenerType(_Points):
    """Ports come and go; listeners are given the port's profile."""

    ADD_PORT, REMOVE_PORT, PORT_ACTION_LISTENER_NUM = range(3)
    events = (ComponentEvent.ADD_PORT, ComponentEvent.REMOVE_PORT)


class ExecutionContextActionListenerType(_Points):
    """Contexts come and go; listeners are given the handle."""

    EC_ATTACHED, EC_DETACHED, EC_ACTION_LISTENER_NUM = range(3)
    events = (ComponentEvent.EC_ATTACHED, ComponentEvent.EC_DETACHED)


class ConfigurationParamListenerType(_Points):
    ON_UPDATE_CONFIG_PARAM, CONFIG_PARAM_LISTENER_NUM = range(2)
    events = (ConfigEvent.UPDATE_CONFIG_PARAM,)


class ConfigurationSetListenerType(_Points):
    ON_SET_CONFIG_SET, ON_ADD_CONFIG_SET, CONFIG_SET_LISTENER_NUM = range(3)
    events = (ConfigEvent.SET_CONFIG_SET, ConfigEvent.ADD_CONFIG_SET)


class ConfigurationSetNameListenerType(_Points):
    (
        ON_UPDATE_CONFIG_SET,
        ON_REMOVE_CONFIG_SET,
        ON_ACTIVATE_CONFIG_SET,
        CONFIG_SET_NAME_LISTENER_NUM,
    ) = range(4)
    events = (ConfigEvent.UPDATE_CONFIG_SET, ConfigEvent.REMOVE_CONFIG_SET, ConfigEvent.ACTIVATE_CONFIG_SET)


class PreComponentActionListener:
    """Base of listeners: override `__call__(ec_id)`."""

    def __call__(self, ec_id: int) -> None: ...


class PostComponentActionListener:
    """Base of listeners: override `__call__(ec_id, ret)`."""

    def __call__(self, ec_id: int, ret: Any) -> None: ...


class PortActionListener:
    """Base of listeners: override `__call__(profile)`."""

    def __call__(self, pprof: Any) -> None: ...


class ExecutionContextActionListener:
    """Base of listeners: override `__call__(ec_id)`."""

    def __call__(self, ec_id: int) -> None: ...


class ConfigurationParamListener:
    """Base of listeners: override `__call__(set and parameter, text)`."""

    def __call__(self, config_param_name: str, config_value: str) -> None: ...


class ConfigurationSetListener:
    """Base of listeners: override `__call__(set)`, which is given `Properties` with the set's name."""

    def __call__(self, config_set: Any) -> None: ...


class ConfigurationSetNameListener:
    """Base of listeners: override `__call__(name of the set)`."""

    def __call__(self, config_set_name: str) -> None: ...


class Logger:
    """The log as old components write to it: `RTC_INFO("%s is %d", (name, number))`."""

    def __init__(self, name: str = "") -> None:
        self._log = logging.getLogger(LOGGER_NAME).getChild(name.replace(".", "_") or "component")

    def write(self, level: str, message: str, arguments: Any = None) -> None:
        number = LEVELS[level]
        if self._log.isEnabledFor(number):
            values = arguments if isinstance(arguments, tuple) else () if arguments is None else (arguments,)
            try:
                text = message % values if values else message
            except (TypeError, ValueError):
                text = f"{message} {values!r}"
            self._log.log(number, "%s", text)

    @staticmethod
    def print_exception() -> str:
        """The error that is being handled, with its way through the program, as a text for the log."""
        return traceback.format_exc()

    def RTC_LOG(self, level: str, message: str, arguments: Any = None) -> None:
        self.write(level.upper(), message, arguments)

    def RTC_FATAL(self, message: str, arguments: Any = None) -> None:
        self.write("FATAL", message, arguments)

    def RTC_ERROR(self, message: str, arguments: Any = None) -> None:
        self.write("ERROR", message, arguments)

    def RTC_WARN(self, message: str, arguments: Any = None) -> None:
        self.write("WARN", message, arguments)

    def RTC_INFO(self, message: str, arguments: Any = None) -> None:
        self.write("INFO", message, arguments)

    def RTC_DEBUG(self, message: str, arguments: Any = None) -> None:
        self.write("DEBUG", message, arguments)

    def RTC_TRACE(self, message: str, arguments: Any = None) -> None:
        self.write("TRACE", message, arguments)

    def RTC_VERBOSE(self, message: str, arguments: Any = None) -> None:
        self.write("VERBOSE", message, arguments)

    def RTC_PARANOID(self, message: str, arguments: Any = None) -> None:
        self.write("PARANOID", message, arguments)


class RTObject_impl:  # noqa: N801
    """Base of old components: override the actions (`onInitialize`, `onExecute`, ...), which answer a return code."""

    def __init__(self, manager: Any = None, orb: Any = None, poa: Any = None) -> None:
        self._behind = _Behind(self)
        self._listening = Listening()
        self._manager = manager
        self._rtcout = Logger(type(self).__name__)

    # Actions

    def onInitialize(self) -> Any:
        return codes().RTC_OK

    def onFinalize(self) -> Any:
        return codes().RTC_OK

    def onStartup(self, ec_id: int) -> Any:
        return codes().RTC_OK

    def onShutdown(self, ec_id: int) -> Any:
        return codes().RTC_OK

    def onActivated(self, ec_id: int) -> Any:
        return codes().RTC_OK

    def onDeactivated(self, ec_id: int) -> Any:
        return codes().RTC_OK

    def onExecute(self, ec_id: int) -> Any:
        return codes().RTC_OK

    def onAborting(self, ec_id: int) -> Any:
        return codes().RTC_OK

    def onError(self, ec_id: int) -> Any:
        return codes().RTC_OK

    def onReset(self, ec_id: int) -> Any:
        return codes().RTC_OK

    def onStateUpdate(self, ec_id: int) -> Any:
        return codes().RTC_OK

    def onRateChanged(self, ec_id: int) -> Any:
        return codes().RTC_OK

    # What it is

    @property
    def _properties(self) -> Properties:
        return Properties.of(self._behind.properties)

    def getProperties(self) -> Properties:
        return self._properties

    def setProperties(self, prop: Properties) -> None:
        self._behind.properties.update(prop.as_dict())

    def getInstanceName(self) -> str:
        return self._behind.instance_name

    def setInstanceName(self, instance_name: str) -> None:
        """Before the component runs."""
        self._behind.instance_name = instance_name

    def getTypeName(self) -> str:
        return self._behind.properties["type_name"]

    def getDescription(self) -> str:
        return self._behind.properties["description"]

    def getVersion(self) -> str:
        return self._behind.properties["version"]

    def getVendor(self) -> str:
        return self._behind.properties["vendor"]

    def getCategory(self) -> str:
        return self._behind.properties["category"]

    def getNamingNames(self) -> list[str]:
        return self._behind.properties.get("naming.names", "").split(",")

    def getObjRef(self) -> Any:
        """The reference that others call; None before they know the component."""
        return self._manager.reference_of(self) if self._manager is not None else None

    def _this(self) -> Any:
        return self.getObjRef()

    def _default_POA(self) -> Adapter:
        """What gives the component's reference to programs that see a servant in it."""
        return Adapter(None)

    def getManager(self) -> Any:
        return self._manager

    # Ports

    def addInPort(self, name: str, inport: InPort) -> bool:
        return self.addPort(inport)

    def addOutPort(self, name: str, outport: OutPort) -> bool:
        return self.addPort(outport)

    def addPort(self, port: PortBase) -> bool:
        """Add a port of any kind."""
        self._behind.add_port(port.port)
        port.port.configuration = {**port.wishes, **port.port.configuration}
        return True

    def registerInPort(self, name: str, inport: InPort) -> bool:
        return self.addPort(inport)

    def registerOutPort(self, name: str, outport: OutPort) -> bool:
        return self.addPort(outport)

    def registerPort(self, port: PortBase) -> bool:
        return self.addPort(port)

    def removePort(self, port: PortBase) -> bool:
        known = port.port in self._behind.ports
        self._behind.remove_port(port.port)
        return known

    removeInPort = removeOutPort = deletePort = removePort

    def readAll(self) -> bool:
        return self._behind.read_all()

    def writeAll(self) -> bool:
        return self._behind.write_all()

    def setReadAll(self, read: bool = True, completion: bool = False) -> None:
        """Read all InPorts before each onExecute; without `completion`, only if all had something does it run."""
        self._behind.reads_all, self._behind.read_all_completion = read, completion

    def setWriteAll(self, write: bool = True, completion: bool = False) -> None:
        """Write all OutPorts after each onExecute."""
        self._behind.writes_all, self._behind.write_all_completion = write, completion

    # Configuration

    def bindParameter(
        self,
        param_name: str,
        var: list[Any],
        def_val: str,
        trans: Callable[[list[Any], str], Any] | None = None,
    ) -> bool:
        """Bind a one-element list to a parameter: its element is set whenever the component may see a new value."""
        convert_in_place = trans or stringTo
        kind = list(var)

        def convert(text: str) -> Any:
            made = list(kind)
            answer = convert_in_place(made, text)
            if isinstance(answer, tuple):  # as version 2 has it: whether it can be, and the value
                answer, made[0] = answer
            if answer is False:
                raise ValueError(f"{text!r} is no {type(kind[0]).__name__ if kind else 'value'}")
            return made[0]

        def assign(value: Any) -> None:
            var[:1] = [value]

        self._behind.configuration.bind(param_name, def_val, convert, assign)
        return True

    @property
    def _configsets(self) -> ConfigAdmin:
        return ConfigAdmin(self._behind.configuration)

    def getConfigService(self) -> ConfigAdmin:
        """The configuration."""
        return self._configsets

    def updateParameters(self, config_set: str) -> None:
        """Take a set's values over now."""
        self._behind.configuration.activate(config_set)
        self._behind.configuration.update()

    # Contexts

    def getExecutionContext(self, ec_id: int = 0) -> Any:
        """The reference to the context of a handle; None before others know the component."""
        reference = self.getObjRef()
        return None if reference is None else reference.get_context(ec_id)

    def getExecutionRate(self, ec_id: int = 0) -> float:
        return self._behind.context_of(ec_id).rate

    def setExecutionRate(self, ec_id: int, rate: float) -> Any:
        return to_code(self._behind.context_of(ec_id).set_rate(rate))

    def isOwnExecutionContext(self, ec_id: int) -> bool:
        return ec_id < len(self._behind.owned_contexts)

    def activate(self, ec_id: int = 0) -> Any:
        return to_code(self._behind.context_of(ec_id).activate_component(self._behind.participation))

    def deactivate(self, ec_id: int = 0) -> Any:
        return to_code(self._behind.context_of(ec_id).deactivate_component(self._behind.participation))

    def reset(self, ec_id: int = 0) -> Any:
        return to_code(self._behind.context_of(ec_id).reset_component(self._behind.participation))

    def exit(self) -> Any:
        return to_code(self._behind.exit())

    # Listeners

    def addPreComponentActionListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        event = PreComponentActionListenerType.event(listener_type)
        return self._listening.begin(event, listener, listener, self._behind.listeners)

    def removePreComponentActionListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        event = PreComponentActionListenerType.event(listener_type)
        self._listening.end(event, listener, self._behind.listeners)

    def addPostComponentActionListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        def call(handle: int, code: ReturnCode) -> None:
            listener(handle, to_code(code))

        event = PostComponentActionListenerType.event(listener_type)
        return self._listening.begin(event, listener, call, self._behind.listeners)

    def removePostComponentActionListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        event = PostComponentActionListenerType.event(listener_type)
        self._listening.end(event, listener, self._behind.listeners)

    def addPortActionListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        def call(port: Port) -> None:
            listener(port.profile())

        event = PortActionListenerType.event(listener_type)
        return self._listening.begin(event, listener, call, self._behind.listeners)

    def removePortActionListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        self._listening.end(PortActionListenerType.event(listener_type), listener, self._behind.listeners)

    def addExecutionContextActionListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        event = ExecutionContextActionListenerType.event(listener_type)
        return self._listening.begin(event, listener, listener, self._behind.listeners)

    def removeExecutionContextActionListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        event = ExecutionContextActionListenerType.event(listener_type)
        self._listening.end(event, listener, self._behind.listeners)

    def addPortConnectListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        """At all ports that the component has."""
        event = PortConnectListenerType.event(listener_type)
        return self._listening.begin(event, listener, connect_call(listener), *self._connects())

    def removePortConnectListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        self._listening.end(PortConnectListenerType.event(listener_type), listener, *self._connects())

    def addPortConnectRetListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        """At all ports that the component has."""
        event = PortConnectRetListenerType.event(listener_type)
        return self._listening.begin(event, listener, connect_ret_call(listener), *self._connects())

    def removePortConnectRetListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        self._listening.end(PortConnectRetListenerType.event(listener_type), listener, *self._connects())

    def addConfigurationParamListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        event = ConfigurationParamListenerType.event(listener_type)
        return self._listening.begin(event, listener, listener, self._behind.configuration.listeners)

    def removeConfigurationParamListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        event = ConfigurationParamListenerType.event(listener_type)
        self._listening.end(event, listener, self._behind.configuration.listeners)

    def addConfigurationSetListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        def call(one: ConfigurationSet) -> None:
            listener(to_properties(one))

        event = ConfigurationSetListenerType.event(listener_type)
        return self._listening.begin(event, listener, call, self._behind.configuration.listeners)

    def removeConfigurationSetListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        event = ConfigurationSetListenerType.event(listener_type)
        self._listening.end(event, listener, self._behind.configuration.listeners)

    def addConfigurationSetNameListener(
        self, listener_type: int, listener: Callable[..., Any], autoclean: bool = True
    ) -> Callable[..., Any]:
        event = ConfigurationSetNameListenerType.event(listener_type)
        return self._listening.begin(event, listener, listener, self._behind.configuration.listeners)

    def removeConfigurationSetNameListener(self, listener_type: int, listener: Callable[..., Any]) -> None:
        event = ConfigurationSetNameListenerType.event(listener_type)
        self._listening.end(event, listener, self._behind.configuration.listeners)

    def _connects(self) -> list[Registry]:
        return [port.connect_listeners for port in self._behind.ports if isinstance(port, Port)]

    # What others may ask of the component, for those that ask it here

    def get_ports(self) -> list[Any]:
        return list(self.getObjRef().get_ports())

    def get_owned_contexts(self) -> list[Any]:
        return list(self.getObjRef().get_owned_contexts())

    def get_participating_contexts(self) -> list[Any]:
        return list(self.getObjRef().get_participating_contexts())

    def get_component_profile(self) -> Any:
        return self.getObjRef().get_component_profile()

    def get_configuration(self) -> Any:
        return self.getObjRef().get_configuration()

    def get_context(self, ec_id: int) -> Any:
        return self.getObjRef().get_context(ec_id)

    def is_alive(self, exec_context: Any) -> bool:
        return bool(self.getObjRef().is_alive(exec_context))


DataFlowComponentBase = RTObject_impl


def Delete(rtc: Any) -> None:
    """What factories are given to do away with a component: nothing is left to do."""
