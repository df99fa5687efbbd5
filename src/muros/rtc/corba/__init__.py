"""RT components as the RTC world sees them: the ORB, stubs, servants, references, the name service.

Importing this takes no time: each name below brings what it needs (the ORB among it) when it is first used.
``from muros.rtc.corba import install`` alone makes ``import RTC`` possible.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

from muros.rtc.corba._importer import add_idl_folder, install, remove_idl_folder

if TYPE_CHECKING:
    from muros.rtc.corba._codec import IdlDataType, data_type_of
    from muros.rtc.corba._name_server import RunningNameServer, start_name_server
    from muros.rtc.corba._naming import Binding, Names, NameServer, server_address, split_path
    from muros.rtc.corba._objects import Objects
    from muros.rtc.corba._orb import Orb, current_orb, endpoint_arguments, start_orb
    from muros.rtc.corba._setup import set_up
    from muros.rtc.corba.idl import IdlError, load_idl

__all__ = [
    "Binding",
    "IdlDataType",
    "IdlError",
    "NameServer",
    "Names",
    "Objects",
    "Orb",
    "RunningNameServer",
    "add_idl_folder",
    "current_orb",
    "data_type_of",
    "endpoint_arguments",
    "install",
    "load_idl",
    "remove_idl_folder",
    "server_address",
    "set_up",
    "split_path",
    "start_name_server",
    "start_orb",
]

_PLACES: Final = {
    "_codec": ("IdlDataType", "data_type_of"),
    "_name_server": ("RunningNameServer", "start_name_server"),
    "_naming": ("Binding", "NameServer", "Names", "server_address", "split_path"),
    "_objects": ("Objects",),
    "_setup": ("set_up",),
    "_orb": ("Orb", "current_orb", "endpoint_arguments", "start_orb"),
    "idl": ("IdlError", "load_idl"),
}
_HOME: Final = {name: place for place, names in _PLACES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value
