"""Plain values between the model and CORBA: lists of named values, codes, profiles without references."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from omniORB import CORBA
from omniORB import any as any_values

from muros.rtc.codes import ReturnCode
from muros.rtc.configuration import ConfigurationSet
from muros.rtc.corba._stubs import RTC, SDOPackage
from muros.rtc.profiles import InterfaceProfile, PropertyValue

__all__ = [
    "from_configuration_set", "from_nv_list", "from_return_code", "texts_of", "to_configuration_set", "to_interface",
    "to_nv_list", "to_return_code",
]  # fmt: skip

_CODES: Final = tuple(RTC.ReturnCode_t._items)
_YES_NO: Final = {True: "YES", False: "NO"}


def to_return_code(code: ReturnCode) -> Any:
    """As RTC::ReturnCode_t."""
    return _CODES[code]


def from_return_code(code: Any) -> ReturnCode:
    """Of an RTC::ReturnCode_t."""
    return ReturnCode(code._v)


def to_nv_list(properties: Mapping[str, PropertyValue]) -> list[Any]:
    """As an NVList: texts as strings, references to objects as what they are."""
    return [
        SDOPackage.NameValue(
            key, CORBA.Any(CORBA.TC_string, value) if isinstance(value, str) else any_values.to_any(value)
        )
        for key, value in properties.items()
    ]


def from_nv_list(values: Iterable[Any]) -> dict[str, PropertyValue]:
    """Of an NVList: texts and references stay what they are, truth values are YES and NO, all else is its text.

    The last of several values of one name counts.
    """
    return {one.name: _property(one.value) for one in values}


def texts_of(values: Iterable[Any]) -> dict[str, str]:
    """The same without references to objects."""
    return {key: value for key, value in from_nv_list(values).items() if isinstance(value, str)}


def _property(value: Any) -> PropertyValue:
    kind = value.typecode().kind()
    inner = value.value()
    if kind == CORBA.tk_string or kind == CORBA.tk_objref:
        return "" if inner is None else inner
    if kind == CORBA.tk_boolean:
        return _YES_NO[bool(inner)]
    return "" if inner is None else str(any_values.from_any(value))


def to_interface(interface: InterfaceProfile) -> Any:
    """As RTC::PortInterfaceProfile."""
    polarity = RTC.PortInterfacePolarity._items[interface.polarity]
    return RTC.PortInterfaceProfile(interface.instance_name, interface.type_name, polarity)


def to_configuration_set(one: ConfigurationSet) -> Any:
    """As SDOPackage::ConfigurationSet."""
    return SDOPackage.ConfigurationSet(one.id, one.description, to_nv_list(one.values))


def from_configuration_set(one: Any) -> ConfigurationSet:
    """Of an SDOPackage::ConfigurationSet."""
    return ConfigurationSet(one.id, one.description, texts_of(one.configuration_data))
