"""Programs that find components and work them: addresses, names, and what comes where something is not there."""

from __future__ import annotations

from typing import Any

import pytest

import OpenRTM_aist as rtm
import RTC
from muros.rtc.corba import RunningNameServer
from OpenRTM_aist import CORBA_RTCUtil as util
from tests.rtc.conftest import find_free_port
from tests.rtc.shim.stage import COMPONENTS, Stage
from tests.rtc.shim.test_in_one_process import Plain, Ports, make


class TestAddresses:
    def test_at_a_name_server(self, manager: rtm.Manager, name_server: RunningNameServer) -> None:
        plain, ports = make(manager, Plain), make(manager, Ports)
        names = rtm.CorbaNaming(manager.getORB(), name_server.address)
        assert names.isAlive()
        names.bindByString("robot.host_cxt/arm.cxt/Plain0.rtc", plain.getObjRef())
        names.rebind("Ports0.rtc", ports.getObjRef())
        naming = manager.getNaming()
        for path in (
            "robot.host_cxt/arm.cxt/Plain0",
            "robot.host_cxt/arm.cxt/Plain0.rtc",
            "*/Plain0",
            "Plain0",
        ):
            (found,) = naming.string_to_component(f"rtcname://{name_server.address}/{path}")
            assert found._is_equivalent(plain.getObjRef()), path
        for path in ("robot.host_cxt/Plain0", "*/Plain1", "arm.cxt/Plain0", ""):
            assert naming.string_to_component(f"rtcname://{name_server.address}/{path}") == []
        port = util.get_port_by_url(f"rtcname://{name_server.address}/Ports0.out")
        assert port._is_equivalent(ports.out.getPortRef())
        assert util.get_port_by_url(f"rtcname://{name_server.address}/Ports0.up") is None

    def test_what_is_bound_and_has_ended_or_is_no_component(
        self, manager: rtm.Manager, name_server: RunningNameServer
    ) -> None:
        plain, ports = make(manager, Plain), make(manager, Ports)
        names = rtm.CorbaNaming(manager.getORB(), name_server.address)
        names.bind("Plain0.rtc", plain.getObjRef())
        names.bind("Port0.rtc", ports.out.getPortRef())
        manager.deleteComponent("Plain0")
        for name in ("Plain0", "Port0"):
            assert manager.getNaming().string_to_component(f"rtcname://{name_server.address}/{name}") == []

    def test_in_contexts_that_go_in_a_circle(
        self, manager: rtm.Manager, name_server: RunningNameServer
    ) -> None:
        plain = make(manager, Plain)
        names = rtm.CorbaNaming(manager.getORB(), name_server.address)
        inner = names.bindNewContext("a.host_cxt/b.cxt")
        names.bindContext("a.host_cxt/b.cxt/back.cxt", names.getRootContext())
        names.bindContext("self.cxt", inner)
        names.bind("a.host_cxt/b.cxt/Plain0.rtc", plain.getObjRef())
        (found,) = manager.getNaming().string_to_component(f"rtcname://{name_server.address}/*/Plain0")
        assert found._is_equivalent(plain.getObjRef())
        assert manager.getNaming().string_to_component(f"rtcname://{name_server.address}/*/Plain1") == []

    def test_among_many(self, manager: rtm.Manager, name_server: RunningNameServer) -> None:
        plain = make(manager, Plain)
        names = rtm.CorbaNaming(manager.getORB(), name_server.address)
        for number in range(450):
            names.bind(f"many.host_cxt/Plain{number}.rtc", plain.getObjRef(), number == 0)
        assert len(names.listByKind("many.host_cxt", "rtc")) == 450
        assert (
            len(manager.getNaming().string_to_component(f"rtcname://{name_server.address}/*/Plain449")) == 1
        )

    def test_where_nobody_is(self, manager: rtm.Manager) -> None:
        naming, nobody = manager.getNaming(), f"127.0.0.1:{find_free_port()}"
        for address in (
            f"rtcname://{nobody}/Plain0",
            f"rtcname://{nobody}/*/Plain0",
            f"rtcloc://{nobody}/tests/Plain0",
            "rtcname://no port:x/Plain0",
            "rtcname://*/Plain0.rtc/.",
            "http://127.0.0.1/Plain0",
            "Plain0",
            "",
        ):
            assert naming.string_to_component(address) == []

    def test_at_a_manager(self, manager: rtm.Manager, stage: Stage) -> None:
        place = f"127.0.0.1:{find_free_port()}"
        options = (
            f"corba.endpoints:{place}",
            f"manager.modules.load_path:{COMPONENTS}",
            "manager.modules.preload:ConsoleOut.py",
            "manager.components.precreate:ConsoleOut",
        )
        stage.muros("rtcd", *(word for option in options for word in ("-o", option)))
        there = stage.component("ConsoleOut0")
        naming = manager.getNaming()
        (found,) = naming.string_to_component(f"rtcloc://{place}/example/ConsoleOut0")
        assert found._is_equivalent(there)
        assert naming.string_to_component(f"rtcloc://{place}/example/ConsoleOut1") == []
        assert util.get_port_by_url(f"rtcloc://{place}/example/ConsoleOut0.in") is not None

    def test_more_names(self, manager: rtm.Manager, stage: Stage) -> None:
        """A manager that has a name server gives it names that programs ask for."""
        stage.python("ConsoleOut")
        stage.component("ConsoleOut0")
        names = rtm.CorbaNaming(manager.getORB(), stage.names)
        context = names.bindNewContext("robot.host_cxt/arm.cxt")
        assert names.listByKind("robot.host_cxt", "cxt")[0].binding_name[0].id == "arm"
        assert names.listByKind("robot.host_cxt", "rtc") == []
        assert names.listByKind("nobody.host_cxt", "rtc") == []
        names.unbind("robot.host_cxt/arm.cxt")
        names.destroy(context)
        names.rebindContext("second.host_cxt", names.newContext())
        assert names.toString(names.toName("second.host_cxt/Plain0.rtc")) == "second.host_cxt/Plain0.rtc"
        assert not rtm.CorbaNaming(manager.getORB()).isAlive()


class TestComponents:
    def test_contexts_and_their_handles(self, manager: rtm.Manager) -> None:
        one, two = make(manager, Plain).getObjRef(), make(manager, Ports).getObjRef()
        assert util.is_existing(one)
        assert util.is_alive_in_default_ec(one)
        assert util.is_in_inactive(one)
        assert util.add_rtc_to_default_ec(one, two) == RTC.RTC_OK
        context = util.get_actual_ec(one)
        assert util.get_ec_id(one, context) == 0
        assert util.get_ec_id(two, context) == 1000
        assert util.get_actual_ec(two, 1000)._is_equivalent(context)
        assert util.activate(two, 1000) == RTC.RTC_OK
        assert util.is_in_active(two, 1000)
        assert util.is_in_inactive(two, 0)
        states = [None]
        assert util.get_state(states, two, 1000), "as in version 1"
        assert states == [RTC.ACTIVE_STATE]
        assert util.remove_rtc_to_default_ec(one, two) == RTC.RTC_OK
        assert util.get_ec_id(two, context) == -1
        assert util.get_participants_rtc(one) == []

    def test_contexts_that_are_not_there(self, manager: rtm.Manager) -> None:
        one = make(manager, Plain).getObjRef()
        for handle in (1, 1000, -1):
            assert util.get_actual_ec(one, handle) is None
            assert util.activate(one, handle) == RTC.BAD_PARAMETER
            assert util.get_state(one, handle) == (False, RTC.CREATED_STATE)
            assert not util.is_in_inactive(one, handle)
            assert util.set_current_rate(one, handle, 1.0) == RTC.BAD_PARAMETER
            with pytest.raises(LookupError, match="no context of the handle"):
                util.get_current_rate(one, handle)

    def test_components_and_ports_that_are_none(self) -> None:
        assert util.get_component_profile(None).as_dict() == {}
        assert not util.is_existing(None)
        assert not util.is_alive_in_default_ec(None)
        for change in (util.activate, util.deactivate, util.reset):
            assert change(None) == RTC.BAD_PARAMETER
        assert util.get_ec_id(None, None) == -1
        assert util.get_port_names(None) == util.get_participants_rtc(None) == []
        assert util.get_port_by_name(None, "out") is None
        assert util.get_connector_ids_by_portref(None) == util.get_connector_names(None, "out") == []
        bad = RTC.BAD_PARAMETER
        assert util.connect("c", None, None, None) == bad
        assert util.connect_multi("c", None, None, []) == bad
        assert util.connect_by_name("c", None, None, "out", None, "in") == bad
        assert util.add_rtc_to_default_ec(None, None) == util.remove_rtc_to_default_ec(None, None) == bad
        assert util.disconnect_by_portref_connector_name(None, "c") == bad
        assert util.disconnect_by_portref_connector_id(None, "c") == bad
        assert util.disconnect_by_port_name(None, "Foo0.out") == bad
        assert util.disconnect_all_by_ref(None) == bad

    def test_those_that_have_ended(self, manager: rtm.Manager) -> None:
        from omniORB import CORBA

        plain = make(manager, Plain)
        reference = plain.getObjRef()
        manager.deleteComponent("Plain0")
        assert not util.is_existing(reference)
        with pytest.raises(CORBA.OBJECT_NOT_EXIST):
            util.activate(reference)


class TestConnections:
    def test_are_ended_by_names_and_ids(self, manager: rtm.Manager) -> None:
        ports = make(manager, Ports)
        out, into = ports.out.getPortRef(), ports.into.getPortRef()
        rtc = ports.getObjRef()

        def join() -> Any:
            assert util.connect_by_name("wire", None, rtc, "out", rtc, "Ports0.in") == RTC.RTC_OK
            assert util.already_connected(out, into)
            return out.get_connector_profiles()[0]

        assert util.disconnect(join()) == RTC.RTC_OK
        join()
        assert util.disconnect_by_port_name(out, "Ports0.in") == RTC.RTC_OK
        assert util.disconnect_by_port_name(out, "Ports0.in") == RTC.BAD_PARAMETER
        assert util.disconnect_by_port_name(out, "Ports0.out") == RTC.BAD_PARAMETER, "that is itself"
        join()
        (id_,) = util.get_connector_ids(rtc, "out")
        assert util.disconnect_by_portref_connector_id(into, id_) == RTC.RTC_OK
        assert util.disconnect_by_portref_connector_name(into, "wire") == RTC.BAD_PARAMETER
        join()
        assert util.disconnect_all_by_ref(out) == RTC.RTC_OK
        assert not util.already_connected(out, into)

    def test_are_not_made_of_a_port_with_itself(self, manager: rtm.Manager) -> None:
        ports = make(manager, Ports)
        out, into = ports.out.getPortRef(), ports.into.getPortRef()
        assert util.connect("self", None, out, out) == RTC.BAD_PARAMETER
        assert util.connect_multi("many", None, out, [out, None, into]) == RTC.RTC_OK
        assert util.get_connector_names_by_portref(out) == ["many"]

    def test_several_of_which_one_cannot_be(self, manager: rtm.Manager) -> None:
        ports = make(manager, Ports)
        out, into = ports.out.getPortRef(), ports.into.getPortRef()
        wanted = rtm.Properties(defaults_map={"dataport.interface_type": "no_such_type"})
        assert util.connect_multi("many", wanted, out, [into]) == RTC.BAD_PARAMETER
        assert util.get_connector_names_by_portref(out) == []

    def test_whose_first_port_has_ended(self, manager: rtm.Manager, stage: Stage) -> None:
        program = stage.python("ConsoleIn")
        ports = make(manager, Ports)
        other = util.get_port_by_name(stage.component("ConsoleIn0"), "out")
        assert util.connect("wire", None, other, ports.into.getPortRef()) == RTC.RTC_OK
        (connector,) = ports.into.get_connector_profiles()
        assert ports.into.get_connector_profile(connector.connector_id).name == "wire"
        program.process.kill()
        program.process.wait()
        assert util.disconnect(connector) == RTC.RTC_OK
        assert ports.into.get_connector_profiles() == []

    def test_asked_of_a_port_itself(self, manager: rtm.Manager) -> None:
        ports = make(manager, Ports)
        assert ports.out.get_port_profile().name == "Ports0.out"
        request = util.create_connector("wire", None, ports.out.getPortRef(), ports.into.getPortRef())
        code, made = ports.out.connect(request)
        assert code == RTC.RTC_OK
        assert ports.into.disconnect(made.connector_id) == RTC.RTC_OK


class TestConfigurationOfItself:
    def test_sets(self, manager: rtm.Manager) -> None:
        class Sized(rtm.DataFlowComponentBase):
            def onInitialize(self) -> Any:  # noqa: N802
                self.size = [0]
                assert self.bindParameter("size", self.size, "1")
                return RTC.RTC_OK

        sized = make(manager, Sized, "conf.default.size", "2", "conf.more.size", "3")
        sets = sized._configsets
        assert sets.getActiveId() == "default"
        assert sets.haveConfig("more")
        assert not sets.haveConfig("less")
        assert sets.isExist("size")
        assert not sets.isExist("weight")
        sets.update()
        assert sized.size == [2]
        sets.update("more", "size")
        assert sized.size == [3], "at once"
        assert sets.getActiveId() == "default"
        assert sets.activateConfigurationSet("more")
        assert not sets.activateConfigurationSet("less")
        assert sets.getActiveConfigurationSet().getProperty("size") == "3"
        assert sets.getConfigurationSet("less").as_dict() == {}
        less = rtm.Properties(key="less")
        less.setProperty("size", "0")
        assert not sets.setConfigurationSetValues(less)
        assert sets.addConfigurationSet(less)
        assert not sets.addConfigurationSet(less)
        less.setProperty("size", "-1")
        assert sets.setConfigurationSetValues(less)
        assert sets.activateConfigurationSet("less")
        sized.getConfigService().update()
        assert sized.size == [-1]
        assert not sets.removeConfigurationSet("less"), "it is active"
        assert not sets.removeConfigurationSet("")
        assert sets.activateConfigurationSet("default")
        assert sets.removeConfigurationSet("less")
        assert [one.getName() for one in sets.getConfigurationSets()] == ["default", "more"]
