"""Managers over CORBA: RTM::Manager as a servant, and managers of other processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from omniORB import CORBA
from omniORB import any as any_values

from muros.rtc.codes import ReturnCode, RtcError
from muros.rtc.corba._conversion import from_return_code, to_nv_list, to_return_code
from muros.rtc.corba._lost import peer
from muros.rtc.corba._naming import is_same
from muros.rtc.corba._orb import current_orb
from muros.rtc.corba._stubs import RTC, RTM, RTM__POA

if TYPE_CHECKING:
    from muros.rtc.component import Component
    from muros.rtc.manager import Manager

__all__ = ["ManagerServant", "PeerManager"]

SETTINGS: Final = 10_000
"""Settings that a manager may have before others can add no more."""

SETTING_LENGTH: Final = 65536
"""Characters that others may set at once."""


class ManagerServant(RTM__POA.Manager):  # type: ignore[misc]
    """RTM::Manager. No operation raises: what cannot be done is a return code, nil or an empty list, and a finding."""

    def __init__(self, manager: Manager) -> None:
        self._manager = manager

    # Modules

    def load_module(self, pathname: str, initfunc: str) -> Any:
        return self._code(f"load_module({pathname})", lambda: self._manager.load_module(pathname, initfunc))

    def unload_module(self, pathname: str) -> Any:
        return self._code(f"unload_module({pathname})", lambda: self._manager.unload_module(pathname))

    def get_loadable_modules(self) -> list[Any]:
        own = [_module(spec) for spec in self._manager.modules.loadable()]
        return own + self._manager.colleagues.gather("get_loadable_modules")

    def get_loaded_modules(self) -> list[Any]:
        own = [_module(module.properties()) for module in self._manager.modules.loaded]
        return own + self._manager.colleagues.gather("get_loaded_modules")

    def get_factory_profiles(self) -> list[Any]:
        own = [_module(factory.properties) for factory in self._manager.factories.all]
        return own + self._manager.colleagues.gather("get_factory_profiles")

    # Components

    def create_component(self, module_name: str) -> Any:
        made: list[Any] = []
        self._code(f"create_component({module_name})", lambda: made.append(self._manager.create(module_name)))
        if not made:
            return None
        reference = made[0]
        from muros.rtc.component import Component

        if not isinstance(reference, Component):
            return reference
        return next(iter(self._references([reference])), None)

    def delete_component(self, instance_name: str) -> Any:
        return to_return_code(self._manager.delete_component(instance_name))

    def get_components(self) -> list[Any]:
        own = self._references(self._manager.components)
        return own + self._manager.colleagues.gather("get_components")

    def get_component_profiles(self) -> list[Any]:
        own: list[Any] = []
        for component in self._references(self._manager.components):
            with suppress(CORBA.OBJECT_NOT_EXIST):
                own.append(component.get_component_profile())
        return own + self._manager.colleagues.gather("get_component_profiles")

    def get_components_by_name(self, name: str) -> list[Any]:
        own = self._references(self._manager.components_by_name(name))
        return own + self._manager.colleagues.components_by_name(name)

    # The manager itself

    def get_profile(self) -> Any:
        settings = self._manager.configuration()
        own = {key.removeprefix("manager."): v for key, v in settings.items() if key.startswith("manager.")}
        return RTM.ManagerProfile(to_nv_list(own))

    def get_configuration(self) -> list[Any]:
        return to_nv_list(self._manager.configuration())

    def set_configuration(self, name: str, value: str) -> Any:
        settings = self._manager.settings
        if len(name) + len(value) > SETTING_LENGTH or (name not in settings and len(settings) >= SETTINGS):
            return RTC.OUT_OF_RESOURCES
        settings[name] = value
        return RTC.RTC_OK

    def is_master(self) -> bool:
        return self._manager.is_master

    def get_master_managers(self) -> list[Any]:
        return [master.reference for master in self._manager.colleagues.masters]

    def add_master_manager(self, mgr: Any) -> Any:
        return self._about(mgr, self._manager.colleagues.add_master)

    def remove_master_manager(self, mgr: Any) -> Any:
        return self._about(mgr, self._manager.colleagues.remove_master)

    def get_slave_managers(self) -> list[Any]:
        return [slave.reference for slave in self._manager.colleagues.slaves]

    def add_slave_manager(self, mgr: Any) -> Any:
        return self._about(mgr, self._manager.colleagues.add_slave)

    def remove_slave_manager(self, mgr: Any) -> Any:
        return self._about(mgr, self._manager.colleagues.remove_slave)

    def fork(self) -> Any:
        """A process with threads cannot be doubled; whoever wants a second manager starts one."""
        return RTC.UNSUPPORTED

    def shutdown(self) -> Any:
        self._manager.shutdown()
        return RTC.RTC_OK

    def restart(self) -> Any:
        return RTC.UNSUPPORTED

    def get_service(self, name: str) -> Any:
        return None

    def _references(self, components: Iterable[Component]) -> list[Any]:
        """Those to components, but for what ends at this moment."""
        found: list[Any] = []
        for component in components:
            with suppress(KeyError):
                found.append(self._manager.reference_of(component))
        return found

    def _about(self, reference: Any, act: Callable[[PeerManager], ReturnCode]) -> Any:
        return to_return_code(ReturnCode.BAD_PARAMETER if reference is None else act(PeerManager(reference)))

    def _code(self, what: str, act: Callable[[], object]) -> Any:
        """Do what was asked for; what it could not is a finding, and RTC_ERROR."""
        try:
            act()
        except RtcError as error:
            self._manager.reporter.report(
                "manager-could-not",
                who=self._manager.name,
                what=f"{what} failed",
                why=str(error),
                subject=what,
            )
        except Exception as error:
            self._manager.reporter.failed("manager-could-not", self._manager.name, f"{what} failed", error)
        else:
            return RTC.RTC_OK
        return RTC.RTC_ERROR


class PeerManager:
    """A manager of another process: `muros.rtc.manager`'s `RemoteManager`."""

    def __init__(self, reference: Any) -> None:
        self._reference = reference

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PeerManager) and is_same(self._reference, other._reference)

    def __hash__(self) -> int:
        return current_orb().hash_of(self._reference)

    @property
    def reference(self) -> Any:
        return self._reference

    def name(self) -> str:
        return self._property("instance_name")

    def language(self) -> str:
        return self._property("language")

    def instance_names(self) -> set[str]:
        with peer("the manager"):
            return {profile.instance_name for profile in self._reference.get_component_profiles()}

    def create_component(self, request: str) -> Any | None:
        with peer("the manager"):
            return self._reference.create_component(request)

    def delete_component(self, name: str) -> ReturnCode:
        return self._code("delete_component", name)

    def listed(self, what: str) -> Sequence[Any]:
        with peer("the manager"):
            found: Sequence[Any] = getattr(self._reference, what)()
            return found

    def components_by_name(self, name: str) -> Sequence[Any]:
        with peer("the manager"):
            found: Sequence[Any] = self._reference.get_components_by_name(name)
            return found

    def add_slave(self, slave: Any) -> ReturnCode:
        return self._code("add_slave_manager", slave)

    def remove_slave(self, slave: Any) -> ReturnCode:
        return self._code("remove_slave_manager", slave)

    def add_master(self, master: Any) -> ReturnCode:
        return self._code("add_master_manager", master)

    def remove_master(self, master: Any) -> ReturnCode:
        return self._code("remove_master_manager", master)

    def knows_slave(self, slave: Any) -> bool:
        return _any_same(self.listed("get_slave_managers"), slave)

    def shutdown(self) -> ReturnCode:
        return self._code("shutdown")

    def _code(self, operation: str, *arguments: object) -> ReturnCode:
        with peer("the manager"):
            return from_return_code(getattr(self._reference, operation)(*arguments))

    def _property(self, name: str) -> str:
        with peer("the manager"):
            values = self._reference.get_profile().properties
        return next((str(any_values.from_any(one.value)) for one in values if one.name == name), "")


def _any_same(references: Iterable[Any], one: Any) -> bool:
    return any(is_same(other, one) for other in references)


def _module(properties: Mapping[str, str]) -> Any:
    return RTM.ModuleProfile(to_nv_list(properties))
