"""Service ports find their providers by the rules that OpenRTM-aist's follow, and say so where they do not."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from muros.findings import Finding
from muros.rtc.codes import PeerLostError, Polarity, PortType, ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.ports import Port
from muros.rtc.profiles import ConnectorProfile, InterfaceProfile
from muros.rtc.services import (
    Consumer,
    NotConnectedError,
    Provided,
    Required,
    ServicePort,
    connect,
    service_objects,
    use_service_objects,
)
from tests.rtc.services.fakes import BetterService, DeclaredError, MyService, Objects, OtherService

OK = ReturnCode.RTC_OK
VECTORS = Path(__file__).parents[2] / "vectors" / "rtc" / "connector_serviceport.json"


@dataclass
class Instance:
    instance_name: str


class Echo:
    def echo(self, text: str) -> str:
        if text == "no":
            raise DeclaredError(text)
        return f"{text}!"


class Case:
    """A provider's port and a consumer's, joined by one set of objects."""

    def __init__(self) -> None:
        self.objects = Objects()
        self.findings: list[Finding] = []
        self.provider = self.port("MyServiceProvider0")
        self.provider.register_provider("myservice0", "MyService", Echo(), MyService)
        self.consuming = self.port("MyServiceConsumer0")
        self.consumer = self.consuming.register_consumer("myservice0", "MyService", Consumer(MyService))

    def port(self, owner: str) -> ServicePort:
        return ServicePort(
            "MyService", owner=Instance(owner), objects=self.objects, report=self.findings.append
        )

    def connect(self, *ports: Port, **properties: str) -> tuple[ReturnCode, ConnectorProfile]:
        ports = ports or (self.provider, self.consuming)
        named = {key.replace("__", "."): value for key, value in properties.items()}
        return ports[0].connect(ConnectorProfile("wanted", "", ports, named))


REQUIRED = "MyServiceConsumer0__port__MyService__required__MyService__myservice0"
PROVIDED = "MyServiceProvider0.port.MyService.provided.MyService.myservice0"


@pytest.mark.parametrize("vector", json.loads(VECTORS.read_text()), ids=lambda v: v["label"])
def test_requests_recorded_with_openrtm_are_answered_alike(vector: dict[str, Any]) -> None:
    case = Case()

    class DataPort(Port):
        def publish_interfaces(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
            return ReturnCode.BAD_PARAMETER, profile

    ports: dict[int, Port] = {
        36261: case.provider,
        42453: case.consuming,
        41211: DataPort("Long", PortType.DATA_IN),
    }
    request = vector["request"]
    chain = tuple(ports[p["objref"]["profiles"][0]["port"]] for p in request["ports"])
    properties = {p["name"]: p["value"] for p in request["properties"]}
    code, agreed = chain[0].connect(ConnectorProfile(request["name"], "", chain, properties))
    assert code.name == vector["return_code"]
    stored = [len(s["connectors"]) for s in vector["stored"]]
    assert [len(port.connectors) for port in chain] == stored
    if code is OK:
        names = {p["name"] for p in vector["returned_profile"]["properties"]}
        assert set(agreed.properties) == names
        assert case.consumer.is_connected == (len(chain) == 2)
        assert chain[0].disconnect(agreed.connector_id).name == vector["disconnect"]
    assert [len(port.connectors) for port in chain] == vector["after_disconnect"]
    assert not case.consumer.is_connected


def test_calls_arrive_while_the_provider_is_active() -> None:
    case = Case()
    with pytest.raises(
        NotConnectedError, match=r"MyService myservice0 of port MyServiceConsumer0\.MyService is not"
    ):
        case.consumer.echo("hello")
    case.connect()
    with pytest.raises(PeerLostError, match=r"MyServiceConsumer0\.MyService: the provider is not active"):
        case.consumer.echo("hello")
    case.provider.activate()
    assert case.consumer.echo("hello") == "hello!"
    with pytest.raises(DeclaredError):
        case.consumer.echo("no")
    case.provider.deactivate()
    with pytest.raises(PeerLostError):
        case.consumer.echo("hello")
    case.provider.disconnect_all()
    assert not case.consumer
    assert case.consumer.object is None
    with pytest.raises(NotConnectedError):
        case.consumer.echo("hello")


def test_a_provider_registered_while_active_is_active() -> None:
    case = Case()
    case.provider.activate()
    case.provider.register_provider("second", "MyService", Echo())
    assert [o.active for o in case.objects.offered.values()] == [True, True]


def test_the_newer_of_two_providers_is_called_while_it_is_connected() -> None:
    case = Case()
    other = case.port("Other0")
    other.register_provider("myservice0", "MyService", Echo())
    for port in (case.provider, other):
        port.activate()
    case.connect()
    older = case.consumer.object
    _, second = case.connect(other, case.consuming)
    assert case.consumer.object is not older
    case.consuming.disconnect(second.connector_id)
    assert case.consumer.object is older
    assert case.consumer.echo("hello") == "hello!"


def test_the_same_pair_may_be_connected_again() -> None:
    case = Case()
    assert [case.connect()[0], case.connect()[0]] == [OK, OK]


def test_a_mapping_leads_to_a_provider_of_another_name() -> None:
    case = Case()
    case.provider.register_provider("spare", "MyService", Echo(), MyService)
    code, _ = case.connect(**{REQUIRED: "MyServiceProvider0.port.MyService.provided.MyService.spare"})
    assert code is OK
    assert case.consumer.object.offered.reference == "IOR:1"
    assert case.findings == []


@pytest.mark.parametrize("nothing", ["null", "nil", "NIL"])
def test_nothing_can_be_meant(nothing: str) -> None:
    case = Case()
    assert case.connect(**{REQUIRED: nothing, "port__connection__strictness": "strict"})[0] is OK
    assert not case.consumer.is_connected
    assert case.findings == []
    alone = {"port__MyService__myservice0": nothing, "port__connection__strictness": "strict"}
    assert case.connect(case.consuming, **alone)[0] is OK


@pytest.mark.parametrize("strict", [True, False])
@pytest.mark.parametrize("reference", ["corbaloc::1", "IOR:nowhere", ""])
def test_what_leads_nowhere_is_told(reference: str, strict: bool) -> None:
    case = Case()
    properties = {"port__MyService__myservice0": reference}
    if strict:
        properties["port__connection__strictness"] = "Strict"
    code, _ = case.connect(case.consuming, **properties)
    assert code is (ReturnCode.RTC_ERROR if strict else OK)
    assert len(case.consuming.connectors) == (0 if strict else 1)
    finding = case.findings[0]
    assert finding.code == "service-without-provider"
    assert "same instance name" in finding.remedy
    assert (reference or "nobody offers") in finding.why


def test_a_wrong_mapping_falls_back_and_is_told() -> None:
    """The real one falls back without a word."""
    case = Case()
    assert case.connect(**{REQUIRED: "Nope0.port.MyService.provided.MyService.x"})[0] is OK
    assert case.consumer.is_connected
    assert [f.code for f in case.findings] == ["service-mapping"]
    assert "Nope0" in case.findings[0].why


@pytest.mark.parametrize(("offered", "served"), [(BetterService, True), (OtherService, False)])
def test_a_derived_interface_serves_too(offered: type, served: bool) -> None:
    case = Case()
    derived = case.port("Derived0")
    derived.register_provider("myservice0", offered.__name__, Echo(), offered)
    assert case.connect(derived, case.consuming)[0] is OK
    assert case.consumer.is_connected is served
    assert [f.code for f in case.findings] == ([] if served else ["service-without-provider"])


def test_an_exact_match_goes_before_a_derived_one() -> None:
    case = Case()
    derived = case.port("Derived0")
    derived.register_provider("myservice0", "BetterService", Echo(), BetterService)
    case.connect(derived, case.provider, case.consuming)
    assert case.consumer.object.offered.interface is MyService


def test_programs_connect_ports() -> None:
    case = Case()
    profile = connect(case.provider, case.consuming, name="by hand")
    assert (profile.name, case.consumer.is_connected) == ("by hand", True)
    lonely = case.port("Lonely0")
    lonely.register_consumer("nobody", "MyService", Consumer())
    with pytest.raises(
        RtcError, match=r"MyServiceProvider0\.MyService and Lonely0\.MyService are not connected: RTC_ERR"
    ):
        connect(case.provider, lonely)
    assert connect(case.provider, lonely, strict=False).text("port.connection.strictness") == "best_effort"
    key = "Lonely0.port.MyService.required.MyService.nobody"
    assert connect(case.provider, lonely, properties={key: PROVIDED})
    with pytest.raises(RtcError, match="needs the ports"):
        connect()


def test_its_profile_lists_its_interfaces() -> None:
    case = Case()
    case.provider.register_consumer("back", "Other", Consumer())
    profile = case.provider.profile()
    assert profile.properties == {"port.port_type": "CorbaPort"}
    assert profile.interfaces == (
        InterfaceProfile("myservice0", "MyService", Polarity.PROVIDED),
        InterfaceProfile("back", "Other", Polarity.REQUIRED),
    )


def test_names_of_interfaces_are_unique_and_operations_must_be_there() -> None:
    case = Case()
    with pytest.raises(RtcError, match="already"):
        case.provider.register_consumer("myservice0", "MyService", Consumer())
    with pytest.raises(RtcError, match="no method echo"):
        case.provider.register_provider("second", "MyService", object(), MyService)


class Provider(Component):
    MyService = Provided("SimpleService::MyService", idl="MyService.idl", instance="myservice0")
    other = Provided(BetterService, by=lambda component: Echo(), port="MyService")

    def echo(self, text: str) -> str:
        return f"{self.instance_name} {text}"


class Client(Component):
    service = Required(MyService, port="MyService", instance="myservice0")


class TestDeclared:
    @pytest.fixture
    def objects(self) -> Any:
        objects = Objects()
        use_service_objects(objects)
        yield objects
        use_service_objects(None)

    def test_on_a_component(self, objects: Objects) -> None:
        provider, client = Provider(), Client()
        with pytest.raises(RtcError, match="on_initialize"):
            client.service.echo("early")
        for component in (provider, client):
            assert component.initialize([]) is OK
        assert objects.compiled == [("SimpleService::MyService", Path(__file__).parent / "MyService.idl")]
        assert [p.name for p in provider.ports] == ["MyService"]
        assert [(i.instance_name, i.type_name) for i in provider.ports[0].interfaces] == [
            ("myservice0", "MyService"),
            ("other", "BetterService"),
        ]
        assert provider.MyService is provider
        assert isinstance(provider.other, Echo)
        assert isinstance(Client.service, Required)
        ports = (provider.port("MyService"), client.port("MyService"))
        assert ports[0].connect(ConnectorProfile("wanted", "", ports))[0] is OK
        ports[0].activate()
        assert client.service.echo("says hello") == "Provider0 says hello"
        provider.exit()
        assert not client.service.is_connected

    def test_a_name_needs_its_file(self) -> None:
        with pytest.raises(RtcError, match="say where it stands"):
            Required("SimpleService::MyService")

    def test_without_an_orb_there_are_no_services(self) -> None:
        with pytest.raises(RtcError, match="need an ORB"):
            service_objects()
