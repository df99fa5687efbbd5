"""Components with the ports of recorded ones are seen by tools as those were."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from muros.rtc import Component
from muros.rtc.corba import Orb, data_type_of, load_idl, set_up
from muros.rtc.corba._conversion import texts_of
from muros.rtc.data import DataInPort, DataOutPort
from muros.rtc.fsm import EventInPort, Machine, State
from muros.rtc.services import Consumer, ServicePort

VECTORS = Path(__file__).parents[2] / "vectors" / "rtc"
IDL = Path(__file__).parents[1] / "shim" / "components" / "MyService.idl"
NAMES = (
    *("seqin", "seqout", "service_provider", "service_consumer"),
    *("fsm_eventport_in", "fsm_eventport_out", "configsample"),
)

OTHER = {
    "dataport.dataflow_type",  # events are pushed only
    "dataport.interface_type",
    "dataport.marshaling_types",  # ours has more of both
}
"""Port properties whose values differ on purpose."""

SAME = (
    *("implementation_id", "type_name", "description", "version", "vendor", "category"),
    *("activity_type", "max_instance", "language", "lang_type", "instance_name"),
)
"""Properties of components that are the recorded ones."""


class Oven(State):
    """Stands for the machine of the recorded event port."""


def texts(properties: list[dict[str, Any]]) -> dict[str, str]:
    """Of a recorded profile; hints for editors, which are all empty, are left out."""
    return {one["name"]: one["value"] for one in properties if "interface_option" not in one["name"]}


class Recorded(Component):
    """A component made of a recorded profile."""

    def __init__(self, ports: list[dict[str, Any]]) -> None:
        super().__init__()
        self._recorded_ports = ports

    def on_initialize(self) -> None:
        for port in self._recorded_ports:
            self.add_port(self._port(port["name"].rpartition(".")[2], port))

    def _port(self, name: str, recorded: dict[str, Any]) -> Any:
        told = texts(recorded["properties"])
        if told["port.port_type"] == "CorbaPort":
            return self._service_port(name, recorded["interfaces"])
        if told["data_type"] == "any":
            return EventInPort(name, Machine(Oven))
        kind = DataInPort if told["port.port_type"] == "DataInPort" else DataOutPort
        return kind(name, data_type_of(told["data_type"]))

    def _service_port(self, name: str, interfaces: list[dict[str, Any]]) -> ServicePort:
        port = ServicePort(name)
        interface = load_idl(IDL)["SimpleService"].MyService
        for one in interfaces:
            if one["polarity"] == "PROVIDED":
                port.register_provider(one["instance_name"], one["type_name"], self, interface)
            else:
                port.register_consumer(one["instance_name"], one["type_name"], Consumer(interface))
        return port

    def echo(self, text: str) -> str:
        return text

    get_echo_history = get_value_history = get_value = set_value = echo


@pytest.fixture(params=NAMES)
def pair(request: pytest.FixtureRequest, orb: Orb) -> Iterator[tuple[dict[str, Any], Any]]:
    """What was recorded, and the reference to a component of ours with the same ports."""
    wanted = json.loads((VECTORS / f"component_{request.param}.json").read_text())
    objects = set_up(orb)
    component = Recorded(wanted["ports"])
    theirs = texts(wanted["component_profile"]["properties"])
    own = {name: text for name, text in theirs.items() if name in SAME or name.startswith("conf.")}
    component.configure(wanted["component_profile"]["instance_name"], own)
    assert component.initialize() == 0
    yield wanted, objects.offer(component)
    component.exit()
    objects.withdraw(component)


def test_it_is_what_the_recorded_one_is(pair: tuple[dict[str, Any], Any]) -> None:
    wanted, reference = pair
    for repository_id, answer in wanted["is_a"].items():
        assert reference._is_a(repository_id) is answer, repository_id
    profile, theirs = reference.get_component_profile(), wanted["component_profile"]
    for name in ("instance_name", "type_name", "description", "version", "vendor", "category"):
        assert getattr(profile, name) == theirs[name]
    ours = texts_of(profile.properties)
    for name, text in texts(theirs["properties"]).items():
        if name in SAME or name.startswith("conf."):
            assert ours[name] == text, name
    assert reference.get_sdo_id() == wanted["sdo"]["sdo_id"]
    assert reference.get_sdo_type() == wanted["sdo"]["sdo_type"]


def test_its_ports_are_those_of_the_recorded_one(pair: tuple[dict[str, Any], Any]) -> None:
    wanted, reference = pair
    ports = reference.get_ports()
    assert len(ports) == len(wanted["ports"])
    for port, theirs in zip(ports, wanted["ports"], strict=True):
        profile = port.get_port_profile()
        assert profile.name == theirs["name"]
        assert profile.owner._is_equivalent(reference)
        assert port._is_equivalent(profile.port_ref)
        interfaces = [(one.instance_name, one.type_name, str(one.polarity)) for one in profile.interfaces]
        assert interfaces == [
            (one["instance_name"], one["type_name"], one["polarity"]) for one in theirs["interfaces"]
        ]
        ours, told = texts_of(profile.properties), texts(theirs["properties"])
        assert set(ours) >= set(told)
        assert {name for name in told if ours[name] != told[name]} <= OTHER
        for name in OTHER & set(told):
            lost = set(told[name].split(",")) - set(ours[name].split(","))
            assert lost <= {"duplex", "csp_channel"} | ({"pull"} if told["data_type"] == "any" else set())


def test_its_context_and_sets_are_those_of_the_recorded_one(pair: tuple[dict[str, Any], Any]) -> None:
    wanted, reference = pair
    (context,) = reference.get_owned_contexts()
    (theirs,) = wanted["owned_contexts"]
    assert (str(context.get_kind()), context.is_running()) == (theirs["get_kind"], theirs["is_running"])
    assert context.get_rate() == theirs["get_rate"]
    shown, told = texts_of(context.get_profile().properties), texts(theirs["profile"]["properties"])
    assert (
        shown.items() >= {key: told[key] for key in ("type", "sync_transition", "transition_timeout")}.items()
    )
    assert [reference.get_context_handle(context)] == wanted["context_handles"]
    assert [reference.is_alive(context)] == wanted["is_alive"]
    if wanted["states"] == ["ACTIVE_STATE"]:
        context.activate_component(reference)
    assert [str(context.get_component_state(reference))] == wanted["states"]
    sets = {
        one.id: texts_of(one.configuration_data)
        for one in reference.get_configuration().get_configuration_sets()
    }
    kept = {one["id"]: texts(one["configuration_data"]) for one in wanted["sdo"]["configuration_sets"]}
    assert sets == kept
