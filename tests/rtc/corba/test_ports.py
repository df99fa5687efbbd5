"""Ports and components over CORBA: requests as the RTC world makes them, and a peer that has none of our code."""

import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from muros.findings import Finding
from muros.rtc import Component, InPort, OutPort, Parameter
from muros.rtc.codes import DataPortStatus
from muros.rtc.corba import NameServer, Objects, Orb, RunningNameServer, _port, set_up
from muros.rtc.corba._conversion import texts_of, to_nv_list
from muros.rtc.corba._lost import asked_again, quick_answer
from muros.rtc.corba._stubs import RTC, OpenRTM, OpenRTM__POA, SDOPackage

WAIT = 10.0


class Source(Component):
    """Gives numbers."""

    out = OutPort(RTC.TimedLong)
    blob = OutPort(RTC.TimedOctetSeq)
    gain = Parameter(1.5, constraint="0<=x<=10")


class Sink(Component):
    """Takes numbers."""

    inp = InPort(RTC.TimedLong)
    blob = InPort(RTC.TimedOctetSeq)


class Pair:
    """A source and a sink of one process, known to the ORB, and their references."""

    def __init__(self, objects: Objects, findings: list[Finding]) -> None:
        self.findings = findings
        self.objects = objects
        self.source, self.sink = Source(), Sink()
        for component, name in ((self.source, "Source0"), (self.sink, "Sink0")):
            component.configure(name, {"exec_cxt.periodic.rate": "100"})
            component.reporter.on_finding(self.findings.append)
            assert component.initialize() == 0
        self.source_ref, self.sink_ref = objects.offer(self.source), objects.offer(self.sink)
        self.out, self.out_blob = self.source_ref.get_ports()
        self.inp, self.in_blob = self.sink_ref.get_ports()

    def close(self) -> None:
        for component in (self.source, self.sink):
            component.exit()
            self.objects.withdraw(component)


@pytest.fixture
def pair(orb: Orb) -> Iterator[Pair]:
    before = set(orb.servants)
    findings: list[Finding] = []
    one = Pair(set_up(orb, report=findings.append), findings)
    yield one
    one.close()
    assert set(orb.servants) == before


def request(*ports: Any, **properties: str) -> Any:
    """A ConnectorProfile; `__` in names is a dot, all begin with `dataport.`."""
    values = {f"dataport.{name.replace('__', '.')}": text for name, text in properties.items()}
    return RTC.ConnectorProfile("test", "", list(ports), to_nv_list(values))


PUSH = {"interface_type": "corba_cdr", "dataflow_type": "push", "subscription_type": "flush"}


def number(value: int) -> Any:
    return RTC.TimedLong(RTC.Time(1, 2), value)


@pytest.mark.parametrize("interface", ["corba_cdr", "data_service", "shared_memory", "direct"])
@pytest.mark.parametrize("in_first", [False, True])
@pytest.mark.parametrize("endian", ["little,big", "big"])
def test_values_are_pushed(pair: Pair, interface: str, in_first: bool, endian: str) -> None:
    ports = [pair.inp, pair.out] if in_first else [pair.out, pair.inp]
    asked = request(*ports, **{**PUSH, "interface_type": interface, "serializer__cdr__endian": endian})
    code, profile = ports[0].connect(asked)
    assert code == RTC.RTC_OK
    for value in (1, -5, 2**31 - 1):
        assert pair.source.out.write(number(value))
        assert pair.sink.inp.read().data == value
    assert [one.connector_id for one in pair.out.get_connector_profiles()] == [profile.connector_id]
    assert pair.inp.get_connector_profile(profile.connector_id).name == "test"
    assert pair.out.disconnect(profile.connector_id) == RTC.RTC_OK
    assert pair.inp.get_connector_profiles() == []
    assert pair.inp.get_connector_profile(profile.connector_id).connector_id == ""
    assert not pair.source.out.write(number(1))
    assert pair.inp.disconnect(profile.connector_id) == RTC.BAD_PARAMETER


@pytest.mark.parametrize("interface", ["corba_cdr", "data_service", "shared_memory"])
@pytest.mark.parametrize("endian", ["little", "big"])
def test_values_are_pulled(pair: Pair, interface: str, endian: str) -> None:
    asked = request(
        pair.inp, pair.out, interface_type=interface, dataflow_type="pull", serializer__cdr__endian=endian
    )
    assert pair.inp.connect(asked)[0] == RTC.RTC_OK
    assert pair.source.out.write(number(7))
    assert pair.sink.inp.read().data == 7
    assert pair.out.disconnect_all() == RTC.RTC_OK


@pytest.mark.parametrize("interface", ["corba_cdr", "data_service", "shared_memory"])
def test_values_of_every_size_are_carried(pair: Pair, interface: str) -> None:
    code, _ = pair.out_blob.connect(
        request(pair.out_blob, pair.in_blob, **{**PUSH, "interface_type": interface})
    )
    assert code == RTC.RTC_OK
    for size in (0, 1, 65536, 3 << 20, 5 << 20, 10):
        octets = bytes([size % 251]) * size
        assert pair.source.blob.write(RTC.TimedOctetSeq(RTC.Time(0, 0), octets))
        assert pair.sink.blob.read().data == octets
    assert pair.in_blob.disconnect_all() == RTC.RTC_OK


def test_nothing_stays_in_shared_memory(pair: Pair) -> None:
    mine = f"muros-{os.getpid()}-*"
    assert not list(Path("/dev/shm").glob(mine))
    code, profile = pair.out_blob.connect(
        request(pair.out_blob, pair.in_blob, **{**PUSH, "interface_type": "shared_memory"})
    )
    assert code == RTC.RTC_OK
    pair.source.blob.write(RTC.TimedOctetSeq(RTC.Time(0, 0), b"x"))
    assert pair.sink.blob.read().data == b"x"
    assert not list(Path("/dev/shm").glob(mine)), "it has no name that would outlive a process that is killed"
    pair.out_blob.disconnect(profile.connector_id)
    assert not list(Path("/dev/shm").glob(mine))


def test_what_a_stranger_says_of_shared_memory_is_checked(orb: Orb, pair: Pair) -> None:
    from omniORB import CORBA

    asked = request(pair.out_blob, pair.in_blob, **{**PUSH, "interface_type": "shared_memory"})
    _, profile = pair.out_blob.connect(asked)
    inlet = orb.to_reference(texts_of(profile.properties)["dataport.corba_cdr.inport_ior"])
    for name, size in (
        ("../../etc/passwd", 100),
        ("", 100),
        ("..", 100),
        ("nobody-made-this", 100),
        ("x", 2**63),
        ("x", 0),
    ):
        with pytest.raises(CORBA.BAD_PARAM):
            inlet.open_memory(size, name)
    assert inlet.put() == OpenRTM.PORT_ERROR
    assert inlet.get() == OpenRTM.PORT_ERROR
    assert {finding.code for finding in pair.findings} == {"shared-memory-failed"}
    pair.out_blob.disconnect(profile.connector_id)


def test_requests_that_cannot_be_are_answered(pair: Pair) -> None:
    assert pair.out.connect(request(pair.out, pair.inp))[0] == RTC.BAD_PARAMETER
    assert pair.out.connect(RTC.ConnectorProfile("nil", "", [pair.out, None], []))[0] == RTC.BAD_PARAMETER
    assert pair.out.notify_connect(RTC.ConnectorProfile("nil", "x", [None], []))[0] == RTC.BAD_PARAMETER
    assert [finding.code for finding in pair.findings[-2:]] == ["request-refused"] * 2
    assert pair.out.connect(request(pair.out, pair.out, **PUSH))[0] == RTC.BAD_PARAMETER
    assert pair.out.connect(request(pair.out, pair.in_blob, **PUSH))[0] != RTC.RTC_OK
    assert pair.out.notify_disconnect("nobody") == RTC.BAD_PARAMETER
    for side in (pair.out, pair.inp, pair.in_blob):
        assert side.get_connector_profiles() == []


def test_properties_of_other_kinds_are_texts(pair: Pair) -> None:
    from omniORB import any as any_values

    asked = request(pair.out, pair.inp, **PUSH)
    asked.properties += [
        SDOPackage.NameValue("dataport.inport.buffer.length", any_values.to_any(3)),
        SDOPackage.NameValue("dataport.flag", any_values.to_any(True)),
        SDOPackage.NameValue("dataport.list", any_values.to_any(["a"])),
        SDOPackage.NameValue("dataport.flag", any_values.to_any(False)),
    ]
    code, profile = pair.out.connect(asked)
    assert code == RTC.RTC_OK
    texts = texts_of(profile.properties)
    assert texts["dataport.inport.buffer.length"] == "3"
    assert texts["dataport.flag"] in ("NO", "0", "False")
    pair.out.disconnect(profile.connector_id)


def test_a_component_is_described_as_tools_expect(orb: Orb, pair: Pair) -> None:
    profile = pair.source_ref.get_component_profile()
    assert (profile.instance_name, profile.type_name, profile.category) == ("Source0", "Source", "Generic")
    assert [one.name for one in profile.port_profiles] == ["Source0.out", "Source0.blob"]
    properties = texts_of(profile.port_profiles[0].properties)
    assert properties["port.port_type"] == "DataOutPort"
    assert properties["dataport.data_type"] == properties["data_type"] == "IDL:RTC/TimedLong:1.0"
    assert "new" in properties["dataport.subscription_type"].split(",")
    for name in ("corba_cdr", "data_service", "direct", "shared_memory"):
        assert name in properties["dataport.interface_type"].split(",")
    assert texts_of(pair.inp.get_port_profile().properties)["dataport.subscription_type"].lower() == "any"
    assert profile.port_profiles[0].owner._is_equivalent(pair.source_ref)
    assert profile.port_profiles[0].port_ref._is_equivalent(pair.out)
    assert profile.parent is None
    assert pair.source_ref.get_sdo_id() == "Source0"
    assert pair.source_ref.get_sdo_type() == "Gives numbers."
    assert pair.source_ref.get_device_profile().device_type == ""
    assert pair.source_ref.get_status_list() == []
    assert pair.source_ref.get_organizations() == pair.source_ref.get_owned_organizations() == []
    assert pair.source_ref.get_service_profiles() == []
    with pytest.raises(SDOPackage.InterfaceNotImplemented):
        pair.source_ref.get_monitoring()
    for operation in (
        pair.source_ref.get_sdo_service,
        pair.source_ref.get_service_profile,
        pair.source_ref.get_status,
    ):
        with pytest.raises(SDOPackage.InvalidParameter):
            operation("nothing")


def test_the_life_of_a_component_is_led_from_outside(pair: Pair) -> None:
    component = pair.source_ref
    (context,) = component.get_owned_contexts()
    assert component.get_participating_contexts() == []
    assert context._narrow(RTC.ExecutionContextService) is not None
    assert context._narrow(OpenRTM.ExtTrigExecutionContextService) is None
    assert component.get_context_handle(context) == 0
    assert component.get_context(0)._is_equivalent(context)
    assert component.get_context(5) is None
    assert component.is_alive(context)
    assert not pair.sink_ref.is_alive(context)
    assert context.is_running()
    assert context.get_kind() == RTC.PERIODIC
    assert context.get_rate() == 100.0
    profile = context.get_profile()
    assert profile.owner._is_equivalent(component)
    assert profile.participants == []
    assert texts_of(profile.properties)["type"] == "PeriodicExecutionContext"
    assert context.get_component_state(component) == RTC.INACTIVE_STATE
    assert context.get_component_state(pair.sink_ref) == RTC.CREATED_STATE
    assert context.get_component_state(None) == RTC.CREATED_STATE
    assert context.activate_component(component) == RTC.RTC_OK
    assert context.activate_component(component) == RTC.PRECONDITION_NOT_MET
    assert context.get_component_state(component) == RTC.ACTIVE_STATE
    assert context.reset_component(component) == RTC.PRECONDITION_NOT_MET
    assert context.deactivate_component(component) == RTC.RTC_OK
    assert context.activate_component(pair.sink_ref) == RTC.BAD_PARAMETER
    assert context.activate_component(None) == RTC.BAD_PARAMETER
    assert context.set_rate(50.0) == RTC.RTC_OK
    assert context.set_rate(-1.0) == RTC.BAD_PARAMETER
    assert context.stop() == RTC.RTC_OK
    assert not context.is_running()
    assert context.start() == RTC.RTC_OK
    assert context.add_component(pair.sink_ref) == RTC.RTC_OK
    (participating,) = pair.sink_ref.get_participating_contexts()
    assert participating._is_equivalent(context)
    assert pair.sink_ref.get_context_handle(context) == 1000
    assert [one._is_equivalent(pair.sink_ref) for one in context.get_profile().participants] == [True]
    assert pair.sink_ref.finalize() == RTC.PRECONDITION_NOT_MET
    assert context.remove_component(pair.sink_ref) == RTC.RTC_OK
    assert (
        component.initialize()
        == component.on_initialize()
        == component.on_finalize()
        == RTC.PRECONDITION_NOT_MET
    )
    assert component.on_execute(77) == RTC.BAD_PARAMETER
    assert component.exit() == RTC.RTC_OK
    assert component.exit() == RTC.PRECONDITION_NOT_MET
    assert not component.is_alive(context)


def test_a_component_named_by_its_key_is_the_same(orb: Orb, pair: Pair) -> None:
    """Whoever got it by corbaloc activates the component that the context knows."""
    component = Source()
    component.configure("Keyed0", {})
    assert component.initialize() == 0
    reference = pair.objects.offer(component, "Generic.Keyed0")
    try:
        octets = bytes.fromhex(orb.to_text(reference)[4:])
        place = octets.index(b"127.0.0.1\0") + 10
        port = int.from_bytes(octets[place : place + 2], "little")
        by_key = orb.to_reference(f"corbaloc::127.0.0.1:{port}/Generic.Keyed0")._narrow(RTC.RTObject)
        (context,) = by_key.get_owned_contexts()
        assert context.activate_component(by_key) == RTC.RTC_OK
        assert context.get_component_state(reference) == RTC.ACTIVE_STATE
    finally:
        component.exit()
        pair.objects.withdraw(component)


def test_a_triggered_context_is_ticked(orb: Orb) -> None:
    objects = set_up(orb)
    calls = queue.Queue[int]()

    class Ticked(Component):
        def on_execute(self, context: int) -> None:
            calls.put(context)

    component = Ticked()
    component.configure("Ticked0", {"exec_cxt.periodic.type": "ExtTrigExecutionContext"})
    assert component.initialize() == 0
    reference = objects.offer(component)
    try:
        context = reference.get_owned_contexts()[0]._narrow(OpenRTM.ExtTrigExecutionContextService)
        assert context.activate_component(reference) == RTC.RTC_OK
        context.tick()
        assert calls.get(timeout=WAIT) == 0
    finally:
        component.exit()
        objects.withdraw(component)


def test_configuration_sets_are_listed_changed_and_activated(pair: Pair) -> None:
    configuration = pair.source_ref.get_configuration()
    assert configuration._is_equivalent(pair.source_ref.get_configuration())
    sets = {one.id: texts_of(one.configuration_data) for one in configuration.get_configuration_sets()}
    assert sets["default"] == {"gain": "1.5"}
    assert sets["__constraints__"] == {"gain": "0<=x<=10"}
    new = SDOPackage.ConfigurationSet("default", "", to_nv_list({"gain": "2.5"}))
    assert configuration.set_configuration_set_values(new)
    with pytest.raises(SDOPackage.NotAvailable):
        configuration.get_active_configuration_set()
    assert configuration.activate_configuration_set("default")
    assert texts_of(configuration.get_active_configuration_set().configuration_data) == {"gain": "2.5"}
    assert configuration.add_configuration_set(
        SDOPackage.ConfigurationSet("fast", "", to_nv_list({"gain": "9"}))
    )
    assert configuration.activate_configuration_set("fast")
    context = pair.source_ref.get_owned_contexts()[0]
    context.activate_component(pair.source_ref)
    assert pair.source.gain == 9.0
    assert configuration.get_configuration_parameter_value("gain").value() == "9"
    with pytest.raises(SDOPackage.InvalidParameter):
        configuration.get_configuration_parameter_value("nothing")
    assert configuration.set_configuration_parameter("gain", to_nv_list({"gain": "3"})[0].value)
    assert texts_of(configuration.get_active_configuration_set().configuration_data) == {"gain": "3"}
    with pytest.raises(SDOPackage.InvalidParameter):
        configuration.set_configuration_parameter("nothing", to_nv_list({"x": "3"})[0].value)
    assert configuration.activate_configuration_set("default")
    assert configuration.remove_configuration_set("fast")
    assert not configuration.remove_configuration_set("default")
    assert not configuration.set_configuration_set_values(SDOPackage.ConfigurationSet("none", "", []))
    for wrong in ("none", ""):
        with pytest.raises(SDOPackage.InternalError):
            configuration.get_configuration_set(wrong)
    with pytest.raises(SDOPackage.InternalError):
        configuration.activate_configuration_set("none")
    with pytest.raises(SDOPackage.InvalidParameter):
        configuration.activate_configuration_set("")
    assert (
        configuration.get_configuration_parameters()
        == configuration.get_configuration_parameter_values()
        == []
    )


def test_ports_come_and_go(orb: Orb, pair: Pair) -> None:
    from omniORB import CORBA

    pair.sink.remove_port(pair.sink.ports[1])
    assert len(pair.sink_ref.get_ports()) == 1
    with pytest.raises(CORBA.OBJECT_NOT_EXIST):
        pair.in_blob.get_port_profile()


def test_nothing_grows_with_connections(orb: Orb, pair: Pair) -> None:
    def connect_and_end(interface: str) -> None:
        asked = request(
            pair.out, pair.inp, **{**PUSH, "interface_type": interface, "subscription_type": "new"}
        )
        code, profile = pair.out.connect(asked)
        assert code == RTC.RTC_OK
        pair.source.out.write(number(1))
        assert pair.inp.disconnect(profile.connector_id) == RTC.RTC_OK

    for interface in ("corba_cdr", "shared_memory"):
        connect_and_end(interface)
    before = len(orb.servants), threading.active_count(), len(os.listdir("/proc/self/fd"))
    for number_of in range(60):
        connect_and_end(("corba_cdr", "shared_memory", "data_service")[number_of % 3])
    after = len(orb.servants), threading.active_count(), len(os.listdir("/proc/self/fd"))
    assert all(now <= then + 1 for now, then in zip(after, before, strict=True)), (before, after)


def test_who_has_ended_does_not_come_back_by_being_mentioned(orb: Orb, pair: Pair) -> None:
    port, component = pair.sink.ports[0], pair.sink
    pair.sink.exit()
    pair.objects.withdraw(pair.sink)
    assert pair.objects.port(port)._is_equivalent(pair.inp)
    assert pair.objects.port(port)._non_existent()
    assert pair.objects.component(component)._non_existent()


class Watcher(OpenRTM__POA.ComponentObserver):  # type: ignore[misc]
    def __init__(self) -> None:
        self.heard = queue.Queue[tuple[str, str]]()

    def update_status(self, status_kind: Any, hint: str) -> None:
        self.heard.put((str(status_kind), hint))


def test_observers_are_told(orb: Orb, pair: Pair) -> None:
    watcher = Watcher()
    reference = orb.activate(watcher)
    configuration = pair.source_ref.get_configuration()
    kind = "IDL:OpenRTM/ComponentObserver:1.0"
    properties = to_nv_list({"observed_status": "RTC_STATUS,PORT_PROFILE"})
    try:
        for wrong in (
            SDOPackage.ServiceProfile("a", "IDL:Nothing:1.0", properties, reference),
            SDOPackage.ServiceProfile("a", kind, properties, None),
            SDOPackage.ServiceProfile("a", kind, properties, pair.out),
            SDOPackage.ServiceProfile(
                "a", kind, to_nv_list({"heartbeat.enable": "YES", "heartbeat.interval": "x"}), reference
            ),
            SDOPackage.ServiceProfile("a", kind, properties, orb.to_reference("corbaloc::127.0.0.1:1/x")),
        ):
            assert not configuration.add_service_profile(wrong)
        assert configuration.add_service_profile(SDOPackage.ServiceProfile("a", kind, properties, reference))
        context = pair.source_ref.get_owned_contexts()[0]
        context.activate_component(pair.source_ref)
        assert watcher.heard.get(timeout=WAIT) == ("RTC_STATUS", "ACTIVE:0")
        _, profile = pair.out.connect(request(pair.out, pair.inp, **PUSH))
        status, hint = watcher.heard.get(timeout=WAIT)
        assert (status, hint.partition(":")[0]) == ("PORT_PROFILE", "CONNECT")
        assert configuration.remove_service_profile("a")
        assert not configuration.remove_service_profile("a")
        pair.out.disconnect(profile.connector_id)
        assert watcher.heard.empty()
    finally:
        orb.deactivate(watcher)


# ---- a peer without our code


class Foreign:
    """The program of programs/foreign.py, and what it says."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.lines = queue.Queue[str]()
        threading.Thread(target=self._read, daemon=True).start()
        assert self.line() == "ready"

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line.strip())

    def line(self) -> str:
        return self.lines.get(timeout=WAIT)

    def until(self, wanted: str) -> None:
        while self.line() != wanted:
            pass

    def write(self, value: int) -> None:
        assert self.process.stdin is not None
        print(value, file=self.process.stdin, flush=True)


Start = Callable[[str], tuple[Foreign, Any]]


@pytest.fixture
def start(orb: Orb, name_server: RunningNameServer) -> Iterator[Start]:
    """Starts foreign components by name: the program, and the reference to its component."""
    started: list[subprocess.Popen[str]] = []

    def run(name: str) -> tuple[Foreign, Any]:
        program = Path(__file__).parents[1] / "programs" / "foreign.py"
        process = subprocess.Popen(
            [sys.executable, str(program), name_server.address, name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        foreign = Foreign(process)
        reference = NameServer(orb, name_server.address).resolve(f"{name}.rtc")
        assert not asked_again(reference._non_existent)  # type: ignore[union-attr]  # its port may be an earlier one's
        return foreign, reference

    yield run
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("ours_first", [True, False])
@pytest.mark.parametrize("asked_at_ours", [True, False])
def test_a_foreign_component_connects_in_both_roles(
    pair: Pair, start: Start, ours_first: bool, asked_at_ours: bool
) -> None:
    foreign, reference = start("Foreign0")
    their_in, their_out = reference.get_ports()
    for ours, theirs in ((pair.out, their_in), (pair.inp, their_out)):
        ports = [ours, theirs] if ours_first else [theirs, ours]
        code, profile = (ours if asked_at_ours else theirs).connect(request(*ports, **PUSH))
        assert code == RTC.RTC_OK
        assert len(profile.connector_id) == 36
    assert pair.source.out.write(number(41))
    assert foreign.line() == "value 41"
    foreign.write(42)
    assert foreign.line() == "status PORT_OK"
    assert pair.sink.inp.read().data == 42
    for ours, theirs in ((pair.out, their_in), (pair.inp, their_out)):
        (profile,) = theirs.get_connector_profiles()
        assert (ours if asked_at_ours else theirs).disconnect(profile.connector_id) == RTC.RTC_OK
        assert ours.get_connector_profiles() == theirs.get_connector_profiles() == []


def test_a_foreign_component_that_ends_is_forgotten(pair: Pair, start: Start) -> None:
    foreign, reference = start("Foreign0")
    their_in, their_out = reference.get_ports()
    assert pair.out.connect(request(pair.out, their_in, **PUSH))[0] == RTC.RTC_OK
    assert pair.inp.connect(request(pair.inp, their_out, **PUSH))[0] == RTC.RTC_OK
    assert pair.source.out.write(number(1))
    foreign.process.kill()
    foreign.process.wait()
    assert not pair.source.out.write(number(2))
    assert pair.source.out.status[0] is DataPortStatus.CONNECTION_LOST
    assert pair.out.get_connector_profiles() == []
    assert pair.inp.get_port_profile().connector_profiles == []
    assert pair.out.connect(request(pair.out, their_in, **PUSH))[0] != RTC.RTC_OK
    assert pair.inp.connect(request(pair.inp, their_out, **PUSH))[0] != RTC.RTC_OK
    assert pair.out.get_connector_profiles() == pair.inp.get_connector_profiles() == []


def halt(foreign: Foreign) -> None:
    """Stop a process, and wait until it stands still."""
    foreign.process.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, foreign.process.pid, os.WSTOPPED)


def test_a_peer_that_stands_still_keeps_its_connections_for_some_time(
    pair: Pair, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who looks at connections does not end those of a process that is only slow."""
    seconds = 0.2
    monkeypatch.setattr(_port, "quick_answer", lambda: quick_answer(seconds))
    foreign, reference = start("Foreign0")
    _, their_out = reference.get_ports()
    assert pair.inp.connect(request(pair.inp, their_out, **PUSH))[0] == RTC.RTC_OK
    halt(foreign)
    for _ in range(_port.PATIENCE - 1):
        assert len(pair.inp.get_connector_profiles()) == 1
    foreign.process.send_signal(signal.SIGCONT)
    foreign.write(3)
    assert foreign.line() == "status PORT_OK"
    seconds = 10.0  # it answers, however slow the machine is
    assert len(pair.inp.get_connector_profiles()) == 1
    seconds = 0.2
    halt(foreign)
    for _ in range(_port.PATIENCE):
        pair.inp.get_connector_profiles()
    assert pair.sink.ports[0].connectors == ()


def test_our_context_runs_a_foreign_component(pair: Pair, start: Start) -> None:
    foreign, reference = start("Foreign0")
    context = pair.source_ref.get_owned_contexts()[0]
    assert context.add_component(reference) == RTC.RTC_OK
    assert context.add_component(reference) == RTC.PRECONDITION_NOT_MET
    assert foreign.line() == "on_startup 1000"
    assert context.get_component_state(reference) == RTC.INACTIVE_STATE
    assert context.activate_component(reference) == RTC.RTC_OK
    assert foreign.line() == "on_activated 1000"
    assert foreign.line() == "on_execute 1000"
    assert foreign.line() == "on_state_update 1000"
    assert context.get_profile().participants[0]._is_equivalent(reference)
    assert context.deactivate_component(reference) == RTC.RTC_OK
    assert context.remove_component(reference) == RTC.RTC_OK
    foreign.until("detach_context 1000")
    assert context.add_component(reference) == RTC.RTC_OK
    assert context.activate_component(reference) == RTC.RTC_OK
    foreign.process.kill()
    foreign.process.wait()
    for _ in range(100):
        if context.get_component_state(reference) == RTC.CREATED_STATE:
            break
        threading.Event().wait(0.05)
    assert context.get_profile().participants == []
    assert "rtc-member-lost" in {finding.code for finding in pair.findings}
