"""Components: their actions under both names, what actions answer, ports, parameters, their end."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from muros.findings import Finding
from muros.rtc.actions import Action, ComponentEvent
from muros.rtc.codes import LifeCycleState, PortType, ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.configuration import ConfigurationSet
from muros.rtc.contexts import SynchronousExecutionContext
from muros.rtc.data import DataError, DataInPort, DataOutPort
from muros.rtc.declarations import InPort, OutPort, Parameter
from muros.rtc.ports import Port
from muros.rtc.profiles import ConnectorProfile
from tests.rtc.data.kit import TimedLong, TimedLongType, long

OK = ReturnCode.RTC_OK
LONG = TimedLongType()


class Traced(Component):
    """Writes down what it is called for."""

    def __init__(self) -> None:
        super().__init__()
        self.trace: list[str] = []

    def on_initialize(self) -> ReturnCode:
        self.trace.append("on_initialize")
        return OK

    def on_activated(self, context: int) -> None:
        self.trace.append(f"on_activated {context}")

    def on_execute(self, context: int) -> None:
        self.trace.append(f"on_execute {context}")

    def on_deactivated(self, context: int) -> None:
        self.trace.append(f"on_deactivated {context}")

    def on_finalize(self) -> None:
        self.trace.append("on_finalize")

    def on_shutdown(self, context: int) -> None:
        self.trace.append(f"on_shutdown {context}")


def alive(
    component: Component, properties: dict[str, str] | None = None, *, contexts: int = 1
) -> list[Finding]:
    """Initialize a component with contexts that the test ticks; what it reports."""
    component.configure("", properties or {})
    found: list[Finding] = []
    component.reporter.on_finding(found.append)
    assert component.initialize([SynchronousExecutionContext() for _ in range(contexts)]) is OK
    return found


def activate(component: Component) -> ReturnCode:
    return component.owned_contexts[0].activate_component(component.participation)


def tick(component: Component) -> None:
    component.owned_contexts[0].tick()


# Actions


def test_actions_run_under_either_name() -> None:
    ran: list[str] = []

    class Old(Component):
        def onExecute(self, ec_id: int) -> None:  # noqa: N802
            ran.append(f"old {ec_id}")

    class New(Old):
        def on_execute(self, context: int) -> None:
            super().on_execute(context)
            ran.append(f"new {context}")

    assert New().participation.on_execute(7) is OK
    assert Old().participation.on_execute(8) is OK
    assert ran == ["old 7", "new 7", "old 8"]
    assert [action.rtc_name for action in (Action.STATE_UPDATE, Action.RESET)] == ["onStateUpdate", "onReset"]


def test_a_class_with_both_names_of_an_action_is_refused() -> None:
    with pytest.raises(RtcError, match="Both defines both on_reset and onReset"):

        class Both(Component):
            def on_reset(self, context: int) -> None: ...

            def onReset(self, ec_id: int) -> None: ...  # noqa: N802


class CorbaCode:
    """As the IDL compiler's enumerations are."""

    def __init__(self, number: int) -> None:
        self._v = number


@pytest.mark.parametrize(
    ("returned", "code"),
    [
        (None, OK),
        (ReturnCode.BAD_PARAMETER, ReturnCode.BAD_PARAMETER),
        (CorbaCode(1), ReturnCode.RTC_ERROR),
        (5, ReturnCode.PRECONDITION_NOT_MET),
    ],
)
def test_what_an_action_may_return(returned: Any, code: ReturnCode) -> None:
    class Returning(Component):
        def on_execute(self, context: int) -> Any:
            return returned

    assert Returning().participation.on_execute(0) is code


@pytest.mark.parametrize("returned", [True, 6, -1, "RTC_OK", CorbaCode(77)])
def test_what_is_no_return_code_is_an_error_and_said(returned: Any) -> None:
    class Returning(Component):
        def on_execute(self, context: int) -> Any:
            return returned

    component = Returning()
    found = alive(component)
    assert activate(component) is OK
    tick(component)
    assert component.state() is LifeCycleState.ERROR_STATE
    assert "on_execute of Returning0 returned the wrong thing" in found[0].what
    assert "return RTC_OK" in found[0].why


def test_what_an_action_raises_is_an_error_and_said_with_its_line() -> None:
    class Raising(Component):
        def on_activated(self, context: int) -> None:
            raise ValueError("no motor")

    component = Raising()
    found = alive(component)
    assert activate(component) is ReturnCode.PRECONDITION_NOT_MET
    assert component.state() is LifeCycleState.ERROR_STATE
    assert found[0].what == "on_activated of Raising0 raised"
    assert found[0].why.startswith("ValueError: no motor (")
    assert "test_component.py:" in found[0].why


def test_listeners_stand_around_actions_and_harm_nobody() -> None:
    class Refusing(Component):
        def on_execute(self, context: int) -> ReturnCode:
            return ReturnCode.RTC_ERROR

    component = Refusing()
    heard: list[tuple[Any, ...]] = []

    def breaks(handle: int) -> None:
        raise RuntimeError("listener")

    component.listeners.add(("PRE", Action.EXECUTE), breaks)
    component.listeners.add(("PRE", Action.EXECUTE), lambda handle: heard.append(("before", handle)))
    component.listeners.add(
        ("POST", Action.EXECUTE), lambda handle, code: heard.append(("after", handle, code))
    )
    found = alive(component)
    activate(component)
    tick(component)
    assert heard == [("before", 0), ("after", 0, ReturnCode.RTC_ERROR)]
    assert [finding.what for finding in found] == ["a listener (PRE of on_execute) raised"]


# Life


def test_a_component_lives_and_ends() -> None:
    component = Traced()
    assert component.state() is LifeCycleState.CREATED_STATE
    alive(component, contexts=2)
    assert component.instance_name == "Traced0"
    assert [component.state(handle) for handle in (0, 1)] == [LifeCycleState.INACTIVE_STATE] * 2
    assert activate(component) is OK
    tick(component)
    component.owned_contexts[1].activate_component(component.participation)
    component.owned_contexts[1].tick()
    assert component.exit() is OK
    assert component.trace == [
        "on_initialize",
        "on_activated 0",
        "on_execute 0",
        "on_activated 1",
        "on_execute 1",
        "on_deactivated 0",
        "on_deactivated 1",
        "on_finalize",
        "on_shutdown 0",
        "on_shutdown 1",
    ]
    assert component.exit() is ReturnCode.PRECONDITION_NOT_MET
    assert component.state() is LifeCycleState.CREATED_STATE


def test_one_that_cannot_begin_leaves_nothing() -> None:
    class Failing(Traced):
        entry = InPort(LONG)

        def on_initialize(self) -> ReturnCode:
            super().on_initialize()
            return ReturnCode.RTC_ERROR

    component = Failing()
    component.configure("Failing3", {})
    context = SynchronousExecutionContext()
    assert component.initialize([context]) is ReturnCode.RTC_ERROR
    assert component.trace == ["on_initialize", "on_finalize"]
    assert component.ports == ()
    assert not component.is_initialized


def test_a_declaration_that_cannot_be_made_leaves_nothing() -> None:
    class Doubled(Component):
        first = InPort(LONG)
        second = InPort(LONG, name="first")

    component = Doubled()
    component.configure("", {})
    with pytest.raises(RtcError, match="Doubled0 has a port 'first' already"):
        component.initialize([SynchronousExecutionContext()])
    assert component.ports == ()
    assert not component.is_initialized


def test_one_that_ends_itself_is_deactivated_before_it_is_finalized() -> None:
    class Ending(Traced):
        ended = threading.Event()

        def on_execute(self, context: int) -> None:
            super().on_execute(context)
            assert self.exit() is OK

    component = Ending()
    component.listeners.add(ComponentEvent.FINALIZED, component.ended.set)
    alive(component)
    activate(component)
    tick(component)
    assert component.ended.wait(20)
    assert component.trace[-4:] == ["on_execute 0", "on_deactivated 0", "on_finalize", "on_shutdown 0"]


def test_contexts_of_others_have_handles_of_their_own() -> None:
    component = Traced()
    alive(component)
    events: list[tuple[Any, ...]] = []
    component.listeners.add(ComponentEvent.EC_ATTACHED, lambda handle: events.append(("attached", handle)))
    component.listeners.add(ComponentEvent.EC_DETACHED, lambda handle: events.append(("detached", handle)))
    first, second = SynchronousExecutionContext(), SynchronousExecutionContext()
    for other in (first, second):
        other.start()
        assert other.add_component(component.participation) is OK
    assert [component.handle_of(one) for one in (*component.owned_contexts, first, second)] == [0, 1000, 1001]
    assert first.remove_component(component.participation) is OK
    assert component.handle_of(first) == -1
    with pytest.raises(RtcError, match="no execution context of handle 1000"):
        component.context_of(1000)
    assert component.exit() is OK
    assert second.participants == ()
    assert events == [("attached", 1000), ("attached", 1001), ("detached", 1000), ("detached", 1001)]


# Ports and parameters


class Controller(Component):
    """PD control of one joint.

    With more than one line of text.
    """

    vendor = "example.org"
    position = InPort(LONG)
    torque = OutPort(LONG, name="out", options={"connection_limit": 3})
    gain = Parameter(1.5, constraint="0<=x<=10", widget="slider.0.1")
    modes = Parameter(["a", "b"])

    def on_execute(self, context: int) -> None:
        if self.position.is_new():
            self.torque.write(int(self.gain * self.position.read().data))


def test_what_a_class_declares_is_its_specification() -> None:
    spec = Controller.spec()
    assert spec["description"] == "PD control of one joint."
    assert spec["implementation_id"] == spec["type_name"] == "Controller"
    assert {key: text for key, text in spec.items() if key.startswith(("conf.", "port."))} == {
        "port.outport.out.connection_limit": "3",
        "conf.default.gain": "1.5",
        "conf.__widget__.gain": "slider.0.1",
        "conf.__constraints__.gain": "0<=x<=10",
        "conf.__type__.gain": "double",
        "conf.default.modes": "a,b",
        "conf.__type__.modes": "vector<string>",
    }


def test_the_rate_and_the_logger_of_a_component(caplog: pytest.LogCaptureFixture) -> None:
    class Slow(Component):
        rate = 2.5

        def on_activated(self, context: int) -> None:
            self.log.warning("slowly")

    assert Slow.spec()["exec_cxt.periodic.rate"] == "2.5"
    assert "exec_cxt.periodic.rate" not in Component.spec()
    component = Slow()
    alive(component)
    activate(component)
    assert caplog.record_tuples == [("muros.rtc.Slow0", 30, "slowly")]


def test_declared_ports_and_parameters_are_real_on_an_instance() -> None:
    component = Controller()
    alive(component, {"conf.default.gain": "2", "port.inport.dataport.buffer.length": "4"})
    sensor: DataOutPort[TimedLong] = DataOutPort("sensor", LONG)
    motor: DataInPort[TimedLong] = DataInPort("motor", LONG)
    for ports in ((sensor, component.position), (component.torque, motor)):
        properties = {"dataport.interface_type": "direct", "dataport.dataflow_type": "push"}
        code, _ = ports[0].connect(ConnectorProfile("c", "", ports, properties))
        assert code is OK
    assert component.position.configuration == {"buffer.length": "4"}
    assert component.torque.configuration == {"connection_limit": "3"}
    assert [port.name for port in component.ports] == ["position", "out"]
    activate(component)
    sensor.write(long(21))
    tick(component)
    assert motor.read().data == 42
    component.configuration.set_values(ConfigurationSet("default", "", {"gain": "3", "modes": "x"}))
    component.configuration.activate("default")
    assert (component.gain, component.modes) == (2.0, ["a", "b"])
    tick(component)
    assert (component.gain, component.modes) == (3.0, ["x"])
    with pytest.raises(RtcError, match="Controller0: parameter gain is set through its configuration set"):
        component.gain = 7.0
    assert component.exit() is OK
    assert sensor.connectors == motor.connectors == ()


class Colour:
    """A data type without a time."""

    repository_id = "IDL:RTC/RGBColour:1.0"
    python_class: type[Colour]

    def default(self) -> Colour:
        return Colour()

    def encode(self, value: Colour, little: bool) -> bytes:
        return b""

    def decode(self, octets: bytes, little: bool) -> Colour:
        return Colour()


Colour.python_class = Colour


def test_what_components_have_themselves_is_no_name_for_a_port() -> None:
    with pytest.raises(
        RtcError, match=r"Timed\.rate: components have 'rate' themselves; .* give name='rate'"
    ):

        class Timed(Component):
            rate = InPort(LONG)  # type: ignore[assignment]

    class Named(Component):
        rate_in = InPort(LONG, name="rate")

    component = Named()
    alive(component)
    assert component.port("rate") is component.rate_in


def test_the_wrong_value_is_refused_by_name() -> None:
    class Painter(Component):
        colour = OutPort(Colour())

    component = Painter()
    alive(component)
    assert not component.colour.write(Colour())  # to nobody
    with pytest.raises(DataError, match=r"port Painter0\.colour takes Colour, not str: write a Colour"):
        component.colour.write("red")


def test_ports_are_found_by_either_name_and_are_unique() -> None:
    component = Controller()
    alive(component)
    added = component.add_port(Port("extra", PortType.SERVICE))
    assert component.port("extra") is component.port("Controller0.extra") is added
    with pytest.raises(RtcError, match="Controller0 has a port 'extra' already"):
        component.add_port(Port("extra", PortType.SERVICE))
    component.remove_port(added)
    with pytest.raises(RtcError, match="Controller0 has no port 'extra'; it has position, out"):
        component.port("extra")


def test_a_bad_text_in_the_file_is_a_finding() -> None:
    component = Controller()
    found = alive(component, {"conf.default.gain": "much"})
    assert component.gain == 1.5
    assert found[0].what == "parameter gain was set to 'much'"


def test_all_ports_are_read_before_and_written_after_where_asked() -> None:
    class Copying(Component):
        entry = InPort(LONG)
        exit_ = OutPort(LONG)

        def on_execute(self, context: int) -> None:
            self.exit_.value = self.entry.value

    component = Copying()
    alive(component)
    component.reads_all = component.writes_all = True
    source: DataOutPort[TimedLong] = DataOutPort("source", LONG)
    sink: DataInPort[TimedLong] = DataInPort("sink", LONG)
    properties = {"dataport.interface_type": "direct", "dataport.dataflow_type": "push"}
    source.connect(ConnectorProfile("", "", (source, component.entry), properties))
    component.exit_.connect(ConnectorProfile("", "", (component.exit_, sink), properties))
    activate(component)
    source.write(long(5))
    tick(component)
    assert sink.read().data == 5


def test_contexts_of_others_are_not_taken_part_in_without_end() -> None:
    component = Component()
    component.initialize([])
    context = SynchronousExecutionContext()
    handles = [component.attach_context(context) for _ in range(100)]
    assert handles == list(range(1000, 1100))
    with pytest.raises(RtcError, match="takes part in 100 execution contexts already"):
        component.attach_context(context)
    assert component.detach_context(1003) is OK
    assert component.attach_context(context) == 1003
    for handle in handles:
        component.detach_context(handle)
    component.exit()
    context.close()


def test_what_a_context_that_has_gone_activated_is_deactivated() -> None:
    component = Traced()
    component.initialize([])
    context = SynchronousExecutionContext()
    me = component.participation
    first, second, idle = (component.attach_context(context) for _ in range(3))
    for handle in (first, second):
        assert me.on_activated(handle) is OK
    me.on_deactivated(second)
    component.trace.clear()
    for handle in (first, second, idle):
        me.part(handle)
    assert component.trace == [f"on_deactivated {first}"]
    assert component.participating_contexts == ()
    component.exit()
    context.close()
