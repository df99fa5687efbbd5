"""The names that components written for OpenRTM-aist-Python use, on muros: such components run unchanged.

Only names and signatures stand here; what they do is muros.rtc's. New components are written with that, see
docs/rtc.md. Stubs (`import RTC`) come from one place for all of the process.
"""
# ruff: noqa: N999

from typing import TYPE_CHECKING
from uuid import uuid1

from muros.rtc.corba._top_level import look_for_idl as _look_for_idl
from OpenRTM_aist import CORBA_SeqUtil, Guard, NVUtil, StaticFSM, StringUtil
from OpenRTM_aist._absent import what_instead as _what_instead
from OpenRTM_aist._components import (
    ConfigurationParamListener,
    ConfigurationParamListenerType,
    ConfigurationSetListener,
    ConfigurationSetListenerType,
    ConfigurationSetNameListener,
    ConfigurationSetNameListenerType,
    DataFlowComponentBase,
    Delete,
    ExecutionContextActionListener,
    ExecutionContextActionListenerType,
    Logger,
    PortActionListener,
    PortActionListenerType,
    PostComponentActionListener,
    PostComponentActionListenerType,
    PreComponentActionListener,
    PreComponentActionListenerType,
    RTObject_impl,
)
from OpenRTM_aist._config_admin import ConfigAdmin
from OpenRTM_aist._corba_naming import CorbaNaming
from OpenRTM_aist._data_ports import (
    ConnectorDataListener,
    ConnectorDataListenerT,
    ConnectorDataListenerType,
    ConnectorInfo,
    ConnectorListener,
    ConnectorListenerStatus,
    ConnectorListenerType,
    DataPortStatus,
    InPort,
    InPortBase,
    OnRead,
    OnReadConvert,
    OnWrite,
    OnWriteConvert,
    OutPort,
    OutPortBase,
    PortType,
    RingBuffer,
    instantiateDataType,
)
from OpenRTM_aist._manager import Manager
from OpenRTM_aist._naming_manager import NamingManager
from OpenRTM_aist._ports import (
    PortBase,
    PortConnectListener,
    PortConnectListenerType,
    PortConnectRetListener,
    PortConnectRetListenerType,
)
from OpenRTM_aist._properties import Properties
from OpenRTM_aist._service_ports import CorbaConsumer, CorbaConsumerBase, CorbaPort
from OpenRTM_aist._strings import (
    Time,
    TimeValue,
    eraseBlank,
    eraseBothEndsBlank,
    eraseHeadBlank,
    eraseTailBlank,
    escape,
    flatten,
    includes,
    isAbsolutePath,
    isURL,
    normalize,
    otos,
    replaceString,
    setTimestamp,
    split,
    stringTo,
    toArgv,
    toBool,
    toString,
    unescape,
    unique_sv,
)
from OpenRTM_aist._tools import help_old_tools as _help_old_tools
from OpenRTM_aist.Async import Async_ref_t, Async_ref_tInvoker, Async_t, Async_tInvoker
from OpenRTM_aist.Guard import ScopedLock
from OpenRTM_aist.StaticFSM import EventInPort
from OpenRTM_aist.Task import Task

from OpenRTM_aist import CORBA_RTCUtil, EventPort, RTObject  # isort: skip (they stand on what is above)

__all__ = [
    "Async_ref_t",
    "Async_ref_tInvoker",
    "Async_t",
    "Async_tInvoker",
    "CORBA_RTCUtil",
    "CORBA_SeqUtil",
    "ConfigAdmin",
    "ConfigurationParamListener",
    "ConfigurationParamListenerType",
    "ConfigurationSetListener",
    "ConfigurationSetListenerType",
    "ConfigurationSetNameListener",
    "ConfigurationSetNameListenerType",
    "ConnectorDataListener",
    "ConnectorDataListenerT",
    "ConnectorDataListenerType",
    "ConnectorInfo",
    "ConnectorListener",
    "ConnectorListenerStatus",
    "ConnectorListenerType",
    "CorbaConsumer",
    "CorbaConsumerBase",
    "CorbaNaming",
    "CorbaPort",
    "DataFlowComponentBase",
    "DataPortStatus",
    "Delete",
    "EventInPort",
    "EventPort",
    "ExecutionContextActionListener",
    "ExecutionContextActionListenerType",
    "Guard",
    "InPort",
    "InPortBase",
    "Logger",
    "Manager",
    "NVUtil",
    "NamingManager",
    "OnRead",
    "OnReadConvert",
    "OnWrite",
    "OnWriteConvert",
    "OutPort",
    "OutPortBase",
    "PortActionListener",
    "PortActionListenerType",
    "PortBase",
    "PortConnectListener",
    "PortConnectListenerType",
    "PortConnectRetListener",
    "PortConnectRetListenerType",
    "PortType",
    "PostComponentActionListener",
    "PostComponentActionListenerType",
    "PreComponentActionListener",
    "PreComponentActionListenerType",
    "Properties",
    "RTObject",
    "RTObject_impl",
    "RingBuffer",
    "ScopedLock",
    "StaticFSM",
    "StringUtil",
    "Task",
    "Time",
    "TimeValue",
    "eraseBlank",
    "eraseBothEndsBlank",
    "eraseHeadBlank",
    "eraseTailBlank",
    "escape",
    "flatten",
    "includes",
    "instantiateDataType",
    "isAbsolutePath",
    "isURL",
    "normalize",
    "otos",
    "replaceString",
    "setTimestamp",
    "split",
    "stringTo",
    "toArgv",
    "toBool",
    "toString",
    "unescape",
    "unique_sv",
    "uuid1",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        """Functions and states that the original has at its top, too; what is there instead of what is not."""
        for module in (CORBA_RTCUtil, StaticFSM):
            if name in module.__all__:
                return getattr(module, name)
        raise AttributeError(_what_instead(name))


_look_for_idl()
_help_old_tools()
