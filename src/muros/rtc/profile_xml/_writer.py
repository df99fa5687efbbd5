"""Writing `RTC.xml`, as RTCBuilder reads it."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from muros.rtc.profile_xml._constraints import constraint_element
from muros.rtc.profile_xml._model import (
    ACTIONS,
    EXT,
    RTC,
    XSI,
    DataPortProfile,
    ParameterProfile,
    RtcProfile,
    ServicePortProfile,
)

__all__ = ["write_profile"]

FORMAT_VERSION = "0.3"
"""The version of the form that is written."""

DOC = "http://www.openrtp.org/namespaces/rtc_doc"


def write_profile(profile: RtcProfile) -> str:
    """The text of an `RTC.xml`, which `read_profile_untrusted` reads back as `profile`."""
    for prefix, uri in (("rtc", RTC), ("rtcExt", EXT), ("rtcDoc", DOC), ("xsi", XSI)):
        register_namespace(prefix, uri)
    root = Element(_tag("RtcProfile"), {_tag("id"): profile.id, _tag("version"): FORMAT_VERSION})
    _basic_info(root, profile)
    actions = SubElement(root, _tag("Actions"))
    for name in ACTIONS:
        if name in profile.actions:
            implemented = "true" if profile.actions[name] else "false"
            SubElement(actions, _tag(name), _typed("rtcDoc:action_status_doc", {"implemented": implemented}))
    if profile.parameters:
        parameters = SubElement(root, _tag("ConfigurationSet"))
        for parameter in profile.parameters:
            _parameter(parameters, parameter)
    for data_port in profile.data_ports:
        _data_port(root, data_port)
    for service_port in profile.service_ports:
        _service_port(root, service_port)
    if profile.language:
        SubElement(root, _tag("Language"), _typed("rtcExt:language_ext", {"kind": profile.language}))
    # Names of types stand in attributes, where the library does not see that their prefixes are used.
    root.set("xmlns:rtcDoc", DOC)
    if not _uses(root, EXT):
        root.set("xmlns:rtcExt", EXT)
    indent(root, "    ")
    return f'<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n{tostring(root, encoding="unicode")}\n'


def _basic_info(root: Element, profile: RtcProfile) -> None:
    rate = profile.execution_rate
    attributes = {
        "name": profile.name,
        "componentType": profile.component_type,
        "activityType": profile.activity_type,
        "componentKind": profile.component_kind,
        "category": profile.category,
        "description": profile.description,
        "executionType": profile.execution_type,
        "maxInstances": str(profile.max_instances),
        "vendor": profile.vendor,
        "version": profile.version,
        "creationDate": profile.creation_date,
        "updateDate": profile.update_date,
    }
    if rate is not None:
        attributes["executionRate"] = repr(float(rate))
    for key, text in (("rtcType", profile.rtc_type), ("abstract", profile.abstract)):
        if text:
            attributes[key] = text
    SubElement(root, _tag("BasicInfo"), _typed("rtcExt:basic_info_ext", attributes))


def _parameter(parent: Element, parameter: ParameterProfile) -> None:
    attributes = {
        "name": parameter.name,
        "type": parameter.type,
        "defaultValue": parameter.default,
        "unit": parameter.unit,
    }
    element = SubElement(parent, _tag("Configuration"), _typed("rtcExt:configuration_ext", attributes))
    constraint = constraint_element(parameter.constraint)
    if constraint is not None:
        element.append(constraint)
    elif parameter.constraint:
        _remark(element, "__constraints__", parameter.constraint)
    if parameter.widget:
        _remark(element, "__widget__", parameter.widget)


def _remark(parent: Element, name: str, value: str) -> None:
    SubElement(parent, f"{{{EXT}}}Properties", {f"{{{EXT}}}name": name, f"{{{EXT}}}value": value})


def _data_port(root: Element, port: DataPortProfile) -> None:
    attributes = {
        "portType": port.direction,
        "name": port.name,
        "type": port.type,
        "idlFile": port.idl_file,
        "interfaceType": port.interface_type,
        "dataflowType": port.dataflow_type,
        "subscriptionType": port.subscription_type,
        "unit": port.unit,
    }
    element = SubElement(root, _tag("DataPorts"), _typed("rtcExt:dataport_ext", attributes))
    element.set(f"{{{EXT}}}position", "RIGHT" if port.direction == "DataOutPort" else "LEFT")


def _service_port(root: Element, port: ServicePortProfile) -> None:
    element = SubElement(root, _tag("ServicePorts"), _typed("rtcExt:serviceport_ext", {"name": port.name}))
    for one in port.interfaces:
        attributes = {
            "direction": "Provided" if one.provided else "Required",
            "name": one.name,
            "instanceName": one.instance_name,
            "idlFile": one.idl_file,
            "type": one.type,
            "path": "",
        }
        SubElement(element, _tag("ServiceInterface"), _typed("rtcExt:serviceinterface_ext", attributes))


def _typed(kind: str, attributes: dict[str, str]) -> dict[str, str]:
    return {f"{{{XSI}}}type": kind, **{_tag(name): text for name, text in attributes.items()}}


def _tag(name: str) -> str:
    return f"{{{RTC}}}{name}"


def _uses(root: Element, namespace: str) -> bool:
    return any(
        name.startswith(f"{{{namespace}}}")
        for element in root.iter()
        for name in (element.tag, *element.attrib)
    )
