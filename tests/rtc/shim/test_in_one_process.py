"""The faces of components, ports and the manager that old components use, without other processes."""

from __future__ import annotations

from typing import Any

import pytest

import OpenRTM_aist as rtm
import RTC
import RTC__POA
from muros.rtc.listeners import Listeners
from tests.rtc.shim.stage import COMPONENTS


def spec(name: str, *more: str) -> rtm.Properties:
    return rtm.Properties(
        defaults_str=[
            "implementation_id",
            name,
            "type_name",
            name,
            "description",
            f"A {name}",
            "version",
            "1.2",
            "vendor",
            "we",
            "category",
            "tests",
            *more,
            "",
        ]
    )


def make(manager: rtm.Manager, kind: type, *more: str) -> Any:
    deleted: list[Any] = []
    assert manager.registerFactory(spec(kind.__name__, *more), kind, deleted.append)
    component = manager.createComponent(kind.__name__)
    assert component is not None
    component.deleted = deleted
    return component


class Plain(rtm.DataFlowComponentBase):
    pass


class Ports(rtm.DataFlowComponentBase):
    def __init__(self, manager: rtm.Manager) -> None:
        super().__init__(manager)
        self.seen: list[Any] = []
        self.number = RTC.TimedLong(RTC.Time(0, 0), 7)

    def onInitialize(self) -> Any:  # noqa: N802
        self.out = rtm.OutPort("out", self.number)
        self.into = rtm.InPort("in", RTC.TimedLong(RTC.Time(0, 0), -1))
        assert self.addOutPort("out", self.out)
        assert self.addInPort("in", self.into)
        return RTC.RTC_OK

    def wire(self, **properties: str) -> Any:
        given = {f"dataport.{key.replace('__', '.')}": text for key, text in properties.items()}
        return rtm.CORBA_RTCUtil.connect("wire", rtm.Properties(defaults_map=given), *self.get_ports())


def test_a_component_says_what_it_is(manager: rtm.Manager) -> None:
    plain = make(manager, Plain, "conf.default.x", "1")
    assert plain.getInstanceName() == "Plain0"
    assert (plain.getTypeName(), plain.getVersion(), plain.getVendor()) == ("Plain", "1.2", "we")
    assert (plain.getCategory(), plain.getDescription()) == ("tests", "A Plain")
    assert plain.getProperties().getProperty("conf.default.x") == "1"
    assert plain._properties.getNode("conf.default").getProperty("x") == "1"
    assert plain.get_component_profile().instance_name == "Plain0"
    assert plain.getObjRef()._is_equivalent(manager.getComponent("Plain0").getObjRef())
    assert manager.getComponents() == [plain]
    assert plain.getManager() is manager
    assert len(plain.get_owned_contexts()) == 1
    assert plain.get_participating_contexts() == []
    assert plain.is_alive(plain.get_context(0))


def test_a_component_is_activated_and_ended(manager: rtm.Manager) -> None:
    plain = make(manager, Plain)
    assert plain.activate(0) == RTC.RTC_OK
    assert plain.activate(0) == RTC.PRECONDITION_NOT_MET
    assert plain.deactivate(0) == RTC.RTC_OK
    assert plain.reset(0) == RTC.PRECONDITION_NOT_MET
    assert plain.setExecutionRate(0, 50.0) == RTC.RTC_OK
    assert plain.getExecutionRate(0) == 50.0
    assert plain.getExecutionContext(0).get_rate() == 50.0
    assert plain.isOwnExecutionContext(0)
    assert not plain.isOwnExecutionContext(1000)
    manager.deleteComponent("Plain0")
    assert manager.getComponent("Plain0") is None
    assert plain.deleted == [plain]


def test_an_error_in_an_action_is_the_error_state(manager: rtm.Manager) -> None:
    class Failing(rtm.DataFlowComponentBase):
        def onActivated(self, ec_id: int) -> Any:  # noqa: N802
            return RTC.RTC_ERROR

    failing = make(manager, Failing)
    assert failing.activate(0) != RTC.RTC_OK
    assert rtm.CORBA_RTCUtil.get_state(failing.getObjRef()) == (True, RTC.ERROR_STATE)
    assert rtm.CORBA_RTCUtil.is_in_error(failing.getObjRef())
    assert failing.reset(0) == RTC.RTC_OK
    assert failing.exit() == RTC.RTC_OK


def test_what_cannot_be_made_is_none_and_told(manager: rtm.Manager) -> None:
    findings: list[Any] = []
    manager.core.reporter.on_finding(findings.append)

    class Refusing(rtm.DataFlowComponentBase):
        def onInitialize(self) -> Any:  # noqa: N802
            return RTC.RTC_ERROR

    manager.registerFactory(spec("Refusing"), Refusing, rtm.Delete)
    manager.registerFactory(spec("Nothing"), lambda manager: object(), rtm.Delete)
    for name in ("Refusing", "Nothing", "Unknown"):
        assert manager.createComponent(name) is None
    told = [finding.why for finding in findings if finding.code == "create-failed"]
    assert any("object, which is no component" in why for why in told)
    assert any("on_initialize answered RTC_ERROR" in why for why in told)
    assert manager.load("no_such_file.py") == RTC.RTC_ERROR


def test_modules_are_loaded_and_forgotten(manager: rtm.Manager) -> None:
    assert manager.load(str(COMPONENTS / "ConsoleOut.py")) == RTC.RTC_OK
    (loaded,) = manager.getLoadedModules()
    assert loaded.getProperty("file_path") == str(COMPONENTS / "ConsoleOut.py")
    component = manager.createComponent("ConsoleOut")
    assert component.getExecutionContext(0).is_running()
    manager.unloadAll()
    assert manager.getLoadedModules() == []


def test_before_others_know_a_component(manager: rtm.Manager) -> None:
    class Asking(rtm.DataFlowComponentBase):
        def onInitialize(self) -> Any:  # noqa: N802
            self.seen = (self.getObjRef(), self.getExecutionContext(0), self._this())
            return RTC.RTC_OK

    asking = make(manager, Asking)
    assert asking.seen == (None, None, None)
    assert asking._this()._is_equivalent(asking.getObjRef())


def test_values_go_through_ports(manager: rtm.Manager) -> None:
    ports = make(manager, Ports)
    assert ports.into.read().data == -1, "what it was made with, before anything came"
    assert not ports.out.write()
    assert ports.wire() == RTC.RTC_OK
    assert ports.out.write(), "the variable it was made with"
    names: list[str] = []
    assert ports.into.isNew(names)
    assert names == ["wire"]
    assert ports.into.isNew("wire")
    assert ports.into.read().data == 7
    assert ports.into.getStatus() == rtm.DataPortStatus.PORT_OK
    ports.number.data = 8
    assert ports.out.write()
    assert ports.out.write(RTC.TimedLong(RTC.Time(1, 2), 9))
    ports.into.update()
    assert ports.into.read("wire").tm.nsec == 2
    assert ports.into.isEmpty()
    assert ports.into.isEmpty(names)
    assert names == ["wire"]
    assert ports.out.getStatusList() == [rtm.DataPortStatus.PORT_OK]
    assert rtm.DataPortStatus.toString(ports.out.getStatus(0)) == "PORT_OK"


@pytest.mark.parametrize("kind", [RTC.TimedLong, RTC.TimedDoubleSeq, RTC.CameraImage, RTC.TimedWString])
def test_values_of_zeros_for_ports(manager: rtm.Manager, kind: Any) -> None:
    """The code that RTCBuilder writes makes each port's variable so."""
    value = rtm.instantiateDataType(kind)
    assert isinstance(value, kind)
    assert (value.tm.sec, value.tm.nsec) == (0, 0)
    assert rtm.instantiateDataType(kind) is not value
    assert rtm.OutPort("out", value).getPortDataType() == kind._NP_RepositoryId


def test_a_buffer_of_the_ports_own(manager: rtm.Manager) -> None:
    class Old(Ports):
        def onInitialize(self) -> Any:  # noqa: N802
            self.out = rtm.OutPort("out", self.number, rtm.RingBuffer(4))
            self.into = rtm.InPort("in", self.number, rtm.RingBuffer(2))
            self.addPort(self.out)
            self.addPort(self.into)
            return RTC.RTC_OK

    old = make(manager, Old)
    old.wire()
    for old.number.data in (1, 2, 3):
        old.out.write()
    assert [old.into.read().data for _ in range(2)] == [2, 3]
    assert rtm.ConnectorDataListenerType.toString(0) == "ON_BUFFER_WRITE"
    assert rtm.ConnectorListenerType.toString(5) == "ON_CONNECT"


def test_callbacks_of_ports(manager: rtm.Manager) -> None:
    ports = make(manager, Ports)
    seen: list[Any] = []

    class Write(rtm.OnWrite):
        def __call__(self, value: Any) -> None:
            seen.append(("write", value.data))

    class Add(rtm.OnWriteConvert):
        def __call__(self, value: Any) -> Any:
            return RTC.TimedLong(value.tm, value.data + 1)

    ports.out.setOnWrite(Write())
    ports.out.setOnWriteConvert(Add())
    ports.into.setOnRead(lambda: seen.append("read"))
    ports.into.setOnReadConvert(lambda value: RTC.TimedLong(value.tm, value.data * 10))
    ports.wire()
    ports.out.write()
    assert ports.into.read().data == 80
    assert seen == [("write", 7), "read"]


def test_listeners_of_connectors(manager: rtm.Manager) -> None:
    ports = make(manager, Ports)
    heard: list[Any] = []

    class Data(rtm.ConnectorDataListener):
        def __call__(self, info: Any, data: Any) -> Any:
            heard.append(("data", info.name, data.data))
            data.data += 100
            return rtm.ConnectorListenerStatus.DATA_CHANGED

    class Connection(rtm.ConnectorListener):
        def __call__(self, info: Any) -> Any:
            heard.append((info.properties.getProperty("interface_type"), len(info.ports)))

    kinds = rtm.ConnectorDataListenerType
    data = ports.into.addConnectorDataListener(kinds.ON_RECEIVED, Data())
    connection = ports.out.addConnectorListener(rtm.ConnectorListenerType.ON_CONNECT, Connection())
    ports.wire()
    ports.out.write()
    assert ports.into.read().data == 107
    assert heard == [("corba_cdr", 2), ("data", "wire", 7)]
    (info,) = ports.into.connectors()
    assert [one.get_port_profile().name for one in info.ports] == [ports.out.getName(), ports.into.getName()]
    assert info.ports[1]._is_equivalent(ports.into.getPortRef())
    ports.into.removeConnectorDataListener(kinds.ON_RECEIVED, data)
    ports.into.removeConnectorDataListener(kinds.ON_RECEIVED, data)
    ports.out.removeConnectorListener(rtm.ConnectorListenerType.ON_CONNECT, connection)
    ports.out.write()
    assert ports.into.read().data == 7
    assert len(heard) == 2


def test_octets_are_decoded_for_listeners_that_do_it_themselves() -> None:
    from muros.rtc.data import ConnectorInfo

    octets = (1).to_bytes(4, "big") + bytes(4) + (5).to_bytes(4, "big")
    listener = rtm.ConnectorDataListenerT()
    info = rtm.ConnectorInfo(ConnectorInfo("c", "id", (), {"serializer.cdr.endian": "big"}))
    data = listener(info, octets, RTC.TimedLong(RTC.Time(0, 0), 0))
    assert (data.tm.sec, data.data) == (1, 5)


def test_ports_tell_of_themselves(manager: rtm.Manager) -> None:
    ports = make(manager, Ports)
    heard: list[Any] = []
    ports.addPortConnectListener(
        rtm.PortConnectListenerType.ON_NOTIFY_CONNECT,
        lambda name, profile: heard.append((name, profile.name, len(profile.ports), None in profile.ports)),
    )
    ports.addPortConnectRetListener(
        rtm.PortConnectRetListenerType.ON_CONNECTED,
        lambda name, profile, code: heard.append(
            (name, code == RTC.RTC_OK, rtm.NVUtil.toString(profile.properties, "dataport.dataflow_type"))
        ),
    )
    ports.wire()
    assert sorted(heard, key=str) == [
        ("in", "wire", 2, False),
        ("in", True, "push"),
        ("out", "wire", 2, False),
        ("out", True, "push"),
    ]
    assert (ports.out.getName(), ports.out.name()) == (f"{ports.getInstanceName()}.out", "out")
    assert ports.out.getPortDataType() == "IDL:RTC/TimedLong:1.0"
    assert ports.out.getPortRef().get_port_profile().name == "Ports0.out"
    assert ports.out.properties().getProperty("port.port_type") == ""
    (connector_id,) = ports.out.getConnectorIds()
    assert ports.out.getConnectorNames() == ["wire"]
    assert ports.out.getConnectorProfileById(connector_id).name == "wire"
    assert ports.out.getConnectorProfileByName("wire").connector_id == connector_id
    assert ports.out.getConnectorProfiles()[0].ports[0]._is_equivalent(ports.out.getPortRef())
    assert ports.out.getConnectorProfileById("none") is ports.out.getConnectorProfileByName("none") is None
    assert [info.id for info in ports.out.connectors()] == [connector_id]
    ports.out.disconnect_all()
    assert ports.out.getConnectorProfiles() == []
    assert ports.removePort(ports.out)
    assert not ports.removeOutPort(ports.out)
    assert ports.out.getPortRef() is None


def test_all_ports_are_read_before_and_written_after(manager: rtm.Manager) -> None:
    class Echo(Ports):
        def onExecute(self, ec_id: int) -> Any:  # noqa: N802
            self.seen.append(self.number.data)
            self.number.data += 1
            return RTC.RTC_OK

    echo = make(manager, Echo)
    echo.wire()
    echo.setReadAll(True, True)
    echo.setWriteAll(True, True)
    assert echo.writeAll()
    assert echo.readAll()
    assert echo.activate(0) == RTC.RTC_OK
    rate = echo.getExecutionRate(0)
    assert rate == 200.0
    assert echo.deactivate(0) == RTC.RTC_OK


def test_actions_and_configuration_are_listened_to(manager: rtm.Manager) -> None:
    heard: list[Any] = []

    class Listening(rtm.DataFlowComponentBase):
        def onInitialize(self) -> Any:  # noqa: N802
            self.gain = [1.0]
            self.bindParameter("gain", self.gain, "1.5")
            before, after = rtm.PreComponentActionListenerType, rtm.PostComponentActionListenerType
            self.pre = self.addPreComponentActionListener(
                before.PRE_ON_ACTIVATED, lambda ec: heard.append(("pre", ec))
            )
            self.post = self.addPostComponentActionListener(
                after.POST_ON_DEACTIVATED, lambda ec, ret: heard.append(("post", ec, ret == RTC.RTC_OK))
            )
            self.addPortActionListener(rtm.PortActionListenerType.ADD_PORT, lambda p: heard.append(p.name))
            self.addExecutionContextActionListener(
                rtm.ExecutionContextActionListenerType.EC_ATTACHED, lambda ec: heard.append(ec)
            )
            self.addConfigurationSetNameListener(
                rtm.ConfigurationSetNameListenerType.ON_ACTIVATE_CONFIG_SET, lambda name: heard.append(name)
            )
            self.addConfigurationSetListener(
                rtm.ConfigurationSetListenerType.ON_ADD_CONFIG_SET, lambda one: heard.append(one.getName())
            )
            self.addPort(rtm.CorbaPort("service"))
            return RTC.RTC_OK

    listening = make(manager, Listening, "conf.fast.gain", "3")
    listening.activate(0)
    listening.deactivate(0)
    listening.removePreComponentActionListener(
        rtm.PreComponentActionListenerType.PRE_ON_ACTIVATED, listening.pre
    )
    listening.removePostComponentActionListener(
        rtm.PostComponentActionListenerType.POST_ON_DEACTIVATED, listening.post
    )
    assert listening.gain == [1.5]
    listening.updateParameters("fast")
    assert listening.gain == [3.0]
    assert heard == ["Listening0.service", ("pre", 0), ("post", 0, True), "fast"]
    listening.get_configuration().add_configuration_set(_set("slow"))
    assert heard[-1] == "slow"


def test_all_listeners_can_be_removed(manager: rtm.Manager) -> None:
    ports = make(manager, Ports)
    registries: list[Listeners[Any]] = [
        ports._behind.listeners,
        ports._behind.configuration.listeners,
        *(port.port.connect_listeners for port in (ports.out, ports.into)),
        ports.out.port.listeners._data,
        ports.out.port.listeners._connector,
    ]

    def standing() -> list[dict[Any, Any]]:
        return [{kind: calls for kind, calls in one._callbacks.items() if calls} for one in registries]

    def listener(*arguments: Any) -> None: ...

    before = standing()
    for owner in (ports, ports.out):
        names = [name for name in dir(owner) if name.startswith("add") and name.endswith("Listener")]
        assert len(names) >= 4
        for name in names:
            assert getattr(owner, name)(0, listener, True) is listener
            assert standing() != before, name
            for _ in range(2):
                getattr(owner, name.replace("add", "remove", 1))(0, listener)
            assert standing() == before, name


def _set(name: str) -> Any:
    import SDOPackage

    return SDOPackage.ConfigurationSet(name, "", [])


def test_services(manager: rtm.Manager) -> None:
    findings: list[Any] = []
    manager.core.reporter.on_finding(findings.append)

    class Target(RTC__POA.DataPushService):  # type: ignore[misc]
        def push(self, data: Any) -> Any:
            return RTC.PORT_OK

    class Provider(rtm.DataFlowComponentBase):
        def onInitialize(self) -> Any:  # noqa: N802
            self.port = rtm.CorbaPort("p")
            self.addPort(self.port)
            assert self.port.registerProvider("one", "Push", Target())
            assert not self.port.registerProvider("one", "Push", Target()), "the name is taken"
            assert not self.port.registerProvider("two", "Push", object()), "no servant"
            self.consumer = rtm.CorbaConsumer(RTC.DataPushService)
            other = rtm.CorbaPort("c")
            assert other.registerConsumer("one", "Push", self.consumer)
            assert not other.registerConsumer("one", "Push", self.consumer)
            self.addPort(other)
            return RTC.RTC_OK

    provider = make(manager, Provider)
    assert [f.code for f in findings if f.code == "register-failed"]
    assert provider.consumer._ptr() is None
    assert rtm.CORBA_RTCUtil.connect("s", None, *provider.get_ports()) == RTC.RTC_OK
    provider.port.activateInterfaces()
    assert provider.consumer._ptr().push(b"") == RTC.PORT_OK
    found = provider.consumer.getObject()
    provider.port.disconnect_all()
    assert provider.consumer.getObject() is None
    assert provider.consumer.setObject(found)
    assert provider.consumer._ptr().push(b"") == RTC.PORT_OK
    provider.port.deactivateInterfaces()
    provider.consumer.releaseObject()
    assert not provider.consumer.setObject(None)
    assert rtm.CorbaConsumer(consumer=provider.consumer).interface is RTC.DataPushService


def test_state_machines(manager: rtm.Manager) -> None:
    fsm = rtm.StaticFSM
    heard: list[Any] = []

    class Box:
        def __init__(self, begin: int = 0) -> None:
            self.count = begin

    @fsm.FSM_TOPSTATE
    class Top(fsm.Link):
        def onInit(self) -> Any:  # noqa: N802
            self.set_state(fsm.State(Working))
            return RTC.RTC_OK

        def step(self, value: Any) -> None: ...

        def pause(self) -> None: ...

    @fsm.DEEPHISTORY
    @fsm.DATA_TYPE(Box)
    @fsm.FSM_SUBSTATE(Top)
    class Working(fsm.Link):
        def onEntry(self) -> Any:  # noqa: N802
            heard.append(self.rtComponent().getInstanceName())
            return RTC.RTC_OK

        def step(self, value: Any) -> None:
            self.data(Working).count += value.data
            if self.data().count == 1:
                self.dispatch(fsm.Event(Top.step, value))

        def pause(self) -> None:
            self.setState(fsm.State(Paused))

    @fsm.FSM_SUBSTATE(Top)
    class Paused(fsm.Link):
        def pause(self) -> None:
            self.setStateHistory(fsm.State(Working, 5))

    class Worker(rtm.DataFlowComponentBase):
        def onInitialize(self) -> Any:  # noqa: N802
            self.fsm = fsm.Machine(Top, self)
            self.event = rtm.EventInPort("event", self.fsm)
            self.event.bindEvent("step", Top.step, RTC.TimedLong(RTC.Time(0, 0), 0))
            self.event.bindEvent("pause", Top.pause)
            self.out = rtm.OutPort("out", RTC.TimedLong(RTC.Time(0, 0), 1))
            self.addInPort("event", self.event)
            self.addOutPort("out", self.out)
            return RTC.RTC_OK

    worker = make(manager, Worker)
    assert worker.fsm.getComp() is worker
    assert rtm.CORBA_RTCUtil.connect("step", None, *worker.get_ports()) == RTC.RTC_OK
    assert worker.out.write()
    assert worker.fsm.run_event() == 1
    assert worker.fsm.data(Working).count == 2, "once by the port, once by itself"
    assert worker.fsm.dispatch(fsm.Event("pause"))
    assert worker.fsm.current is Paused
    assert worker.fsm.dispatch("pause")
    assert worker.fsm.data(Working).count == 5
    assert heard == ["Worker0", "Worker0"]
    service = worker.getObjRef().get_sdo_service("IDL:omg.org/RTC/ExtendedFsmService:1.0")
    assert service._narrow(RTC.ExtendedFsmService).get_current_state() == "Working"


def test_the_manager_tells_of_itself(manager: rtm.Manager) -> None:
    plain = make(manager, Plain)
    assert rtm.Manager.instance() is manager
    assert manager.getConfig().getProperty("manager.name") == "manager"
    assert "Plain" in [profile.getProperty("implementation_id") for profile in manager.getFactoryProfiles()]
    assert manager.getLoadedModules() == []
    assert manager.getPOAManager() is not None
    assert manager.getORB() is not None
    manager.getLogbuf("test").RTC_WARN("%s took %d", ("it", 3))
    plain._rtcout.RTC_ERROR("no arguments at all %d")
    plain._rtcout.RTC_INFO("wrong %d", "kind")
    manager.cleanupComponent(plain)
    manager.deleteComponent(comp=plain)
    assert manager.getComponents() == []


def test_settings_that_cannot_be_end_the_program(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        rtm.Manager.init(["program", "-f", "/no/such/rtc.conf"])
    assert ended.value.code == 2
    assert "/no/such/rtc.conf" in capsys.readouterr().err
