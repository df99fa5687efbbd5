"""The stubs: one set for the whole process, those of rtctree-aist with what they lack.

Programs of the RTC world say ``import RTC`` and mean the stubs' modules by names of their own (`RTC`, `OpenRTM`,
`SDOPackage`, `RTM`, each with its `__POA`); ``_importer.py`` gives them these. One set is needed because values that
come over the wire become instances of the classes that were registered last.

`idl/supplement.idl` says what rtctree-aist lacks; `_supplement_idl.py` is made of it by

    omniidl -bpython -Wbpackage=rtctree.rtc -I<rtctree>/data/idl supplement.idl

with a head that keeps linters away. A test compares the two.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import omniORB
import rtctree
from rtctree.rtc import RTC, RTC__POA, RTM, RTM__POA, OpenRTM, OpenRTM__POA, SDOPackage, SDOPackage__POA

from muros.rtc.corba import _supplement_idl  # noqa: F401 (completes the modules above)

__all__ = [
    "CSP",
    "CSP__POA",
    "IDL_FOLDER",
    "MODULES",
    "RTC",
    "RTC__POA",
    "RTM",
    "RTM__POA",
    "STUB_FILES",
    "OpenRTM",
    "OpenRTM__POA",
    "SDOPackage",
    "SDOPackage__POA",
]

_PACKAGE: Final = "rtctree.rtc."


def _new_module(name: str) -> ModuleType:
    """The module of an IDL module that only the supplement has."""
    module: ModuleType = omniORB.openModule(_PACKAGE + name)
    omniORB._partialModules.pop(_PACKAGE + name, None)
    sys.modules[_PACKAGE + name] = module
    return module


def _complete_manager() -> None:
    """RTM::Manager has an operation today that the stubs do not know."""
    string = (omniORB.tcInternal.tv_string, 0)
    components = omniORB.typeMapping["IDL:omg.org/RTC/RTCList:1.0"]
    name, descriptor = "get_components_by_name", ((string,), (components,), None)

    def invoke(self: Any, *arguments: object) -> object:
        return self._obj.invoke(name, descriptor, arguments)

    RTM__POA.Manager._omni_op_d.setdefault(name, descriptor)
    if not hasattr(RTM._objref_Manager, name):
        setattr(RTM._objref_Manager, name, invoke)


def _name_as_programs_do(module: ModuleType) -> None:
    """Let values print as programs write them, `RTC.Time(sec=1, nsec=2)`: rtinject makes values of such texts."""
    for value in vars(module).values():
        if isinstance(value, type) and value.__module__ == module.__name__:
            value.__module__ = module.__name__.removeprefix(_PACKAGE)


CSP: Final = _new_module("CSP")
CSP__POA: Final = _new_module("CSP__POA")
_complete_manager()

IDL_FOLDER: Final = Path(rtctree.__file__).parent / "data" / "idl"
"""Where the RTC world's IDL lies, for users' IDL that includes it."""

STUB_FILES: Final = frozenset(path.stem for path in IDL_FOLDER.glob("*.idl"))
"""Names of the IDL files whose stubs are here already, such as `BasicDataType`."""

MODULES: Final[dict[str, ModuleType]] = {
    module.__name__.removeprefix(_PACKAGE): module
    for module in (
        *(RTC, RTC__POA, OpenRTM, OpenRTM__POA, SDOPackage, SDOPackage__POA, RTM, RTM__POA, CSP, CSP__POA),
    )
}
"""The modules by the names that programs know them by."""

for _module in MODULES.values():
    _name_as_programs_do(_module)
