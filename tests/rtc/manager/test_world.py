"""Managers as processes, over CORBA: names, masters and slaves, clean ends, tools."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from muros.rtc.codes import PeerLostError, ReturnCode, RtcError
from muros.rtc.corba import Orb, RunningNameServer
from muros.rtc.corba._manager import PeerManager
from muros.rtc.corba._naming import NameServer, is_same
from muros.rtc.corba._world import CorbaWorld, _endpoints
from muros.rtc.properties import Properties
from tests.rtc.conftest import find_free_port
from tests.rtc.manager._processes import Managers, wait_until, world_beside

VECTORS = Path(__file__).parents[2] / "vectors" / "rtc"

MODULE = """
from muros.rtc import Component
class Wheel(Component):
    category = "test"
    vendor = "us"
    max_instance = 2
"""


@pytest.fixture
def managers(tmp_path: Path, name_server: RunningNameServer) -> Iterator[Managers]:
    (tmp_path / "Wheel.py").write_text(MODULE)
    with Managers(tmp_path, name_server.address) as made:
        yield made


@pytest.fixture
def world(orb: Orb, name_server: RunningNameServer) -> Iterator[CorbaWorld]:
    """This process's place beside those of `managers`."""
    with world_beside(name_server.address) as made:
        yield made


def test_the_properties_that_tools_ask_for_are_those_of_the_captured_manager(
    managers: Managers, world: CorbaWorld
) -> None:
    managers.start("-d")
    manager = world.manager_at(managers.master_address).reference
    captured: dict[str, Any] = json.loads((VECTORS / "manager_master.json").read_text())
    assert manager.is_master() is captured["is_master"]
    elsewhere = re.compile(
        r"modules\.(C\+\+|Java|Docker)|profile_cmd|nameservers|command|^module\.|^logger\.master|"
        r"^corba\.endpoints_|available_services|^config_file"
    )
    for what, values in (
        ("profile", manager.get_profile().properties),
        ("configuration", manager.get_configuration()),
    ):
        ours = {one.name: one.value.value() for one in values}
        names = {one["name"] for one in captured[what] if not elsewhere.search(one["name"])}
        assert names - set(ours) == set()
        assert all(
            isinstance(value, str) for value in ours.values()
        )  # the real pid is a number: rtmgr -g fails
    assert manager.get_component_profiles() == []
    assert manager.get_service("x") is None


def test_names_and_types_are_those_of_the_captured_tree(
    managers: Managers, orb: Orb, name_server: RunningNameServer
) -> None:
    """Tools go by kinds and types: a host's context, a manager in it, a component in it."""
    managers.start("-d", "-o", "naming.formats:%h.host_cxt/%n.rtc")
    managers.start("-o", "manager.components.precreate:Wheel")
    server = NameServer(orb, name_server.address)
    wait_until(lambda: server.resolve("robot.host_cxt/Wheel0.rtc") is not None)
    (host,) = json.loads((VECTORS / "naming_tree.json").read_text())
    (context,) = server.list()
    assert (context.kind, context.is_context) == (host["kind"], host["type"] == "ncontext")
    types = {one["kind"]: one["type_id"] for one in host["children"]}
    bound = {one.kind: f"{one.name}.{one.kind}" for one in server.list("robot.host_cxt")}
    assert bound == {"mgr": "manager.mgr", "rtc": "Wheel0.rtc"}
    for kind, name in bound.items():
        octets = bytes.fromhex(orb.to_text(server.resolve(f"robot.host_cxt/{name}")).removeprefix("IOR:"))
        assert types[kind].encode() + b"\0" in octets


def test_components_come_and_go_by_corbaloc(managers: Managers, world: CorbaWorld) -> None:
    process = managers.start("-p", str(port := find_free_port()))
    manager = world.manager_at(f"127.0.0.1:{port}")
    (loadable,) = manager.listed("get_loadable_modules")
    assert {one.name: one.value.value() for one in loadable.properties}["implementation_id"] == "Wheel"
    assert manager.listed("get_loaded_modules") == []
    made = manager.create_component("RTC:us:test:Wheel:Python:1.0.0?instance_name=Left&conf.default.a=b")
    assert made is not None
    assert made.get_component_profile().instance_name == "Left"
    assert manager.create_component("Wheel") is not None
    assert manager.create_component("Wheel") is None  # max_instance is 2
    assert manager.instance_names() == {"Left", "Wheel0"}
    assert len(manager.listed("get_loaded_modules")) == 1
    assert len(manager.components_by_name("test/Left")) == 1
    assert manager.delete_component("Nobody") is ReturnCode.BAD_PARAMETER
    assert manager.delete_component("Left") is ReturnCode.RTC_OK
    assert manager.reference.load_module("None.py", "")._v == ReturnCode.RTC_ERROR
    assert manager.reference.unload_module("Wheel.py")._v == ReturnCode.RTC_OK
    assert manager.reference.set_configuration("a.b", "c")._v == ReturnCode.RTC_OK
    assert manager.reference.set_configuration("a.b", "c" * 70_000)._v == ReturnCode.OUT_OF_RESOURCES
    assert manager.reference.fork()._v == ReturnCode.UNSUPPORTED
    assert manager.delete_component("Wheel0") is ReturnCode.RTC_OK
    assert process.wait(20) == 0  # the last component has gone
    with pytest.raises(PeerLostError):
        manager.name()


def test_a_manager_that_is_not_offered_has_components_all_the_same(
    managers: Managers, world: CorbaWorld
) -> None:
    managers.start("-a", "-p", str(port := find_free_port()), "-o", "manager.components.precreate:Wheel")
    wait_until(lambda: world.instance_names() == {"Wheel0"})
    with pytest.raises(PeerLostError, match="OBJECT_NOT_EXIST"):
        world.manager_at(f"127.0.0.1:{port}")
    named = world.orb.to_reference(f"corbaloc:iiop:127.0.0.1:{port}/test.Wheel0")
    assert named._is_a("IDL:omg.org/RTC/RTObject:1.0")


def test_slaves_by_their_names(managers: Managers, world: CorbaWorld) -> None:
    managers.start("-d")
    fast = ("-o", "corba.update_master_manager.interval:0.05")
    for name in ("left", "right"):
        managers.start(*fast, "-o", f"manager.instance_name:{name}")
    master = world.manager_at(managers.master_address)
    wait_until(lambda: len(master.listed("get_slave_managers")) == 2)
    slaves = {one.name(): one for one in map(PeerManager, master.listed("get_slave_managers"))}
    for name, wheel in (("right", "R"), ("left", "L")):
        assert master.create_component(f"Wheel?instance_name={wheel}&manager_name={name}") is not None
        assert slaves[name].instance_names() == {wheel}
    assert slaves["left"].create_component("Wheel?instance_name=S&manager_name=right") is not None
    assert slaves["right"].instance_names() == {"R", "S"}
    assert master.instance_names() == {"L", "R", "S"}
    assert master.create_component("Wheel?instance_name=S") is not None
    assert master.instance_names() == {"L", "R", "S"}


def test_a_master_makes_its_slaves_work(managers: Managers, world: CorbaWorld) -> None:
    """It starts one that it lacks; a slave's component can be deleted through it; all end with it."""
    process = managers.start("-d")
    master = world.manager_at(managers.master_address)
    made = master.create_component("Wheel?manager_name=helper")
    assert made is not None
    (slave,) = [PeerManager(one) for one in master.listed("get_slave_managers")]
    assert slave.name() == "helper"
    assert master.instance_names() == {"Wheel0"}
    assert len(master.listed("get_components")) == 1
    assert len(master.components_by_name("*/Wheel0")) == 1
    assert master.create_component("Wheel") is not None
    assert slave.instance_names() == {"Wheel0", "Wheel1"}
    assert master.delete_component("Wheel1") is ReturnCode.RTC_OK
    process.send_signal(signal.SIGTERM)
    assert process.wait(20) == 0
    wait_until(lambda: not _answers(slave))


def test_master_and_slaves_that_end_at_once_do_not_wait_for_each_other(
    managers: Managers, world: CorbaWorld
) -> None:
    """They do for ever with the real ones."""
    processes = [managers.start("-d")]
    processes += [managers.start("-o", "corba.update_master_manager.interval:0.05") for _ in range(2)]
    master = world.manager_at(managers.master_address)
    wait_until(lambda: len(master.listed("get_slave_managers")) == 2)
    for one in [PeerManager(reference) for reference in master.listed("get_slave_managers")] + [master]:
        assert one.shutdown() is ReturnCode.RTC_OK
    assert [process.wait(20) for process in processes] == [0, 0, 0]


def test_a_slave_finds_a_master_that_comes_later(managers: Managers, world: CorbaWorld) -> None:
    managers.start("-o", "corba.update_master_manager.interval:0.05", "-o", "manager.instance_name:early")
    managers.start("-d")
    master = world.manager_at(managers.master_address)
    wait_until(lambda: len(master.listed("get_slave_managers")) == 1)
    assert PeerManager(master.listed("get_slave_managers")[0]).name() == "early"


def test_two_processes_do_not_take_each_others_names(managers: Managers, world: CorbaWorld) -> None:
    for _ in range(2):
        managers.start("-o", "manager.components.precreate:Wheel", "-o", "naming.formats:%n.rtc")
    wait_until(lambda: world.instance_names() == {"Wheel0", "Wheel1"})


def test_a_name_asked_for_twice_is_bound_when_the_first_has_gone(
    managers: Managers, orb: Orb, name_server: RunningNameServer
) -> None:
    words = ("-o", "manager.components.precreate:Wheel?instance_name=Only", "-o", "naming.formats:%n.rtc")
    first = managers.start(*words)
    server = NameServer(orb, name_server.address)
    wait_until(lambda: server.resolve("Only.rtc") is not None)
    reference = server.resolve("Only.rtc")
    second = managers.start(*words, "-o", "naming.update.interval:0.05")
    managers.wait_for(second, "Only.rtc is not bound")
    now = server.resolve("Only.rtc")
    assert now is not None
    assert now._is_equivalent(reference)
    first.send_signal(signal.SIGINT)
    assert first.wait(20) == 0
    wait_until(lambda: _lives(server.resolve("Only.rtc")))


def test_a_component_that_stands_still_keeps_its_name(
    managers: Managers, orb: Orb, name_server: RunningNameServer
) -> None:
    """As one in a debugger does."""
    words = ("-o", "manager.components.precreate:Wheel", "-o", "naming.formats:%n.rtc")
    first = managers.start(*words)
    server = NameServer(orb, name_server.address)
    wait_until(lambda: server.resolve("Wheel0.rtc") is not None)
    reference = server.resolve("Wheel0.rtc")
    first.send_signal(signal.SIGSTOP)
    try:
        second = managers.start(*words)
        assert "component Wheel1 is there" in managers.said(second)
        assert is_same(server.resolve("Wheel0.rtc"), reference)
    finally:
        first.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_leave_no_zombies(managers: Managers, world: CorbaWorld, number: signal.Signals) -> None:
    process = managers.start("-o", "manager.components.precreate:Wheel, Wheel")
    wait_until(lambda: world.instance_names() == {"Wheel0", "Wheel1"})
    process.send_signal(number)
    assert process.wait(20) == 0
    assert world.instance_names() == set()


def test_names_come_back_after_the_name_server(
    managers: Managers, orb: Orb, name_server: RunningNameServer, tmp_path: Path
) -> None:
    from muros.rtc.corba import start_name_server

    process = managers.start(
        *("-o", "manager.components.precreate:Wheel", "-o", "naming.formats:%n.rtc"),
        *("-o", "naming.update.interval:0.05"),
    )
    server = NameServer(orb, name_server.address)
    wait_until(lambda: server.resolve("Wheel0.rtc") is not None)
    name_server.stop()
    managers.wait_for(process, "name server")
    port = int(name_server.address.rpartition(":")[2])
    with start_name_server(port, folder=tmp_path / "other names"):
        again = NameServer(orb, name_server.address)
        wait_until(lambda: again.resolve("Wheel0.rtc") is not None)


def test_a_name_server_that_comes_after_the_component(managers: Managers, orb: Orb, tmp_path: Path) -> None:
    from muros.rtc.corba import start_name_server

    port = find_free_port()
    managers.start(
        *("-o", "manager.components.precreate:Wheel", "-o", "naming.formats:%n.rtc"),
        *("-o", "naming.update.interval:0.05", "-o", f"corba.nameservers:127.0.0.1:{port}"),
    )
    with start_name_server(port, folder=tmp_path / "late names"):
        server = NameServer(orb, f"127.0.0.1:{port}")
        wait_until(lambda: server.resolve("Wheel0.rtc") is not None)


def test_addresses_of_other_processes(
    managers: Managers, world: CorbaWorld, name_server: RunningNameServer
) -> None:
    managers.start("-p", str(port := find_free_port()), "-o", "manager.components.precreate:Wheel")
    wait_until(lambda: world.instance_names() == {"Wheel0"})
    for address in (
        f"rtcname://{name_server.address}/Wheel0",
        "rtcname://*/Wheel0",
        "rtcname://*/*/Wheel0.rtc",
        f"rtcname://{name_server.address}/robot.host_cxt/Wheel0",
        f"rtcloc://127.0.0.1:{port}/test/Wheel0",
        f"rtcloc://127.0.0.1:{port}/*/Wheel0",
    ):
        world.activate_at(address)
        component = world._component_at(address)
        assert component.get_owned_contexts()[0].get_component_state(component)._v == 2
        component.get_owned_contexts()[0].deactivate_component(component)
    for wrong in ("rtcname://*/Nobody", f"rtcloc://127.0.0.1:{port}/test/Nobody", "ftp://x/y"):
        with pytest.raises(RtcError, match=r"no such component|write rtcname"):
            world.activate_at(wrong)


TALKERS = """
from RTC import TimedLong
from muros.rtc import Component, InPort, OutPort
class Talker(Component):
    out = OutPort(TimedLong)
    def on_execute(self, context):
        self.out.write(7)
    def on_deactivated(self, context):
        print("deactivated", flush=True)
class Listener(Component):
    values = InPort(TimedLong)
    def on_execute(self, context):
        if self.values.is_new():
            print(f"heard {self.values.read().data}", flush=True)
"""


@pytest.mark.parametrize("first", ["Talker", "Listener"])
def test_ports_meet_in_a_topic(managers: Managers, world: CorbaWorld, first: str) -> None:
    """Whoever comes first; one that is in no topic, or in another, stays alone."""
    (managers.folder / "Talkers.py").write_text(TALKERS)
    topics = (
        "-o",
        "port.outport.out.publish_topic:news, weather",
        "-o",
        "port.inport.values.subscribe_topic:news",
    )
    second = "Listener" if first == "Talker" else "Talker"
    processes = {
        name: managers.start(
            *(*topics, "-o", f"manager.components.precreate:{name}"),
            *("-o", f"manager.components.preactivation:{name}0", "-o", "exec_cxt.periodic.rate:50"),
        )
        for name in (first, second)
    }
    managers.wait_for(processes["Listener"], "heard 7")
    server = world._registration.servers[0]
    names = [binding.name for binding in server.list("dataports.port_cxt/news.topic_cxt")]
    assert sorted(names) == ["Listener0.values", "Talker0.out"]
    processes["Talker"].send_signal(signal.SIGTERM)
    processes["Talker"].wait(20)
    names = [binding.name for binding in server.list("dataports.port_cxt/news.topic_cxt")]
    assert names == ["Listener0.values"]
    assert server.list("dataports.port_cxt/weather.topic_cxt") == []


def test_a_composite_with_a_member_in_another_process(managers: Managers, world: CorbaWorld) -> None:
    """Its exported port is there for tools, and goes with the member's process."""
    (managers.folder / "Talkers.py").write_text(TALKERS)
    talker = managers.start("-o", "manager.components.precreate:Talker")
    wait_until(lambda: world.instance_names() == {"Talker0"})
    prefix = "composite.PeriodicECShared.Both.conf.default"
    managers.start(
        *("-o", "manager.components.precreate:PeriodicECSharedComposite?instance_name=Both"),
        *("-o", f"{prefix}.members:Talker0", "-o", f"{prefix}.exported_ports:Talker0.out"),
    )
    wait_until(lambda: world.instance_names() == {"Talker0", "Both"})
    both = world._component_at("rtcname://*/Both")

    def ports() -> list[str]:
        return [one.name for one in both.get_component_profile().port_profiles]

    assert ports() == ["Talker0.out"]
    (context,) = both.get_owned_contexts()
    assert context.activate_component(both)._v == ReturnCode.RTC_OK
    talker.kill()
    wait_until(lambda: ports() == [])
    assert context.deactivate_component(both)._v == ReturnCode.RTC_OK


def test_a_member_outlives_the_process_of_its_composite(managers: Managers, world: CorbaWorld) -> None:
    """Tools ask it for its contexts and organizations, and would fail at those that have gone; it runs by itself."""
    (managers.folder / "Talkers.py").write_text(TALKERS)
    process = managers.start("-o", "manager.components.precreate:Talker")
    wait_until(lambda: world.instance_names() == {"Talker0"})
    composite = managers.start(
        *("-o", "manager.components.precreate:PeriodicECSharedComposite?instance_name=Both"),
        *("-o", "composite.PeriodicECShared.Both.conf.default.members:Talker0"),
    )
    talker = world._component_at("rtcname://*/Talker0")
    (own,) = talker.get_owned_contexts()
    assert (len(talker.get_organizations()), len(talker.get_participating_contexts())) == (1, 1)
    assert not own.is_running()
    (shared,) = talker.get_participating_contexts()
    both = world._component_at("rtcname://*/Both")
    shared.activate_component(both)
    wait_until(lambda: str(shared.get_component_state(talker)) == "ACTIVE_STATE")
    composite.kill()
    wait_until(lambda: not talker.get_participating_contexts())
    managers.wait_for(process, "deactivated")
    assert talker.get_organizations() == []
    assert own.is_running()
    assert own.activate_component(talker)._v == ReturnCode.RTC_OK


def test_a_member_notices_by_itself_that_its_composite_has_gone(
    managers: Managers, world: CorbaWorld
) -> None:
    """No tool asks it for anything after the process was killed."""
    (managers.folder / "Talkers.py").write_text(TALKERS)
    process = managers.start(
        *("-o", "manager.components.precreate:Talker", "-o", "naming.update.interval:0.2")
    )
    wait_until(lambda: world.instance_names() == {"Talker0"})
    composite = managers.start(
        *("-o", "manager.components.precreate:PeriodicECSharedComposite?instance_name=Both"),
        *("-o", "composite.PeriodicECShared.Both.conf.default.members:Talker0"),
    )
    talker = world._component_at("rtcname://*/Talker0")
    (own,) = talker.get_owned_contexts()
    (shared,) = talker.get_participating_contexts()
    shared.activate_component(world._component_at("rtcname://*/Both"))
    wait_until(lambda: str(shared.get_component_state(talker)) == "ACTIVE_STATE")
    composite.kill()
    managers.wait_for(process, "deactivated")
    wait_until(own.is_running)


STUCK = """
import threading
from muros.rtc import Component
class Stuck(Component):
    def on_execute(self, context):
        print("stuck", flush=True)
        threading.Event().wait()
"""


def test_a_component_that_hangs_does_not_hold_up_the_end(managers: Managers, world: CorbaWorld) -> None:
    (managers.folder / "Stuck.py").write_text(STUCK)
    process = managers.start(
        *("-o", "manager.components.precreate:Stuck, Wheel", "-o", "manager.components.preactivation:Stuck0")
    )
    managers.wait_for(process, "stuck")
    process.send_signal(signal.SIGTERM)
    assert process.wait(20) == 0
    assert "Stuck0 does not end: one of its actions has not returned for 1 s" in managers.said(process)
    assert world.instance_names() == set()


def test_a_name_server_that_hangs_does_not_hold_up_the_start(managers: Managers) -> None:
    """It takes connections and says nothing: components are there all the same."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"127.0.0.1:{silent.getsockname()[1]}"
        process = managers.start(
            "-o", f"corba.nameservers:{address}", "-o", "manager.components.precreate:Wheel, Wheel"
        )
        assert "component Wheel1 is there" in managers.said(process)
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (["-x"], 2, "muros: option -x not recognized"),
        (["-f", "none.conf"], 2, r"muros: none.conf \(-f\): no such file"),
        (["extra"], 2, "muros: 'extra' is no option of a manager"),
        (["-o", "logger.log_level:LOUD"], 2, "muros: logger.log_level: there is no 'LOUD'"),
        (["-o", "corba.endpoints:127.0.0.1:http"], 1, "muros: endpoint '127.0.0.1:http' of corba.endpoints"),
        (
            ["-o", "corba.update_master_manager.interval:soon"],
            2,
            "muros: corba.update_master_manager.interval: 'soon' is not a number",
        ),
    ],
)
def test_wrong_use_is_one_line(tmp_path: Path, words: list[str], status: int, message: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "muros", "rtcd", "-o", "logger.enable:NO", "-o", "naming.enable:NO", *words],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=30,
        env={**os.environ, "OMNIORB_CONFIG": os.devnull},
    )
    assert done.returncode == status
    assert re.match(message, done.stderr)
    assert done.stderr.count("\n") == 1


def _answers(manager: PeerManager) -> bool:
    try:
        manager.name()
    except PeerLostError:
        return False
    return True


def _lives(reference: Any) -> bool:
    from omniORB import CORBA

    try:
        return reference is not None and not reference._non_existent()
    except CORBA.Exception:
        return False


@pytest.mark.parametrize(
    ("endpoints", "master", "opened"),
    [
        ("all", "localhost:2815", ":2815"),
        ("127.0.0.1:", "localhost", "127.0.0.1:2810, 127.0.0.1:"),
        ("[::1]", "[::1]", "[::1]:2810, [::1]"),
        ("[::1]:2810", "[::1]:2810/manager", "[::1]:2810"),
    ],
)
def test_a_master_listens_where_slaves_look_for_it(endpoints: str, master: str, opened: str) -> None:
    settings = {"corba.endpoints": endpoints, "corba.master_manager": master, "manager.is_master": "YES"}
    assert _endpoints(Properties(settings)) == opened
