"""Reading `RTC.xml`, which may come from anywhere: no document type, no entities, bounded size and depth."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from muros.rtc.codes import RtcError
from muros.rtc.profile_xml._constraints import constraint_text
from muros.rtc.profile_xml._model import (
    ACTIONS,
    EXT,
    RTC,
    DataPortProfile,
    ParameterProfile,
    RtcProfile,
    ServiceInterfaceProfile,
    ServicePortProfile,
)
from muros.rtc.properties import number_of

__all__ = ["ProfileError", "read_profile_file", "read_profile_untrusted"]

FILE_SIZE: Final = 4 << 20
"""Octets that a profile may have."""

DEPTH: Final = 64
"""Elements inside each other."""


class ProfileError(RtcError):
    """A file is no RTC profile that can be used; the text says where and why."""


def read_profile_file(path: Path) -> RtcProfile:
    """The profile in a file. ProfileError if it cannot be read or is none."""
    try:
        with path.open("rb") as file:
            octets = file.read(FILE_SIZE + 1)
    except OSError as error:
        raise ProfileError(f"{path}: cannot be read: {error.strerror}") from error
    return read_profile_untrusted(octets, str(path))


def read_profile_untrusted(octets: bytes, source: str) -> RtcProfile:
    """The profile in `octets`; `source` is what errors call it. Raises ProfileError, nothing else.

    What a profile says besides (documentation, positions in editors) is left out.
    """
    root = _Parser(source).parse(octets)
    if root.tag != _tag("RtcProfile"):
        raise ProfileError(f"{source}: its root is {_short(root.tag)!r}, not RtcProfile of {RTC}")
    info = root.find(_tag("BasicInfo"))
    if info is None or not _text(info, "name"):
        raise ProfileError(f"{source}: no BasicInfo with a name")
    language = root.find(_tag("Language"))
    return RtcProfile(
        name=_text(info, "name"),
        version=_text(info, "version"),
        vendor=_text(info, "vendor"),
        category=_text(info, "category"),
        description=_text(info, "description"),
        component_type=_text(info, "componentType", "STATIC"),
        activity_type=_text(info, "activityType", "PERIODIC"),
        component_kind=_text(info, "componentKind", "DataFlowComponent"),
        rtc_type=_text(info, "rtcType"),
        execution_type=_text(info, "executionType"),
        execution_rate=_number(info, "executionRate", source),
        max_instances=int(_number(info, "maxInstances", source) or 0),
        abstract=_text(info, "abstract"),
        creation_date=_text(info, "creationDate"),
        update_date=_text(info, "updateDate"),
        language="" if language is None else _text(language, "kind"),
        actions=_actions(root),
        parameters=tuple(
            _parameter(one) for one in root.iterfind(f"{_tag('ConfigurationSet')}/{_tag('Configuration')}")
        ),
        data_ports=tuple(map(_data_port, root.iterfind(_tag("DataPorts")))),
        service_ports=tuple(map(_service_port, root.iterfind(_tag("ServicePorts")))),
    )


class _Parser:
    """XML to elements. What a document type could bring (entities, files, growth) is refused with it."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._builder = TreeBuilder()
        self._depth = 0
        self._expat = parser = expat.ParserCreate(namespace_separator="}")
        parser.StartDoctypeDeclHandler = self._refuse
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._builder.data

    def parse(self, octets: bytes) -> Element:
        if len(octets) > FILE_SIZE:
            raise ProfileError(f"{self._source}: more than {FILE_SIZE >> 20} MiB; this is no RTC profile")
        try:
            self._expat.Parse(octets, True)
        except (expat.ExpatError, ValueError, LookupError) as error:
            raise ProfileError(f"{self._source}:{self._expat.ErrorLineNumber}: no XML: {error}") from error
        return self._builder.close()

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > DEPTH:
            raise ProfileError(f"{self._source}: elements more than {DEPTH} deep; this is no RTC profile")
        self._builder.start(_full(name), {_full(key): text for key, text in attributes.items()})

    def _end(self, name: str) -> None:
        self._depth -= 1
        self._builder.end(_full(name))

    def _refuse(self, *_: object) -> NoReturn:
        raise ProfileError(
            f"{self._source}: it has a document type; RTC profiles have none, and none is read"
        )


def _actions(root: Element) -> dict[str, bool]:
    said = {}
    for element in root.iterfind(f"{_tag('Actions')}/*"):
        name = _short(element.tag)
        if name in ACTIONS:
            said[name] = _text(element, "implemented").lower() == "true"
    return said


def _parameter(element: Element) -> ParameterProfile:
    constraint = element.find(_tag("Constraint"))
    remarks = {
        one.get(f"{{{EXT}}}name", ""): one.get(f"{{{EXT}}}value", "")
        for one in element.iterfind(f"{{{EXT}}}Properties")
    }
    return ParameterProfile(
        _text(element, "name"),
        _text(element, "type"),
        _text(element, "defaultValue"),
        _text(element, "unit"),
        remarks.get("__constraints__", "") if constraint is None else constraint_text(constraint),
        remarks.get("__widget__", ""),
    )


def _data_port(element: Element) -> DataPortProfile:
    return DataPortProfile(
        _text(element, "name"),
        _text(element, "portType"),
        _text(element, "type"),
        _text(element, "idlFile"),
        _text(element, "interfaceType"),
        _text(element, "dataflowType"),
        # Early editors wrote it with this slip.
        _text(element, "subscriptionType") or _text(element, "subscriprionType"),
        _text(element, "unit"),
    )


def _service_port(element: Element) -> ServicePortProfile:
    interfaces = tuple(
        ServiceInterfaceProfile(
            _text(one, "name"),
            _text(one, "instanceName"),
            _text(one, "type"),
            _text(one, "direction") == "Provided",
            _text(one, "idlFile"),
        )
        for one in element.iterfind(_tag("ServiceInterface"))
    )
    return ServicePortProfile(_text(element, "name"), interfaces)


def _text(element: Element, name: str, default: str = "") -> str:
    return element.get(_tag(name), element.get(name, default)).strip()


def _number(element: Element, name: str, source: str) -> float | None:
    text = _text(element, name)
    if not text:
        return None
    number = number_of(text)
    if not 0 <= number < 1e12:
        raise ProfileError(f"{source}: {name} is {text!r}; it is a number from 0 on")
    return number


def _tag(name: str) -> str:
    return f"{{{RTC}}}{name}"


def _full(name: str) -> str:
    return f"{{{name}" if "}" in name else name


def _short(tag: str) -> str:
    return tag.rpartition("}")[2]
