"""Interface type `csp_channel` over CORBA: the recorded negotiation, and values within a process and between two."""

from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from muros.rtc.codes import DataPortStatus
from muros.rtc.corba import Orb, RunningNameServer, set_up
from muros.rtc.corba._conversion import texts_of, to_nv_list
from muros.rtc.corba._stubs import CSP, RTC
from muros.rtc.data import DataOutPort
from tests.rtc.corba._world import World
from tests.rtc.corba.test_ports import Pair, number
from tests.rtc.data.test_behaviour import wait_for

VECTORS = Path(__file__).parents[2] / "vectors" / "rtc"
RECORDED = {case["label"]: case for case in json.loads((VECTORS / "connector_dataport.json").read_text())}
OBJECTS = {"inport": "InPortCsp", "outport": "OutPortCsp"}
WAIT = 10.0


@pytest.fixture
def pair(orb: Orb) -> Iterator[Pair]:
    before = set(orb.servants)
    findings: list[Any] = []
    one = Pair(set_up(orb, report=findings.append), findings)
    yield one
    one.close()
    assert set(orb.servants) == before, "no object of a connection stays"


def ask(label: str, *ports: Any, more: dict[str, str] | None = None) -> tuple[Any, Any]:
    """Make a recorded request of the first of these ports."""
    request = RECORDED[label]["request"]
    properties = {one["name"]: one["value"] for one in request["properties"]}
    profile = RTC.ConnectorProfile(
        request["name"], "", list(ports), to_nv_list({**properties, **(more or {})})
    )
    code, agreed = ports[0].connect(profile)
    return code, agreed


def kinds(profile: Any) -> dict[str, str]:
    """The kinds of a profile's values by name."""
    return {one.name: str(one.value.typecode().kind()) for one in profile.properties}


@pytest.mark.parametrize("in_first", [False, True])
def test_the_recorded_negotiation(pair: Pair, in_first: bool) -> None:
    recorded = RECORDED["duplex_csp"]
    ports = (pair.inp, pair.out) if in_first else (pair.out, pair.inp)
    code, profile = ask("duplex_csp", *ports)
    assert str(code) == recorded["return_code"]
    told = {one["name"]: one for one in recorded["returned_profile"]["properties"]}
    assert kinds(profile) == {name: one["kind"] for name, one in told.items()}
    texts = texts_of(profile.properties)
    for side, interface in OBJECTS.items():
        name = f"dataport.corba_cdr.{side}_ior"
        type_id = told[name]["value"]["string_ior"]["type_id"]
        assert type_id.encode() in bytes.fromhex(texts[name].removeprefix("IOR:"))
        assert type_id == getattr(CSP, interface)._NP_RepositoryId
    for port in ports:
        (stored,) = port.get_connector_profiles()
        assert kinds(stored) == kinds(profile)
    assert str(ports[0].disconnect(profile.connector_id)) == recorded["disconnect"]
    assert [len(port.get_connector_profiles()) for port in ports] == recorded["after_disconnect"]


def test_duplex_needs_a_channel(pair: Pair) -> None:
    """The recorded InPort keeps half a connection then; ours do not."""
    code, _ = ask("duplex_corba_cdr", pair.out, pair.inp)
    assert str(code) == RECORDED["duplex_corba_cdr"]["return_code"]
    assert not pair.out.get_connector_profiles()
    assert not pair.inp.get_connector_profiles()


@pytest.mark.parametrize("endian", ["little,big", "big"])
def test_values_go_over(pair: Pair, endian: str) -> None:
    code, _ = ask("duplex_csp", pair.out, pair.inp, more={"dataport.serializer.cdr.endian": endian})
    assert code == RTC.RTC_OK
    with ThreadPoolExecutor(1) as pool:
        written = pool.submit(lambda: [pair.source.out.write(number(one)) for one in range(50)])
        assert [pair.sink.inp.read().data for _ in range(50)] == list(range(50))
        assert all(written.result(WAIT))
        reading = pool.submit(pair.sink.inp.read)
        assert pair.source.out.write(number(77))
        assert reading.result(WAIT).data == 77
    assert pair.out.disconnect_all() == RTC.RTC_OK


def test_an_object_that_has_gone(pair: Pair) -> None:
    ask("duplex_csp", pair.out, pair.inp)
    port = pair.sink.inp
    pair.source.out.disconnect_all()
    assert port.try_read()[0] is DataPortStatus.PRECONDITION_NOT_MET
    assert not pair.inp.get_connector_profiles()


def component_of(world: World, name: str) -> Any:
    """A component of the other process."""
    found = world.server.resolve(f"test.host_cxt/{name}.rtc")
    assert found is not None
    return found._narrow(RTC.RTObject)


@pytest.mark.flaky(reruns=1)
def test_between_two_processes(orb: Orb, name_server: RunningNameServer, tmp_path: Path, pair: Pair) -> None:
    """Our OutPort, their InPort, until they are killed; and the other way round."""
    world = World(orb, name_server, tmp_path)
    try:
        giver, taker = component_of(world, "Giver0"), component_of(world, "Taker0")
        assert ask("duplex_csp", pair.out, taker.get_ports()[0])[0] == RTC.RTC_OK
        assert ask("duplex_csp", giver.get_ports()[0], pair.inp)[0] == RTC.RTC_OK
        for component in (giver, taker):
            component.get_owned_contexts()[0].activate_component(component)
        assert pair.source.out.write(number(41))
        world.process.until(r"got 41")
        assert pair.source.out.write(number(42))
        world.process.until(r"got 42")
        first = pair.sink.inp.read().data
        assert [pair.sink.inp.read().data for _ in range(3)] == [first + 1, first + 2, first + 3]
    finally:
        world.process.end(kill=True)
    out: DataOutPort[Any] = pair.source.out
    wait_for(lambda: not out.write(number(1)) and not out.connectors)
    wait_for(
        lambda: (
            pair.sink.inp.try_read()[0] is not DataPortStatus.PORT_OK
            and not pair.inp.get_connector_profiles()
        )
    )
