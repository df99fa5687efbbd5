"""RT components, compatible with OpenRTM-aist: written in Python, run after one ``pip install 'muros[rtc]'``.

The folders are the architecture. What is in this folder is the model: components, their state machine, ports,
configuration sets, as plain Python objects that know nothing of CORBA. Around it stand

- ``contexts``: execution contexts, which call components; their pass over the components takes no clock,
- ``data``: buffers, publishers, data ports and what carries their octets,
- ``services``: service ports,
- ``corba``: the model as the RTC world sees it: stubs, servants, references, the name service,
- ``manager``: what makes components, names them and ends them, after ``rtc.conf``.

docs/how-rtc-works.md draws the way of a value through them.
"""

from muros.rtc.actions import Action, ComponentEvent
from muros.rtc.codes import (
    BufferStatus,
    DataPortStatus,
    ExecutionKind,
    LifeCycleState,
    PeerLostError,
    PortStatus,
    ReturnCode,
    RtcError,
)
from muros.rtc.component import Component
from muros.rtc.configuration import ConfigEvent, Configuration, ConfigurationSet
from muros.rtc.data import ConnectorEvent, DataError, DataEvent, DataInPort, DataOutPort
from muros.rtc.declarations import InPort, OutPort, Parameter
from muros.rtc.running import run
from muros.rtc.services import Consumer, NotConnectedError, Provided, Required, ServicePort

__all__ = [
    "Action",
    "BufferStatus",
    "Component",
    "ComponentEvent",
    "ConfigEvent",
    "Configuration",
    "ConfigurationSet",
    "ConnectorEvent",
    "Consumer",
    "DataError",
    "DataEvent",
    "DataInPort",
    "DataOutPort",
    "DataPortStatus",
    "ExecutionKind",
    "InPort",
    "LifeCycleState",
    "NotConnectedError",
    "OutPort",
    "Parameter",
    "PeerLostError",
    "PortStatus",
    "Provided",
    "Required",
    "ReturnCode",
    "RtcError",
    "ServicePort",
    "run",
]
