"""`muros rtc new`: what is wished for as an RTC profile, and the files that are written of it."""

from __future__ import annotations

import argparse
import json
import keyword
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Final

from muros.cli._rtc_idl import members_of, with_included
from muros.rtc.codes import RtcError
from muros.rtc.profile_xml import (
    DataPortProfile,
    ParameterProfile,
    RtcProfile,
    ServiceInterfaceProfile,
    ServicePortProfile,
    read_profile_file,
    write_profile,
)

__all__ = ["Wishes", "component_source", "test_source", "wishes_of", "write_component"]

IDENTIFIER: Final = re.compile(r"[A-Za-z_]\w*", re.ASCII)
TYPE: Final = re.compile(r"[A-Za-z_]\w*(::[A-Za-z_]\w*)*", re.ASCII)

NUMBERS: Final = {"int", "short", "long", "float", "double", "bool", "boolean", "octet", "byte"}
"""Types of parameters whose defaults are numbers."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """A component to write: its profile, and the IDL files that it needs."""

    profile: RtcProfile
    idl: tuple[Path, ...] = ()


def wishes_of(arguments: argparse.Namespace) -> Wishes:
    """What a command line asks for. RtcError where it is not clear."""
    if arguments.profile:
        profile = read_profile_file(Path(arguments.profile))
        if arguments.name:
            profile = replace(profile, name=arguments.name)
        folder = Path(arguments.profile).parent
        named = dict.fromkeys(
            [
                *(interface.idl_file for port in profile.service_ports for interface in port.interfaces),
                *(port.idl_file for port in profile.data_ports if not port.type.startswith("RTC::")),
            ]
        )
        files = [folder / name for name in named if name and (folder / name).is_file()]
        return Wishes(_checked(replace(profile, language="Python")), with_included(files))
    if not arguments.name:
        raise RtcError("name the component, or give --profile RTC.xml")
    today = datetime.now().astimezone().isoformat(timespec="seconds")
    services, files = _services(arguments)
    data_idl = [Path(name) for name in arguments.idl]
    profile = RtcProfile(
        arguments.name,
        arguments.version,
        arguments.vendor,
        arguments.category,
        arguments.description,
        execution_rate=arguments.rate,
        max_instances=arguments.max_instances,
        creation_date=today,
        update_date=today,
        actions={
            "OnInitialize": True,
            "OnActivated": True,
            "OnDeactivated": True,
            "OnExecute": True,
        },
        parameters=tuple(map(_parameter, arguments.config)),
        data_ports=(
            *(_data_port(text, "DataInPort", data_idl) for text in arguments.inport),
            *(_data_port(text, "DataOutPort", data_idl) for text in arguments.outport),
        ),
        service_ports=services,
    )
    return Wishes(_checked(profile), with_included([*files, *data_idl]))


def write_component(wishes: Wishes, folder: Path, *, force: bool = False) -> list[Path]:
    """Write the component's files into `folder`; their paths, the component first. RtcError where one is there."""
    profile = wishes.profile
    texts = {
        f"{profile.name}.py": component_source(wishes),
        "RTC.xml": write_profile(profile),
        f"test_{profile.name}.py": test_source(profile),
    }
    for path in wishes.idl:
        try:
            texts[path.name] = path.read_text(encoding="utf-8")
        except (OSError, UnicodeError) as error:
            raise RtcError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    standing = [str(folder / name) for name in texts if (folder / name).exists()]
    if standing and not force:
        raise RtcError(
            f"{', '.join(standing)}: there already; choose another --folder, or --force to write over it"
        )
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


def component_source(wishes: Wishes) -> str:
    """The text of the component's file."""
    profile = wishes.profile
    names = _attribute_names(profile)
    inputs = [port for port in profile.data_ports if port.direction != "DataOutPort"]
    outputs = [port for port in profile.data_ports if port.direction == "DataOutPort"]
    interfaces = [(port, one) for port in profile.service_ports for one in port.interfaces]
    used = sorted(
        {
            "Component",
            *(["InPort"] if inputs else []),
            *(["OutPort"] if outputs else []),
            *(["Parameter"] if profile.parameters else []),
            *("Provided" if one.provided else "Required" for _, one in interfaces),
        }
    )
    lines = [f'"""{_plain(profile.description) or profile.name}."""', ""]
    lines += _imports(profile.data_ports)
    lines += [f"from muros.rtc import {', '.join([*used, 'run'])}", "", ""]
    lines += [
        f"class {profile.name}(Component):",
        f'    """{_plain(profile.description) or profile.name}."""',
        "",
    ]
    lines += [f"    {key} = {_quoted(value)}" for key, value in _attributes(profile)]
    declared = [
        *(_declared_port("InPort", port, names[id(port)]) for port in inputs),
        *(_declared_port("OutPort", port, names[id(port)]) for port in outputs),
        *(_declared_parameter(one, names[id(one)]) for one in profile.parameters),
        *(_declared_interface(port, one, names) for port, one in interfaces),
    ]
    if declared:
        lines += ["", *declared]
    lines += _members((one for _, one in interfaces if one.provided), wishes.idl)
    lines += [
        "",
        "    def on_activated(self, context: int) -> None:",
        '        """Prepare for running."""',
        "",
        "    def on_deactivated(self, context: int) -> None:",
        '        """Put everything back."""',
        "",
        "    def on_execute(self, context: int) -> None:",
        '        """Once in each cycle while the component is active."""',
    ]
    for port in inputs:
        attribute = names[id(port)]
        lines += [
            f"        if self.{attribute}.is_new():",
            f"            value = self.{attribute}.read()",
            "            print(value)",
        ]
    lines += ["", "", 'if __name__ == "__main__":', f"    run({profile.name})", ""]
    return "\n".join(lines)


def test_source(profile: RtcProfile) -> str:
    """The text of the component's test."""
    name = profile.name
    ports = sorted([port.name for port in profile.data_ports] + [port.name for port in profile.service_ports])
    return f'''"""{name}: its profile, and its life."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from muros.rtc.corba import add_idl_folder

add_idl_folder(Path(__file__).parent)

from {name} import {name}

from muros.rtc import LifeCycleState
from muros.rtc.manager.testing import activate, running


def test_it_has_its_ports() -> None:
    with running({name}) as component:
        assert sorted(port.name for port in component.ports) == {_quoted(ports)}


def test_it_becomes_active_and_runs() -> None:
    with running({name}) as component:
        activate(component)
        assert component.state() is LifeCycleState.ACTIVE_STATE
'''


def _checked(profile: RtcProfile) -> RtcProfile:
    """The profile, if a component can be written of it."""
    if not IDENTIFIER.fullmatch(profile.name) or keyword.iskeyword(profile.name):
        raise RtcError(f"{profile.name!r} cannot be the name of a class; use letters, digits and _")
    rate = profile.execution_rate
    if rate is not None and not 0 < rate < math.inf:
        raise RtcError(f"{rate:g} is no rate of an execution context; give cycles per second, more than 0")
    data, services = [port.name for port in profile.data_ports], [port.name for port in profile.service_ports]
    named = [*data, *services]
    for name in named:
        if not IDENTIFIER.fullmatch(name):
            raise RtcError(f"{name!r} cannot be the name of a port; use letters, digits and _")
        if named.count(name) > 1:
            raise RtcError(f"there are two ports {name!r}; names of ports are unique")
    parameters = [parameter.name for parameter in profile.parameters]
    for parameter in profile.parameters:
        if not IDENTIFIER.fullmatch(parameter.name):
            raise RtcError(f"{parameter.name!r} cannot be the name of a parameter; use letters, digits and _")
        if parameters.count(parameter.name) > 1:
            raise RtcError(f"there are two parameters {parameter.name!r}; names of parameters are unique")
        _value(parameter)
    for port in profile.data_ports:
        if not TYPE.fullmatch(port.type):
            raise RtcError(f"port {port.name}: {port.type!r} is no data type; write TimedLong or My::Type")
    for service in profile.service_ports:
        for one in service.interfaces:
            if not TYPE.fullmatch(one.type):
                raise RtcError(
                    f"port {service.name}: {one.type!r} is no interface; write MyService or My::Service"
                )
            if not IDENTIFIER.fullmatch(one.instance_name):
                raise RtcError(
                    f"{one.instance_name!r} cannot be the name of an interface; use letters, digits and _"
                )
            if not one.idl_file:
                raise RtcError(
                    f"{one.type}: in which IDL file does it stand? Give --service-idl or --consumer-idl"
                )
    return profile


def _parameter(text: str) -> ParameterProfile:
    parts = text.split(":", 4)
    if len(parts) < 3 or not parts[0] or not parts[1]:
        raise RtcError(f"--config {text}: write NAME:TYPE:DEFAULT, such as gain:double:1.0")
    name, kind, default, constraint, widget = (*parts, "", "")[:5]
    return ParameterProfile(name, kind, default, "", constraint, widget)


def _data_port(text: str, direction: str, idl: Sequence[Path]) -> DataPortProfile:
    name, colon, kind = text.partition(":")
    if not colon or not name or not kind:
        raise RtcError(f"--{'inport' if direction == 'DataInPort' else 'outport'} {text}: write NAME:TYPE")
    full = kind if "::" in kind else f"RTC::{kind}"
    own = "" if full.startswith("RTC::") or not idl else idl[0].name
    return DataPortProfile(name, direction, full, own)


def _services(arguments: argparse.Namespace) -> tuple[tuple[ServicePortProfile, ...], list[Path]]:
    ports: dict[str, list[ServiceInterfaceProfile]] = {}
    files: list[Path] = []
    for what, provided in (("service", True), ("consumer", False)):
        texts: list[str] = getattr(arguments, what)
        idl: list[str] = getattr(arguments, f"{what}_idl")
        if texts and len(idl) not in (1, len(texts)):
            raise RtcError(f"--{what}-idl: give one IDL file for all, or one for each --{what}")
        for text, file in zip(texts, idl if len(idl) == len(texts) else idl * len(texts), strict=True):
            parts = text.split(":", 2)
            if len(parts) != 3 or not all(parts):
                raise RtcError(
                    f"--{what} {text}: write PORT:INSTANCE:TYPE, such as MyService:myservice0:My::Service"
                )
            port, instance, kind = parts
            one = ServiceInterfaceProfile(instance, instance, kind, provided, Path(file).name)
            ports.setdefault(port, []).append(one)
            files.append(Path(file))
    return tuple(ServicePortProfile(name, tuple(ones)) for name, ones in ports.items()), files


def _attribute_names(profile: RtcProfile) -> dict[int, str]:
    """The attributes for ports, parameters and interfaces, by their `id`s: their names, with `_` where these are taken.

    Python and Component have names, too, and a port may be called as a parameter is.
    """
    from muros.rtc.component import Component

    names: dict[int, str] = {}
    wanted = [
        *((id(port), port.name) for port in profile.data_ports),
        *((id(one), one.name) for one in profile.parameters),
        *((id(one), one.instance_name) for port in profile.service_ports for one in port.interfaces),
    ]
    for which, attribute in wanted:
        while keyword.iskeyword(attribute) or hasattr(Component, attribute) or attribute in names.values():
            attribute += "_"
        names[which] = attribute
    return names


def _attributes(profile: RtcProfile) -> Iterable[tuple[str, object]]:
    yield "version", profile.version
    if profile.vendor:
        yield "vendor", profile.vendor
    yield "category", profile.category
    if profile.max_instances:
        yield "max_instance", profile.max_instances
    if profile.execution_rate is not None and profile.execution_rate != 1000.0:
        rate = profile.execution_rate
        yield "rate", int(rate) if rate.is_integer() else rate


def _imports(ports: Iterable[DataPortProfile]) -> list[str]:
    modules: dict[str, set[str]] = {}
    for port in ports:
        module, _, name = port.type.rpartition("::")
        modules.setdefault(module.replace("::", ".") or "RTC", set()).add(name)
    return [f"from {module} import {', '.join(sorted(names))}" for module, names in sorted(modules.items())]


def _declared_port(kind: str, port: DataPortProfile, attribute: str) -> str:
    renamed = f", name={_quoted(port.name)}" if attribute != port.name else ""
    return f"    {attribute} = {kind}({port.type.rpartition('::')[2]}{renamed})"


def _declared_parameter(parameter: ParameterProfile, attribute: str) -> str:
    words = [_quoted(_value(parameter))]
    if attribute != parameter.name:
        words.append(f"name={_quoted(parameter.name)}")
    if parameter.constraint:
        words.append(f"constraint={_quoted(parameter.constraint)}")
    if parameter.widget:
        words.append(f"widget={_quoted(parameter.widget)}")
    return f"    {attribute} = Parameter({', '.join(words)})"


def _declared_interface(port: ServicePortProfile, one: ServiceInterfaceProfile, names: dict[int, str]) -> str:
    attribute = names[id(one)]
    words = [
        _quoted(one.type),
        f"idl={_quoted(one.idl_file)}",
        f"port={_quoted(port.name)}",
        f"instance={_quoted(one.instance_name)}",
    ]
    if "::" in one.type:  # the code that editors write in other languages says the whole name, too
        words.append(f"type_name={_quoted(one.type)}")
    return f"    {attribute} = {'Provided' if one.provided else 'Required'}({', '.join(words)})"


def _value(parameter: ParameterProfile) -> object:
    """The default as a value, of which the class derives the parameter's type. RtcError where it is none."""
    kind, text = parameter.type.lower().removeprefix("std::").strip(), parameter.default.strip()
    vector = re.fullmatch(r"(?:vector|sequence)\s*<\s*([\w: ]+?)\s*>", kind)
    try:
        if vector:
            return [
                _scalar(vector[1].removeprefix("std::"), part.strip())
                for part in text.split(",")
                if part.strip()
            ]
        return _scalar(kind, text)
    except ValueError:
        raise RtcError(f"parameter {parameter.name}: {text!r} is no {parameter.type}") from None


def _scalar(kind: str, text: str) -> object:
    if kind in ("float", "double"):
        return float(text or "0")
    if kind in ("bool", "boolean"):
        if text.lower() not in ("", "0", "1", "true", "false"):
            raise ValueError(text)
        return text.lower() in ("1", "true")
    if kind in NUMBERS or kind.startswith("unsigned") or kind in ("ushort", "ulong", "uint"):
        return int(text or "0", 0)
    return text


def _members(interfaces: Iterable[ServiceInterfaceProfile], files: Sequence[Path]) -> list[str]:
    """What the component needs to provide interfaces: a method for each operation, a value for each attribute."""
    found = {member.name: member for one in interfaces for member in members_of(one.type, files)}
    lines: list[str] = []
    for member in found.values():
        told = f"{member.interface}.{member.name}"
        if member.parameters is None:
            lines += ["", f"    {member.name} = None", f'    """{told}: callers read it."""']
            continue
        words = [f"{word}_" if keyword.iskeyword(word) else word for word in ("self", *member.parameters)]
        lines += [
            "",
            f"    def {member.name}({', '.join(words)}):",
            f'        """{told}"""',
            "        raise NotImplementedError",
        ]
    return lines


def _quoted(value: object) -> str:
    """As Python source, texts in double quotes."""
    if isinstance(value, list):
        return f"[{', '.join(map(_quoted, value))}]"
    if isinstance(value, float) and not math.isfinite(value):
        return f'float("{value}")'
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def _plain(text: str) -> str:
    """A text that may stand in a docstring of one line, without its full stop."""
    return " ".join(text.replace("\\", "/").replace('"""', "'").split()).rstrip('."')
