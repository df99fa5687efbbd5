"""What tools read of a component, beside what was recorded of real ones."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from muros.rtc import Component, InPort, OutPort
from muros.rtc.corba import Orb, set_up
from muros.rtc.corba._conversion import texts_of
from muros.rtc.corba._stubs import RTC, OpenRTM, SDOPackage

VECTORS = Path(__file__).parents[2] / "vectors" / "rtc"

OTHER = {
    "dataport.interface_type",
    "dataport.marshaling_types",  # ours has more of both
}
"""Port properties whose values differ on purpose."""


def load(name: str) -> Any:
    return json.loads((VECTORS / f"component_{name}.json").read_text())


def recorded(properties: list[dict[str, Any]]) -> dict[str, str]:
    """Of a profile; hints for editors, which are all empty, are left out."""
    return {one["name"]: one["value"] for one in properties if "interface_option" not in one["name"]}


class SequenceOut(Component):
    """Sequence OutPort component"""

    type_name = "SequenceOutComponent"
    version = "1.0"
    vendor = "Shinji Kurihara"
    category = "example"
    max_instance = 10
    specification = {"implementation_id": "SeqOut"}  # noqa: RUF012
    octet = OutPort(RTC.TimedOctet, name="Octet")
    short = OutPort(RTC.TimedShort, name="Short")


class ConsoleOut(Component):
    """Console output component"""

    inp = InPort(RTC.TimedLong, name="in")


@pytest.fixture
def offered(orb: Orb) -> Iterator[Any]:
    """Makes components known and ends them."""
    objects = set_up(orb)
    made: list[Component] = []

    def offer(kind: type[Component], name: str, **properties: str) -> Any:
        component = kind()
        component.configure(name, {key.replace("__", "."): text for key, text in properties.items()})
        assert component.initialize() == 0
        made.append(component)
        return objects.offer(component)

    yield offer
    for component in made:
        component.exit()
        objects.withdraw(component)


def test_a_component_with_outports(offered: Any) -> None:
    wanted = load("seqout")
    reference = offered(SequenceOut, "SequenceOutComponent0")
    for repository_id, answer in wanted["is_a"].items():
        assert reference._is_a(repository_id) is answer, repository_id
    profile = reference.get_component_profile()
    for name in ("instance_name", "type_name", "description", "version", "vendor", "category"):
        assert getattr(profile, name) == wanted["component_profile"][name]
    theirs = recorded(wanted["component_profile"]["properties"])
    ours = texts_of(profile.properties)
    for name in (
        "implementation_id",
        "activity_type",
        "max_instance",
        "language",
        "lang_type",
        "instance_name",
    ):
        assert ours[name] == theirs[name], name
    for port, one in zip(reference.get_ports(), wanted["ports"], strict=False):
        assert_port(port, one)


def assert_port(port: Any, wanted: Any) -> None:
    profile = port.get_port_profile()
    assert profile.name == wanted["name"]
    ours, theirs = texts_of(profile.properties), recorded(wanted["properties"])
    assert set(ours) >= set(theirs)
    assert {name for name in theirs if ours[name] != theirs[name]} <= OTHER


def test_an_inport_and_a_triggered_context(offered: Any) -> None:
    wanted = load("exttrig_ec")
    reference = offered(ConsoleOut, "ConsoleOut0", exec_cxt__periodic__type="ExtTrigExecutionContext")
    assert_port(reference.get_ports()[0], wanted["ports"][0])
    (context,) = reference.get_owned_contexts()
    assert context._narrow(OpenRTM.ExtTrigExecutionContextService) is not None
    (theirs,) = wanted["owned_contexts"]
    profile = context.get_profile()
    assert context.is_running() is theirs["is_running"]
    assert str(profile.kind) == str(context.get_kind()) == theirs["get_kind"]
    assert profile.rate == context.get_rate() == theirs["get_rate"]
    ours, properties = texts_of(profile.properties), recorded(theirs["profile"]["properties"])
    assert {name: ours[name] for name in ("type", "rate")} == {
        name: properties[name] for name in ("type", "rate")
    }
    assert [reference.get_context_handle(context)] == wanted["context_handles"]
    assert [reference.is_alive(context)] == wanted["is_alive"]
    assert [str(context.get_component_state(reference))] == wanted["states"]


def test_the_sdo_side(offered: Any) -> None:
    wanted = load("exttrig_ec")["sdo"]
    reference = offered(ConsoleOut, "ConsoleOut0")
    assert reference.get_sdo_id() == wanted["sdo_id"]
    assert reference.get_sdo_type() == wanted["sdo_type"]
    device = reference.get_device_profile()
    assert {name: getattr(device, name) for name in wanted["device_profile"]} == wanted["device_profile"]
    assert reference.get_service_profiles() == wanted["service_profiles"]
    with pytest.raises(SDOPackage.InterfaceNotImplemented):
        reference.get_monitoring()
    assert reference.get_status_list() == wanted["status_list"]
    assert reference.get_organizations() == wanted["organizations"]
    configuration = reference.get_configuration()
    sets = [
        {"id": one.id, "description": one.description, "configuration_data": one.configuration_data}
        for one in configuration.get_configuration_sets()
    ]
    assert sets == wanted["configuration_sets"]
    assert configuration.get_active_configuration_set().id == wanted["active_configuration_set"]["id"]
