"""Service ports with a real ORB: references stay, servants come and go, users' interfaces are compiled."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from muros.findings import Finding
from muros.rtc.codes import PeerLostError, ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.corba import Orb, load_idl
from muros.rtc.corba._service_objects import OrbServiceObjects
from muros.rtc.profiles import ConnectorProfile
from muros.rtc.services import (
    Consumer,
    NotConnectedError,
    Provided,
    Required,
    ServicePort,
    use_service_objects,
)

IDL = Path(__file__).parent / "idl" / "Greeter.idl"
OK = ReturnCode.RTC_OK


@pytest.fixture(autouse=True)
def objects(orb: Orb, tmp_path_factory: pytest.TempPathFactory) -> Iterator[OrbServiceObjects]:
    objects = OrbServiceObjects(orb)
    use_service_objects(objects)
    yield objects
    use_service_objects(None)


class Provider(Component):
    hello = Provided("Greetings::Greeter", idl="idl/Greeter.idl", port="greetings")

    def __init__(self) -> None:
        super().__init__()
        self.volume = 5

    def greet(self, name: str) -> str:
        if name == "nobody":
            raise load_idl(IDL)["Greetings"].Refused("who?")
        return f"{self.instance_name} greets {name}, {1 / len(name)}"


class Client(Component):
    hello = Required("Greetings::Greeter", idl="idl/Greeter.idl", port="greetings")


def connect(*ports: Any) -> ReturnCode:
    code: ReturnCode = ports[0].connect(ConnectorProfile("wanted", "", ports))[0]
    return code


def test_a_declared_provider_is_called_through_the_orb() -> None:
    provider, client = Provider(), Client()
    findings: list[Finding] = []
    provider.reporter.on_finding(findings.append)
    for component in (provider, client):
        assert component.initialize([]) is OK
    with pytest.raises(NotConnectedError):
        client.hello.greet("you")
    assert connect(client.port("greetings"), provider.port("greetings")) is OK
    for _ in range(2):
        with pytest.raises(PeerLostError, match="not active"):
            client.hello.greet("you")
        provider.port("greetings").activate()
        assert client.hello.greet("me") == "Provider0 greets me, 0.5"
        client.hello._set_volume(client.hello._get_volume() + 1)
        provider.port("greetings").deactivate()
    assert provider.volume == 7
    provider.port("greetings").activate()
    with pytest.raises(load_idl(IDL)["Greetings"].Refused):
        client.hello.greet("nobody")
    assert findings == []
    with pytest.raises(RtcError, match="UNKNOWN"):
        client.hello.greet("")
    assert [f.code for f in findings] == ["service-failed"]
    assert "ZeroDivisionError" in findings[0].why
    client.exit()
    provider.exit()


def port(name: str, findings: list[Finding] | None = None) -> ServicePort:
    return ServicePort(name, report=(findings if findings is not None else []).append)


def servant(name: str) -> Any:
    skeleton: Any = getattr(load_idl(IDL)["Greetings__POA"], name)
    return type("Servant", (skeleton,), {"greet": lambda self, name: f"hello {name}"})()


@pytest.mark.parametrize("active", [True, False])
def test_a_derived_provider_serves_who_requires_the_base(active: bool) -> None:
    greeter = load_idl(IDL)["Greetings"].Greeter
    providing, requiring = port("singing"), port("listening")
    providing.register_provider("one", "Singer", servant("Singer"))
    consumer = requiring.register_consumer("one", "Greeter", Consumer(greeter))
    if active:
        providing.activate()
    assert connect(providing, requiring) is OK
    providing.activate()
    assert consumer.greet("you") == "hello you"
    providing.deactivate()


def test_a_provider_of_another_type_does_not_serve() -> None:
    findings: list[Finding] = []
    providing, requiring = port("passing"), port("listening", findings)
    providing.register_provider("one", "Stranger", servant("Stranger"))
    consumer = requiring.register_consumer("one", "Greeter", Consumer(load_idl(IDL)["Greetings"].Greeter))
    assert connect(providing, requiring) is OK
    assert not consumer
    assert "no IDL:Greetings/Greeter:1.0" in findings[0].why


def test_what_cannot_be_provided_is_refused() -> None:
    greetings = load_idl(IDL)["Greetings"]
    with pytest.raises(RtcError, match="has no sing"):
        port("p").register_provider("one", "Singer", Provider(), greetings.Singer)
    with pytest.raises(RtcError, match="is no servant"):
        port("p").register_provider("one", "Singer", object())


@pytest.mark.parametrize("name", ["Greetings::Missing", "Missing::Greeter", "Greeter"])
def test_an_interface_that_the_file_does_not_have(objects: OrbServiceObjects, name: str) -> None:
    with pytest.raises(RtcError, match=r"Greeter\.idl has no interface .*its modules are Greetings"):
        objects.interface(name, IDL)


def test_references_that_lead_nowhere(objects: OrbServiceObjects) -> None:
    interface = load_idl(IDL)["Greetings"].Greeter
    with pytest.raises(RtcError, match="no reference"):
        objects.resolve("IOR:zz", interface)
    assert objects.resolve("IOR:01000000010000000000000000000000", interface) is None
