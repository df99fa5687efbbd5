"""What a new instance of a component begins with: its name and its properties.

Properties come from, the later over the earlier: the defaults; the component's specification; what it inherits of the
manager's settings; what the file named by `<category>.<type>.config_file` and then `<category>.<type>.*` of rtc.conf
say; the same for `<category>.<instance>`; the file that the request names; the request.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from itertools import count
from pathlib import Path
from types import MappingProxyType
from typing import Final

from muros.rtc.codes import RtcError
from muros.rtc.formats import Fields, expand
from muros.rtc.manager._defaults import DEFAULTS
from muros.rtc.properties import Properties, read_conf_file, split_list

__all__ = ["POLICIES", "binding_names", "fields_of", "instance_properties", "numbered_names"]

POLICIES: Final = ("process_unique", "node_unique", "ns_unique")
"""Values of `manager.components.naming_policy`: how far a number is looked for that nobody has."""

NAMES_TRIED: Final = 10_000
"""Numbers that are tried before giving up."""

INHERITED: Final = (
    "config.version", "openrtm.", "os.", "corba.id", "corba.endpoints", "exec_cxt.", "ec.", "logger.enable",
    "logger.log_level", "naming.enable", "naming.type", "naming.formats", "sdo.", "port.", "manager.instance_name",
)  # fmt: skip
"""Keys of the manager, or beginnings of such, that its components have as well."""


def instance_properties(
    spec: Mapping[str, str],
    instance_name: str,
    settings: Properties,
    asked: Mapping[str, str],
    *,
    find_file: Callable[[str], Path],
) -> dict[str, str]:
    """All properties of a new instance. ConfError where a file cannot be read.

    `asked`: those of the request. `find_file` makes a path of a file's name in rtc.conf.
    """
    category, type_name = spec.get("category", ""), spec.get("type_name", "")
    properties = {**_inherited(DEFAULTS), **spec, **_inherited(settings)}
    files = []
    for name in (type_name, instance_name):
        own = settings.node(f"{category}.{name}" if category else name)
        file = own.get("config_file", "").strip()
        if file:
            properties.update(read_conf_file(find_file(file)))
            files.append(file)
        properties.update({key: text for key, text in own.items() if key and key != "config_file"})
    file = asked.get("config_file", "").strip()
    if file:
        properties.update(read_conf_file(find_file(file)))
        files.append(file)
    properties.update(asked)
    properties["instance_name"] = instance_name
    if files:
        properties["config_file"] = ",".join(files)
    return properties


def _inherited(settings: Mapping[str, str]) -> dict[str, str]:
    return {key: text for key, text in settings.items() if key.startswith(INHERITED)}


def numbered_names(type_name: str) -> Iterator[str]:
    """`Foo0`, `Foo1`, ...: as many as are tried. Then RtcError."""
    for number in count():
        if number == NAMES_TRIED:
            raise RtcError(
                f"{type_name}0 to {type_name}{number - 1} are all taken; name the instance yourself"
            )
        yield f"{type_name}{number}"


def binding_names(name: str, properties: Mapping[str, str], settings: Mapping[str, str]) -> tuple[str, ...]:
    """The names in the naming service that an instance gets, after `naming.formats`."""
    forms = properties.get("naming.formats") or settings["naming.formats"]
    quoted = {key: text.replace("\\", "\\\\").replace("/", "\\/") for key, text in properties.items()}
    fields = fields_of(settings, name.replace("\\", "\\\\").replace("/", "\\/"), quoted)
    return tuple(dict.fromkeys(expand(form, fields, os.environ) for form in split_list(forms)))


def fields_of(
    settings: Mapping[str, str], name: str = "", properties: Mapping[str, str] = MappingProxyType({})
) -> Fields:
    """What the letters of formats stand for: of an instance, or without one of the manager."""
    return Fields(
        name or settings["manager.instance_name"],
        properties.get("type_name", "manager"),
        properties.get("version", ""),
        properties.get("vendor", ""),
        properties.get("category", ""),
        settings.get("os.hostname", ""),
        settings["manager.name"],
        str(os.getpid()),
    )
