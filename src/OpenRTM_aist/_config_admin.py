"""A component's configuration as the component itself sees it: `self._configsets.getActiveId()`."""
# ruff: noqa: N802 (the names are those that components know)

from __future__ import annotations

from collections.abc import Callable

from muros.rtc.configuration import Configuration, ConfigurationError, ConfigurationSet
from OpenRTM_aist._properties import Properties

__all__ = ["ConfigAdmin", "to_properties"]


class ConfigAdmin:
    """A face of a muros configuration. Sets are `Properties`, whose name is the set's id."""

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration

    def getActiveId(self) -> str:
        """The id of the active set."""
        return self._configuration.active_id

    def haveConfig(self, config_id: str) -> bool:
        return any(one.id == config_id for one in self._configuration.sets())

    def isExist(self, param_name: str) -> bool:
        """Whether a parameter of that name is bound."""
        return any(one.name == param_name for one in self._configuration.parameters)

    def activateConfigurationSet(self, config_id: str) -> bool:
        """Make a set active; the variables have its values after the next `update`. False where there is none."""
        try:
            self._configuration.activate(config_id)
        except ConfigurationError:
            return False
        return True

    def update(self, config_set: str | None = None, config_param: str | None = None) -> None:
        """Give the variables the active set's values; or those of `config_set`, of one parameter or all, at once."""
        if config_set is None:
            self._configuration.update()
            return
        values = self.getConfigurationSet(config_set).as_dict()
        for parameter in self._configuration.parameters:
            if parameter.name in values and config_param in (None, parameter.name):
                text = values[parameter.name]
                parameter.take(text, parameter.converted(text)[0])

    def getConfigurationSets(self) -> list[Properties]:
        return [to_properties(one) for one in self._configuration.sets()]

    def getConfigurationSet(self, config_id: str) -> Properties:
        """A set; an empty one where there is none."""
        try:
            return to_properties(self._configuration.get(config_id))
        except ConfigurationError:
            return Properties()

    def getActiveConfigurationSet(self) -> Properties:
        return self.getConfigurationSet(self.getActiveId())

    def setConfigurationSetValues(self, config_set: Properties) -> bool:
        """Change a set's values; they count when it is made active. False where there is none."""
        return self._try(self._configuration.set_values, config_set)

    def addConfigurationSet(self, config_set: Properties) -> bool:
        """Add a set. False where there is one of its name."""
        return self._try(self._configuration.add, config_set)

    def removeConfigurationSet(self, config_id: str) -> bool:
        """Take an added set away. False where it is active, or none."""
        try:
            return self._configuration.remove(config_id)
        except ConfigurationError:
            return False

    def _try(self, change: Callable[[ConfigurationSet], bool], config_set: Properties) -> bool:
        values = {name: text for name, text in config_set.as_dict().items() if name}
        try:
            return change(ConfigurationSet(config_set.getName(), "", values))
        except ConfigurationError:
            return False


def to_properties(one: ConfigurationSet) -> Properties:
    """A set, under its id as its name."""
    made = Properties(key=one.id)
    made._texts.clear()
    for name, text in one.values.items():
        made.setProperty(name, text)
    return made
