"""What data ports answer to the recorded requests for connections, except where a test here says why not."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from muros.rtc.codes import ReturnCode
from muros.rtc.data import TRANSPORTS, DataInPort, DataOutPort, DataPort
from muros.rtc.data._transports import each_offer, offered_in
from muros.rtc.profiles import ConnectorProfile
from tests.rtc.data.kit import MemoryTransport, Pair, Time, TimedLong, TimedLongType
from tests.rtc.data.test_behaviour import wait_for

RECORDED: dict[str, dict[str, Any]] = {
    case["label"]: case
    for case in json.loads(
        (Path(__file__).parents[2] / "vectors" / "rtc" / "connector_dataport.json").read_text()
    )
}

PORTS: Mapping[str, str] = {
    "push_flush_in_first": "in out",
    "pull_in_first": "in out",
    "two_outports": "out out2",
    "two_inports": "in in2",
    "single_outport": "out",
    "single_inport": "in",
    "three_ports": "out in in2",
    "mismatched_data_types": "out other",
}
"""The ports of each request; all others ask an OutPort and an InPort, in this order."""

ELSEWHERE = {
    "push_data_service", "pull_data_service", "push_shared_memory", "pull_shared_memory", "duplex_csp",
}  # fmt: skip
"""Requests for transports that need an ORB."""

BETTER = {"mismatched_data_types", "push_direct_two_processes", "duplicates"}
"""Requests with a test of their own."""


class Bench:
    def __init__(self) -> None:
        self.findings: list[str] = []
        codec = TimedLongType()
        other = TimedLongType()
        other.repository_id = "IDL:RTC/TimedShort:1.0"
        outs = [DataOutPort(name, codec) for name in ("out", "out2")]
        ins = [DataInPort(name, codec) for name in ("in", "in2")]
        self.ports: dict[str, DataPort[TimedLong]] = {
            port.name: port for port in (*outs, *ins, DataInPort("other", other))
        }
        for port in self.ports.values():
            port.report = lambda finding: self.findings.append(finding.format())

    def ask(self, label: str, more: Mapping[str, str] = {}) -> tuple[ReturnCode, ConnectorProfile]:
        request = RECORDED[label]["request"]
        ports = tuple(self.ports[name] for name in PORTS.get(label, "out in").split())
        properties = {
            one["name"]: one["value"] for one in request["properties"] if one["kind"] == "CORBA.tk_string"
        }
        profile = ConnectorProfile(request["name"], request["connector_id"], ports, {**properties, **more})
        return ports[0].connect(profile)


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    for port in bench.ports.values():
        port.disconnect_all()


@pytest.mark.parametrize("label", sorted(set(RECORDED) - ELSEWHERE - BETTER))
def test_answers(bench: Bench, label: str) -> None:
    recorded = RECORDED[label]
    code, profile = bench.ask(label)
    assert code.name == recorded["return_code"], bench.findings
    standing = [port for port in bench.ports.values() if port.connectors]
    if code is not ReturnCode.RTC_OK:
        assert not standing, "nobody keeps half a connection"
        assert bench.findings
        assert "refused" in bench.findings[0]
        return
    agreed = {
        one["name"]
        for one in recorded["returned_profile"]["properties"]
        if not one["name"].endswith("_ior")  # the memory transport has references only
    }
    assert agreed <= set(profile.properties)
    assert profile.text("dataport.inport.data_type") == "IDL:RTC/TimedLong:1.0"
    assert [port.connector(profile.connector_id) is not None for port in standing] == [True] * len(standing)
    assert len(standing) == len(recorded["request"]["ports"])
    assert profile.ports[0].disconnect(profile.connector_id).name == recorded["disconnect"]  # type: ignore[attr-defined]
    assert not any(port.connectors or port.connector_infos for port in bench.ports.values())


def test_different_data_types_are_refused(bench: Bench) -> None:
    """The recorded ports are never looked at: values of one type come as another. Ours refuse, and say which."""
    assert RECORDED["mismatched_data_types"]["return_code"] == "RTC_OK"
    code, _ = bench.ask("mismatched_data_types")
    assert code is ReturnCode.BAD_PARAMETER
    assert "IDL:RTC/TimedShort:1.0" in bench.findings[0]
    assert "IDL:RTC/TimedLong:1.0" in bench.findings[0]
    assert not any(port.connectors for port in bench.ports.values())


@pytest.mark.parametrize("told", ["TimedLong", "IDL:RTC/TimedLong:1.0", "any", "RTC::TimedLong", "", " ANY "])
def test_other_names_of_the_same_data_type(bench: Bench, told: str) -> None:
    bench.ports["in"].data_type.repository_id = told  # type: ignore[misc]
    assert bench.ask("push_flush_out_first")[0] is ReturnCode.RTC_OK


def test_direct_needs_both_ports_in_one_process(bench: Bench) -> None:
    label = "push_direct_two_processes"
    bench.ports["in"] = Elsewhere("in", TimedLongType())
    code, _ = bench.ask(label)
    assert code.name == RECORDED[label]["return_code"]
    assert bench.ask("push_flush_out_first")[0] is ReturnCode.RTC_OK


def test_twice(bench: Bench) -> None:
    recorded = RECORDED["duplicates"]
    code, first = bench.ask("push_flush_out_first")
    assert code.name == recorded["first"]
    assert bench.ask("push_flush_out_first")[0].name == recorded["second_same_ports_new_id"]
    again = {"dataport.allow_dup_connection": "YES"}
    assert bench.ask("push_flush_out_first", again)[0].name == recorded["allow_dup_connection"]
    assert len(bench.ports["out"].connectors) == recorded["n_connectors"]
    assert bench.ports["out"].notify_connect(first)[0].name == recorded["same_id"]
    assert bench.ports["out"].disconnect("nosuch").name == recorded["disconnect_unknown_id"]
    assert bench.ports["out"].notify_disconnect("nosuch").name == recorded["notify_disconnect_unknown"]
    assert bench.ports["out"].disconnect_all().name == recorded["disconnect_all"]
    assert [len(bench.ports[name].connectors) for name in ("out", "in")] == recorded["remaining"]


def test_both_inports_of_a_fan_out_get_every_value(bench: Bench) -> None:
    out, one, two = (bench.ports[name] for name in ("out", "in", "in2"))
    assert isinstance(out, DataOutPort)
    assert isinstance(one, DataInPort)
    assert isinstance(two, DataInPort)
    properties = {
        "dataport.interface_type": "corba_cdr",
        "dataport.dataflow_type": "push",
        "dataport.subscription_type": "flush",
    }
    for port in (one, two):
        assert out.connect(ConnectorProfile("wire", "", (out, port), properties))[0] is ReturnCode.RTC_OK
    assert out.write(out.data_type.default())
    assert one.is_new()
    assert two.is_new()
    assert out.data_type.encoded == 1, "encoded once for both"  # type: ignore[attr-defined]


@pytest.mark.parametrize("names", ["out in in2", "in out in2", "in in2 out"])
@pytest.mark.parametrize("interface", ["corba_cdr", "direct"])
def test_all_inports_of_one_connection_get_every_value(bench: Bench, names: str, interface: str) -> None:
    """Recorded OutPorts send to the first InPort only."""
    ports = tuple(bench.ports[name] for name in names.split())
    properties = {
        "dataport.interface_type": interface,
        "dataport.dataflow_type": "push",
        "dataport.subscription_type": "new",
    }
    code, profile = ports[0].connect(ConnectorProfile("wire", "", ports, properties))
    assert code is ReturnCode.RTC_OK, bench.findings
    out, *ins = (bench.ports[name] for name in ("out", "in", "in2"))
    assert isinstance(out, DataOutPort)
    assert out.write(TimedLong(Time(), 7))
    assert len(out.status) == len(out.connector_infos) == 2
    for port in ins:
        assert isinstance(port, DataInPort)
        wait_for(port.is_new)
        assert port.read().data == 7
    assert ports[1].disconnect(profile.connector_id) is ReturnCode.RTC_OK
    assert not any(port.connectors or port.connector_infos for port in ports)


def test_an_inport_that_knows_no_places_is_found_beside_others() -> None:
    """A port of OpenRTM-aist in a connection of three has the usual names only."""
    ports = (object(), object(), object())
    profile = ConnectorProfile("wire", "id", ports, {"a.inport_ior": "theirs"})  # type: ignore[arg-type]
    ours = offered_in(profile, 2, {"a.inport_ior": "ours"})
    assert ours == {"a.inport_ior.2": "ours"}
    found = each_offer(profile.with_properties(ours))
    assert [one.text("a.inport_ior") for one in found] == ["theirs", "ours"]
    assert each_offer(profile) == (profile,)


@pytest.mark.parametrize("key", ["fan_in", "connection_limit"])
def test_limits_of_the_configuration(bench: Bench, key: str) -> None:
    bench.ports["in"].configuration = {key: "0"}
    assert bench.ask("push_flush_out_first")[0] is ReturnCode.PRECONDITION_NOT_MET


def test_the_configuration_of_a_port_yields_to_the_connection(bench: Bench) -> None:
    bench.ports["in"].configuration = {"buffer.length": "5", "buffer.write.full_policy": "block"}
    code, profile = bench.ask("push_flush_out_first", {"dataport.inport.buffer.length": "3"})
    assert code is ReturnCode.RTC_OK
    assert profile.text("dataport.inport.buffer.length") == "3"
    assert profile.text("dataport.inport.buffer.write.full_policy") == "block"
    link = bench.ports["in"].link(profile.connector_id)
    assert link is not None
    assert link.options.buffer.length == 3
    assert link.options.buffer.full_policy.value == "block"


def test_profiles_tell_what_ports_can() -> None:
    pair = Pair()
    profile = pair.out.profile()
    assert profile.properties["port.port_type"] == "DataOutPort"
    assert profile.properties["dataport.subscription_type"] == "block,flush,new,nonblock,periodic"
    assert {"corba_cdr", "direct"} <= set(profile.properties["dataport.interface_type"].split(","))
    assert profile.properties["dataport.dataflow_type"].startswith("push,pull")
    assert pair.in_.profile().properties["dataport.subscription_type"] == "Any"
    assert pair.in_.profile().properties["dataport.data_type"] == "IDL:RTC/TimedLong:1.0"


def test_remarks_on_options_that_are_not_understood(pair: Pair) -> None:
    pair.connect(
        {"dataport.inport.buffer.length": "many", "dataport.inport.buffer.read.empty_policy": "wait"}
    )
    texts = [finding.what for finding in pair.findings]
    assert any("'many' is no number and taken as 8" in text for text in texts)
    assert any("'wait' is unknown and taken as readback" in text for text in texts)


class Elsewhere(DataInPort[TimedLong]):
    """Stands for a port of another process: the other side finds no connector of it here."""

    def link(self, connector_id: str) -> None:
        return None


def test_the_memory_transport_is_what_these_tests_use(memory: MemoryTransport) -> None:
    assert TRANSPORTS.push["corba_cdr"] is memory
