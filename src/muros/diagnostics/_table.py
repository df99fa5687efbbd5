"""The words for the numbers in diagnostics of boards, from a YAML file in the format of micro-ROS:

    hardware_ids:
      ros__parameters:
        7: left arm
    updaters:
      ros__parameters:
        1:
          name: battery
          description: the accumulator of the arm
          keys:
            0: {name: voltage}
            1: {name: mode, values: {0: charging, 1: in use}}

Numbers may be written as text, as ROS 2's own parameter files do. Both halves may be missing; what a table has no words
for is `NOT_FOUND`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Final

__all__ = ["NOT_FOUND", "Key", "Table", "TableError", "Updater", "read_table", "read_table_untrusted"]

NOT_FOUND: Final = "NOTFOUND"
"""What stands for a number that the table does not have; that of the bridge of micro-ROS."""

_PARAMETERS: Final = "ros__parameters"
_LARGEST: Final = 0xFFFF
_LONG: Final = 1 << 64


class TableError(ValueError):
    """A file is no table of words; the text is one line that says where and what."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key of an updater."""

    name: str = NOT_FOUND
    values: Mapping[int, str] = field(default_factory=dict)
    """The words for values that are looked up."""


@dataclass(frozen=True, slots=True)
class Updater:
    """What publishes a status: a task of a board."""

    name: str = NOT_FOUND
    description: str = NOT_FOUND
    keys: Mapping[int, Key] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Table:
    """The words for the numbers of some boards."""

    hardware: Mapping[int, str] = field(default_factory=dict)
    updaters: Mapping[int, Updater] = field(default_factory=dict)

    def hardware_id(self, number: int) -> str:
        """What a board calls itself."""
        return self.hardware.get(number, NOT_FOUND)

    def updater(self, number: int) -> Updater:
        """The task of that number."""
        return self.updaters.get(number, Updater())

    def key(self, updater: int, number: int) -> str:
        """The name of a key."""
        return self.updater(updater).keys.get(number, Key()).name

    def value(self, updater: int, key: int, number: int) -> str:
        """The words for a value of a key."""
        return self.updater(updater).keys.get(key, Key()).values.get(number, NOT_FOUND)


def read_table(file: str | os.PathLike[str]) -> Table:
    """The table in a file. TableError for what is none, OSError if it cannot be read."""
    path = Path(file)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise TableError(f"{path} is no text in UTF-8") from None
    return read_table_untrusted(text, str(path))


def read_table_untrusted(text: str, file: str = "the table") -> Table:
    """The table in a text. TableError for what is none; `file` is what it calls the text."""
    yaml = import_module("yaml")
    try:
        found = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise TableError(f"{file} is no YAML: {' '.join(str(error).split())}") from None
    except (ValueError, RecursionError) as error:  # a date that is none; brackets without end
        raise TableError(f"{file} is no YAML that can be read: {type(error).__name__}") from None
    top = _mapping(found, f"{file}")
    if not {"hardware_ids", "updaters"} & set(top):
        raise TableError(f"{file} has neither hardware_ids nor updaters")
    hardware = _half(top, "hardware_ids", file)
    updaters = _half(top, "updaters", file)
    return Table(
        {number: _words(value, f"{file}: hardware_ids.{number}") for number, value in hardware.items()},
        {number: _updater(value, f"{file}: updaters.{number}") for number, value in updaters.items()},
    )


def _updater(found: Any, where: str) -> Updater:
    entry = _mapping(found, where)
    keys = _numbered(entry.get("keys"), f"{where}.keys")
    return Updater(
        _words(entry.get("name", NOT_FOUND), f"{where}.name"),
        _words(entry.get("description", NOT_FOUND), f"{where}.description"),
        {number: _key(value, f"{where}.keys.{number}") for number, value in keys.items()},
    )


def _key(found: Any, where: str) -> Key:
    entry = _mapping(found, where)
    values = _numbered(entry.get("values"), f"{where}.values")
    return Key(
        _words(entry.get("name", NOT_FOUND), f"{where}.name"),
        {number: _words(value, f"{where}.values.{number}") for number, value in values.items()},
    )


def _half(top: Mapping[Any, Any], name: str, file: str) -> dict[int, Any]:
    """The entries of one half of the table, by their numbers."""
    if name not in top:
        return {}
    entries = _mapping(top[name], f"{file}: {name}")
    if _PARAMETERS not in entries:
        raise TableError(f"{file}: {name} has no {_PARAMETERS}")
    return _numbered(entries[_PARAMETERS], f"{file}: {name}.{_PARAMETERS}")


def _numbered(found: Any, where: str) -> dict[int, Any]:
    """A mapping whose keys are numbers, or text that is one; nothing for None."""
    numbered: dict[int, Any] = {}
    for key, value in ({} if found is None else _mapping(found, where)).items():
        number = (
            int(key) if isinstance(key, str) and key.isascii() and key.isdecimal() and len(key) <= 5 else key
        )
        if type(number) is not int or not 0 <= number <= _LARGEST:
            raise TableError(f"{where}: {_shown(key)} is no number from 0 to {_LARGEST}")
        numbered[number] = value
    return numbered


def _mapping(found: Any, where: str) -> Mapping[Any, Any]:
    if not isinstance(found, dict):
        raise TableError(f"{where}: names with values are due here, not {_shown(found)}")
    return found


def _words(found: Any, where: str) -> str:
    if not isinstance(found, str | int | float) or (isinstance(found, int) and abs(found) >= _LONG):
        raise TableError(f"{where}: words are due here, not {_shown(found)}")
    return str(found)


def _shown(found: Any) -> str:
    """What stands in a file, shortly: it may be made to be long."""
    if found is None:
        return "nothing"
    if not isinstance(found, str | int | float):
        return f"a {type(found).__name__}"
    if isinstance(found, int) and abs(found) >= _LONG:
        return "a number that is too long"
    text = repr(found)
    return text if len(text) <= 40 else text[:37] + "..."
