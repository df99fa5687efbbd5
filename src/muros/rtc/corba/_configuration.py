"""Configuration sets over CORBA (SDO Configuration 1.1, 2.5): what tools and editors list, change and activate."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

from omniORB import CORBA

from muros.rtc.configuration import (
    ConfigurationError,
    ConfigurationSet,
    EmptyIdError,
    NotAvailableError,
)
from muros.rtc.corba._conversion import from_configuration_set, to_configuration_set
from muros.rtc.corba._stubs import SDOPackage, SDOPackage__POA
from muros.rtc.organization import organizations_of

if TYPE_CHECKING:
    from muros.rtc.component import Component
    from muros.rtc.corba._objects import Objects
    from muros.rtc.corba._observer import Observers

__all__ = ["ConfigurationServant", "no_device"]

ORGANIZATIONS: Final = 1000
"""Organizations that a component may be in before others can add it to no more."""


def no_device() -> Any:
    """The profile of a device that nobody has told of."""
    return SDOPackage.DeviceProfile("", "", "", "", [])


class ConfigurationServant(SDOPackage__POA.Configuration):  # type: ignore[misc]
    """SDOPackage::Configuration of a component."""

    def __init__(self, component: Component, observers: Observers, objects: Objects) -> None:
        self._component = component
        self._observers = observers
        self._objects = objects
        self.device: Any = no_device()

    # Configuration sets

    def get_configuration_sets(self) -> list[Any]:
        return [to_configuration_set(one) for one in self._component.configuration.sets()]

    def get_configuration_set(self, config_id: str) -> Any:
        try:
            return to_configuration_set(self._component.configuration.get(config_id))
        except ConfigurationError as error:  # this operation has no InvalidParameter
            raise SDOPackage.InternalError(str(error)) from error

    def set_configuration_set_values(self, configuration_set: Any) -> bool:
        with _sdo_errors():
            return self._component.configuration.set_values(from_configuration_set(configuration_set))

    def get_active_configuration_set(self) -> Any:
        with _sdo_errors():
            return to_configuration_set(self._component.configuration.active())

    def add_configuration_set(self, configuration_set: Any) -> bool:
        with _sdo_errors():
            return self._component.configuration.add(from_configuration_set(configuration_set))

    def remove_configuration_set(self, config_id: str) -> bool:
        with _sdo_errors():
            return self._component.configuration.remove(config_id)

    def activate_configuration_set(self, config_id: str) -> bool:
        with _sdo_errors():
            self._component.configuration.activate(config_id)
            return True

    # Single parameters

    def get_configuration_parameters(self) -> list[Any]:
        return []

    def get_configuration_parameter_values(self) -> list[Any]:
        return []

    def get_configuration_parameter_value(self, name: str) -> Any:
        values = self._active_values()
        if name not in values:
            raise SDOPackage.InvalidParameter(f"there is no parameter '{name}'")
        return CORBA.Any(CORBA.TC_string, values[name])

    def set_configuration_parameter(self, name: str, value: Any) -> bool:
        if name not in self._active_values():
            raise SDOPackage.InvalidParameter(f"there is no parameter '{name}'")
        configuration = self._component.configuration
        with _sdo_errors():
            configuration.set_values(
                ConfigurationSet(configuration.active_id, "", {name: str(value.value())})
            )
            configuration.activate(configuration.active_id)
        return True

    def _active_values(self) -> dict[str, str]:
        configuration = self._component.configuration
        with _sdo_errors():
            return configuration.get(configuration.active_id).values

    # What else an SDO has

    def set_device_profile(self, dProfile: Any) -> bool:  # noqa: N803 (the specification's name)
        self.device = dProfile
        return True

    def add_service_profile(self, sProfile: Any) -> bool:  # noqa: N803
        return self._observers.add(sProfile)

    def remove_service_profile(self, id_: str) -> bool:
        return self._observers.remove(id_)

    def add_organization(self, org: Any) -> bool:
        if org is None:
            raise SDOPackage.InvalidParameter("the organization is nil")
        try:
            id_ = org.get_organization_id()
        except CORBA.Exception as error:
            raise SDOPackage.InvalidParameter("the organization does not answer") from error
        organizations = organizations_of(self._component)
        if len(organizations.joined) >= ORGANIZATIONS:
            raise SDOPackage.NotAvailable(f"a component is in {ORGANIZATIONS} organizations at most")
        organizations.join(id_, self._objects.organization_behind(org))
        return True

    def remove_organization(self, organization_id: str) -> bool:
        return organizations_of(self._component).leave(organization_id)


@contextmanager
def _sdo_errors() -> Iterator[None]:
    """The configuration's errors as those of SDOs."""
    try:
        yield
    except EmptyIdError as error:
        raise SDOPackage.InvalidParameter(str(error)) from error
    except NotAvailableError as error:
        raise SDOPackage.NotAvailable(str(error)) from error
    except ConfigurationError as error:
        raise SDOPackage.InternalError(str(error)) from error
