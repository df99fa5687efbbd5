"""Master and slave managers, without an ORB."""

from pathlib import Path

import pytest

from muros.rtc.codes import ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.manager._colleagues import Colleagues
from tests.rtc.manager._worlds import FakeManager, MemoryWorld, manager_in


class Foo(Component): ...


def test_a_slave_reports_to_its_master_and_takes_leave(tmp_path: Path) -> None:
    world = MemoryWorld()
    with manager_in(tmp_path, world) as slave:
        slave.start()
        assert slave.colleagues.masters == ()
        master = world.managers["localhost:2810"] = FakeManager("master")
        slave.colleagues.find_master()
        slave.colleagues.find_master()
        assert master.known_slaves == [("manager", slave)]
        master.known_slaves.clear()  # it has been started anew
        slave.colleagues.find_master()
        assert master.known_slaves == [("manager", slave)]
    assert master.known_slaves == []


def test_a_master_lets_its_slaves_work(tmp_path: Path) -> None:
    with manager_in(tmp_path, manager__is_master="YES") as master:
        master.register(Foo)
        master.start()
        useless, gone, slave = FakeManager("a", makes=False), FakeManager("b"), FakeManager("c")
        gone.gone = True
        for one in (useless, gone, slave):
            assert master.colleagues.add_slave(one) is ReturnCode.RTC_OK
            master.colleagues.add_slave(one)
        assert master.colleagues.slaves == (useless, gone, slave)
        assert master.create("Foo?instance_name=F") == ("made", "Foo?instance_name=F")
        assert master.components == ()
        assert gone not in master.colleagues.slaves
        assert master.create("Foo?manager_name=c&x=y") == ("made", "Foo?x=y")
        assert slave.made == ["Foo?instance_name=F", "Foo?x=y"]
        assert master.colleagues.gather("get_components") == ["get_components of a", "get_components of c"]
        slave.names = {"F"}
        assert master.colleagues.components_by_name("*/F") == ["*/F of c"]
        assert master.create("Foo?instance_name=F") == "*/F of c"
        assert master.colleagues.instance_names() == {"F"}
        assert master.delete_component("F") is ReturnCode.RTC_OK
        assert master.delete_component("F") is ReturnCode.BAD_PARAMETER
        assert master.colleagues.remove_slave(slave) is ReturnCode.RTC_OK
        assert master.colleagues.remove_slave(slave) is ReturnCode.BAD_PARAMETER


def test_a_slave_is_started_where_those_that_came_by_themselves_cannot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every program with components reports to the master, and most have no module but their own."""
    program, started = FakeManager("program", makes=False), FakeManager("started")
    starts: list[str] = []

    def start(colleagues: Colleagues, name: str, language: str) -> FakeManager:
        starts.append(language)
        colleagues.add_slave(started)
        return started

    monkeypatch.setattr(Colleagues, "start", start)
    with manager_in(tmp_path, manager__is_master="YES") as master:
        master.start()
        master.colleagues.add_slave(program)
        assert master.create("Foo") == master.create("Foo") == ("made", "Foo")
        started.makes = False
        with pytest.raises(RtcError, match="none of the 2 slave managers could make Bar; see their logs"):
            master.create("Bar")
        assert starts == ["Python"]
        with pytest.raises(RtcError, match="none of the 1 slave managers could make Bar; see their logs"):
            master.create("Bar?manager_name=program")


def test_a_slave_asks_its_master_for_another_slave(tmp_path: Path) -> None:
    world = MemoryWorld()
    with manager_in(tmp_path, world, manager__shutdown_on_nortcs="NO") as slave:
        slave.register(Foo)
        slave.start()
        with pytest.raises(RtcError, match=r"^Foo[?]manager_name=left: there is no master manager$"):
            slave.create("Foo?manager_name=left")
        master = world.managers["localhost:2810"] = FakeManager("master")
        assert slave.create("Foo?manager_name=left") == ("made", "Foo?manager_name=left")
        assert master.made == ["Foo?manager_name=left"]
        assert slave.components == ()
        slave.create("Foo?manager_name=manager")
        assert len(slave.components) == 1


def test_a_manager_by_its_address(tmp_path: Path) -> None:
    world = MemoryWorld(managers={"host:2811": FakeManager(), "host:2812": FakeManager(makes=False)})
    with manager_in(tmp_path, world) as manager:
        manager.start()
        assert manager.create("Foo?manager_address=host:2811&a=b") == ("made", "Foo?a=b")
        with pytest.raises(RtcError, match="the manager at host:2812 could not make it"):
            manager.create("Foo?manager_address=host:2812")
        with pytest.raises(RtcError, match="no manager at host:1"):
            manager.create("Foo?manager_address=host:1")


def test_a_slave_that_never_comes(tmp_path: Path) -> None:
    texts = {"manager__modules__Python__manager_cmd": "false", "manager__is_master": "YES"}
    with manager_in(tmp_path, None, **texts) as master:
        master.start()
        with pytest.raises(RtcError, match=r"a slave manager was started .* and did not report within"):
            master.create("Foo")
        with pytest.raises(RtcError, match=r"no command starts a manager for Ruby: set manager.modules.Ruby"):
            master.create("RTC:::Foo:Ruby:")
