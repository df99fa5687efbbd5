"""The RTC world's own tools on components of ours: every command that works with the real ones."""

import re
from collections.abc import Iterator

import pytest

from muros.rtc.corba import Orb, RunningNameServer
from tests.rtc.corba._world import World

pytest.importorskip("rtshell")


@pytest.fixture(scope="module")
def world(
    orb: Orb, shared_name_server: RunningNameServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[World]:
    one = World(orb, shared_name_server, tmp_path_factory.mktemp("tools"))
    yield one
    assert one.process.end() == 0, one.process.said


def test_listing(world: World) -> None:
    assert "test.host_cxt" in world.run("rtls", f"{world.root}/")
    listed = world.run("rtls", "-lR", f"{world.root}/")
    assert re.search(r"Inactive +1/0 +0/0 +1/0 +0/0 +Giver0\.rtc", listed)
    assert re.search(r"Inactive +1/0 +1/0 +0/0 +0/0 +Taker0\.rtc", listed)
    assert "Giver0.rtc" in world.run("rtfind", "-t", "c", f"{world.root}/")
    world.run("rtpwd")


def test_a_component_in_all_detail(world: World) -> None:
    text = world.run("rtcat", "-lll", world.giver)
    for line in (
        r"Giver0\.rtc +Inactive",
        r"Category +test",
        r"Description +Gives numbers\.",
        r"Type +Monolithic",
        r"State +Running",
        r"Kind +Periodic",
        r"Rate +50\.0",
        r"Owner +Giver0",
        r"-DataOutPort: out",
        r"dataport\.data_type +IDL:RTC/TimedLong:1\.0",
        r"port\.port_type +DataOutPort",
    ):
        assert re.search(line, text), line
    assert "-DataInPort: inp" in world.run("rtcat", "-ll", world.taker)


@pytest.mark.parametrize(
    "properties",
    [
        [],
        ["dataport.subscription_type=flush"],
        ["dataport.subscription_type=periodic", "dataport.push_rate=100"],
        ["dataport.subscription_type=new", "dataport.publisher.push_policy=all"],
        ["dataport.interface_type=data_service"],
        ["dataport.interface_type=shared_memory", "dataport.subscription_type=flush"],
        ["dataport.interface_type=direct", "dataport.subscription_type=flush"],
        ["dataport.interface_type=csp_channel", "dataport.dataflow_type=duplex"],
        ["dataport.serializer.cdr.endian=big,little"],
    ],
    ids=lambda words: ",".join(words) or "default",
)
def test_connecting_and_running(world: World, properties: list[str]) -> None:
    options = [word for one in properties for word in ("-p", one)]
    world.run("rtcon", "-n", "line", *options, f"{world.giver}:out", f"{world.taker}:inp")
    try:
        assert re.search(r"Inactive +1/1 +0/0 +1/1 +0/0 +Giver0\.rtc", world.run("rtls", "-l", world.giver))
        world.process.forget()
        world.run("rtact", world.giver, world.taker)
        world.process.until(r"got \d+")
        assert world.state(world.giver) == "Active"
    finally:
        world.run("rtdeact", world.giver, world.taker)
        world.run("rtdis", f"{world.giver}:out")
    assert world.state(world.giver) == "Inactive"
    assert re.search(r"1/0 +0/0 +1/0", world.run("rtls", "-l", world.giver))


def test_connecting_from_the_inport_with_an_id(world: World) -> None:
    world.run("rtcon", "-i", "my-id", f"{world.taker}:inp", f"{world.giver}:out")
    assert "my-id" in world.run("rtcat", "-lll", world.taker)
    world.run("rtdis", f"{world.taker}:inp")
    assert "my-id" not in world.run("rtcat", "-lll", world.giver)


def test_connections_that_cannot_be(world: World) -> None:
    text = world.run(
        "rtcon", "-p", "dataport.interface_type=smoke", f"{world.giver}:out", f"{world.taker}:inp", status=1
    )
    assert "Incompatible connection properties" in text
    assert world.run("rtcon", f"{world.giver}:none", f"{world.taker}:inp", status=1)


def test_parameters(world: World) -> None:
    assert "default" in world.run("rtconf", world.giver, "list")
    assert world.run("rtconf", world.giver, "get", "step").strip() == "1"
    world.run("rtconf", world.giver, "set", "step", "5")
    assert world.run("rtconf", world.giver, "get", "step").strip() == "5"
    world.run("rtconf", "-s", "default", world.giver, "set", "step", "1")
    assert "step" in world.run("rtconf", "-l", world.giver, "list")
    assert "__widget__" in world.run("rtconf", "-a", world.giver, "list")
    world.run("rtconf", "-s", "default", world.giver, "act")


def test_an_error_and_its_reset(world: World) -> None:
    world.run("rtconf", world.giver, "set", "fails", "1")
    world.run("rtact", world.giver)
    world.until(lambda: world.state(world.giver) == "Error")
    world.run("rtconf", world.giver, "set", "fails", "0")
    world.process.forget()
    world.run("rtreset", world.giver)
    world.process.until("reset")
    assert world.state(world.giver) == "Inactive"


def test_a_system_is_kept_taken_down_and_brought_back(world: World) -> None:
    world.run("rtcon", "-p", "dataport.subscription_type=flush", f"{world.giver}:out", f"{world.taker}:inp")
    world.run("rtconf", world.giver, "set", "step", "3")
    world.run("rtcryo", "-o", "system.rtsys", world.root[1:])
    kept = (world.folder / "system.rtsys").read_text()
    assert "Giver0" in kept
    assert "flush" in kept
    world.run("rtteardown", "system.rtsys")
    assert re.search(r"1/0 +0/0 +1/0", world.run("rtls", "-l", world.giver))
    world.run("rtconf", world.giver, "set", "step", "1")
    world.run("rtresurrect", "system.rtsys")
    assert re.search(r"1/1 +0/0 +1/1", world.run("rtls", "-l", world.giver))
    assert world.run("rtconf", world.giver, "get", "step").strip() == "3"
    world.process.forget()
    world.run("rtstart", "system.rtsys")
    world.process.until(r"got \d+")
    world.run("rtstop", "system.rtsys")
    assert world.state(world.giver) == "Inactive"
    world.run("rtteardown", "system.rtsys")


def test_a_state_machine(world: World) -> None:
    """rtfsm finds nobody to ask in the real package."""
    door = f"{world.root}/test.host_cxt/Door0.rtc"
    world.run("rtact", door)
    world.until(lambda: world.run("rtfsm", door, "getstate").strip() == "Closed")
    assert "turn" in world.run("rtfsm", door, "geteventprofiles")
    assert '<transition event="turn"' in world.run("rtfsm", door, "getstructure")
    world.run("rtdeact", door)


def test_a_page_about_a_component(world: World) -> None:
    text = world.run("rtdoc", "-f", "rst", world.giver)
    assert '"out", "DataOutPort"' in text
    assert '"step"' in text


def test_ending_and_clearing_away(world: World) -> None:
    world.run("rtexit", world.taker)
    world.until(lambda: world.server.resolve("test.host_cxt/Taker0.rtc") is None)
    world.process.end(kill=True)
    assert re.search(r"\*Giver0\.rtc|Zombie", world.run("rtls", "-l", f"{world.root}/test.host_cxt"))
    world.run("rtdel", "-z")
    assert "Giver0" not in world.run("rtls", f"{world.root}/test.host_cxt")
    world.process = world.start()
    world.run("rtdel", world.giver)
    assert world.server.resolve("test.host_cxt/Giver0.rtc") is None
    assert world.is_there("Taker0")
