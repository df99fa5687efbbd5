"""An RTC profile as values, with the namespaces of its XML form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

__all__ = [
    "ACTIONS",
    "EXT",
    "RTC",
    "XSI",
    "DataPortProfile",
    "ParameterProfile",
    "RtcProfile",
    "ServiceInterfaceProfile",
    "ServicePortProfile",
]

RTC: Final = "http://www.openrtp.org/namespaces/rtc"
EXT: Final = "http://www.openrtp.org/namespaces/rtc_ext"
XSI: Final = "http://www.w3.org/2001/XMLSchema-instance"

ACTIONS: Final = (
    "OnInitialize", "OnFinalize", "OnStartup", "OnShutdown", "OnActivated", "OnDeactivated", "OnAborting", "OnError",
    "OnReset", "OnExecute", "OnStateUpdate", "OnRateChanged", "OnAction", "OnModeChanged",
)  # fmt: skip
"""The actions that a profile tells of, in its order."""


@dataclass(frozen=True, slots=True)
class ParameterProfile:
    """A configuration parameter."""

    name: str
    type: str
    """As IDL and editors name it: `int`, `double`, `string`, `vector<double>`, ..."""
    default: str = ""
    unit: str = ""
    constraint: str = ""
    """As in `conf.__constraints__`: `0<=x<=10`, `(fast,slow)`; "" where there is none that a text can say."""
    widget: str = ""
    """As in `conf.__widget__`: `slider.10`, `radio`, ..."""


@dataclass(frozen=True, slots=True)
class DataPortProfile:
    """A data port."""

    name: str
    direction: str
    """`DataInPort`, `DataOutPort` or `EventPort`."""
    type: str
    """Such as `RTC::TimedLong`."""
    idl_file: str = ""
    interface_type: str = ""
    dataflow_type: str = ""
    subscription_type: str = ""
    unit: str = ""


@dataclass(frozen=True, slots=True)
class ServiceInterfaceProfile:
    """An interface of a service port."""

    name: str
    instance_name: str
    type: str
    """Such as `SimpleService::MyService`."""
    provided: bool
    idl_file: str = ""


@dataclass(frozen=True, slots=True)
class ServicePortProfile:
    """A service port."""

    name: str
    interfaces: tuple[ServiceInterfaceProfile, ...] = ()


@dataclass(frozen=True, slots=True)
class RtcProfile:
    """A component, as an editor knows it."""

    name: str
    version: str = "1.0.0"
    vendor: str = ""
    category: str = ""
    description: str = ""
    component_type: str = "STATIC"
    """`STATIC`, `UNIQUE` or `COMMUTATIVE`."""
    activity_type: str = "PERIODIC"
    """`PERIODIC`, `SPORADIC` or `EVENTDRIVEN`."""
    component_kind: str = "DataFlowComponent"
    rtc_type: str = ""
    execution_type: str = "PeriodicExecutionContext"
    execution_rate: float | None = 1000.0
    max_instances: int = 1
    abstract: str = ""
    creation_date: str = ""
    update_date: str = ""
    language: str = "Python"
    actions: Mapping[str, bool] = field(default_factory=dict)
    """Which of `ACTIONS` are implemented; those that are not named are not said."""
    parameters: tuple[ParameterProfile, ...] = ()
    data_ports: tuple[DataPortProfile, ...] = ()
    service_ports: tuple[ServicePortProfile, ...] = ()

    @property
    def id(self) -> str:
        """`RTC:vendor:category:name:version`"""
        return f"RTC:{self.vendor}:{self.category}:{self.name}:{self.version}"
