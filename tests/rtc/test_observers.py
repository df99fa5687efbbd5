"""Observers of components: what they are told, and that nobody waits for them."""

import math
import threading
from collections.abc import Callable, Iterator

import pytest

from muros.findings import Finding
from muros.rtc.codes import PortType, ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.configuration import ConfigurationSet
from muros.rtc.contexts import SynchronousExecutionContext
from muros.rtc.observers import CAPACITY, Dialect, Observer, ObserverOptions, Outbox, StatusKind
from muros.rtc.ports import Port
from muros.rtc.profiles import ConnectorProfile
from muros.rtc.status import watch
from tests.rtc.contexts.actors import Actor
from tests.rtc.data.kit import Pair, long

SOON = 10.0
RTC_STATUS, EC_STATUS = StatusKind.RTC_STATUS, StatusKind.EC_STATUS
PORT_PROFILE, CONFIGURATION = StatusKind.PORT_PROFILE, StatusKind.CONFIGURATION


class Told:
    """What an observer was told, and an observer that was told it."""

    def __init__(self, dialect: Dialect = Dialect.OPENRTM, **texts: str) -> None:
        self.messages: list[tuple[StatusKind, str]] = []
        self.findings: list[Finding] = []
        self.gone = threading.Event()
        self.failing: Exception | None = None
        self.blocking = threading.Event()
        self.blocking.set()
        self.sending = threading.Event()
        self.changed = threading.Condition()
        options = ObserverOptions.from_properties(
            {key.replace("__", "."): text for key, text in texts.items()}, dialect
        )
        self.observer = Observer(
            self.send, options, dialect, who="editor", on_gone=self.gone.set, report=self.findings.append
        )

    def send(self, kind: StatusKind, hint: str) -> None:
        self.sending.set()
        assert self.blocking.wait(SOON)
        if self.failing is not None:
            raise self.failing
        with self.changed:
            self.messages.append((kind, hint))
            self.changed.notify_all()

    def until(self, condition: Callable[[], bool]) -> None:
        with self.changed:
            assert self.changed.wait_for(condition, SOON), self.messages

    def drain(self) -> list[tuple[StatusKind, str]]:
        """All that was told until now."""
        self.observer.tell(CONFIGURATION, "end")
        self.until(lambda: (CONFIGURATION, "end") in self.messages)
        with self.changed:
            messages, self.messages = self.messages, []
        return [message for message in messages if message != (CONFIGURATION, "end")]


@pytest.fixture
def component() -> Iterator[Component]:
    component = Component()
    component.configure("Comp0", {"conf.default.gain": "1", "conf.fast.gain": "9"})
    assert component.initialize([SynchronousExecutionContext()]) is ReturnCode.RTC_OK
    yield component
    component.exit()


def test_states_are_told_when_they_hold(component: Component) -> None:
    told = Told()
    seen: list[str] = []
    context = component.owned_contexts[0]
    tell = told.observer.tell

    def spy(kind: StatusKind, hint: str) -> None:
        seen.append(f"{hint} {component.state().name}")
        tell(kind, hint)

    told.observer.tell = spy  # type: ignore[method-assign]
    watch(component, told.observer)
    me = component.participation
    context.activate_component(me)
    context.set_rate(10.0)
    context.deactivate_component(me)
    component.on_activated = lambda context: ReturnCode.RTC_ERROR  # type: ignore[method-assign]
    context.activate_component(me)
    context.reset_component(me)
    context.stop()
    context.start()
    assert told.drain() == [
        (RTC_STATUS, "ACTIVE:0"),
        (EC_STATUS, "RATE_CHANGED:0"),
        (RTC_STATUS, "INACTIVE:0"),
        (RTC_STATUS, "ERROR:0"),
        (RTC_STATUS, "INACTIVE:0"),
        (EC_STATUS, "SHUTDOWN:0"),
        (EC_STATUS, "STARTUP:0"),
    ]
    states = [line for line in seen if line.split(":")[0] in ("ACTIVE", "INACTIVE", "ERROR")]
    assert states == [
        "ACTIVE:0 ACTIVE_STATE",
        "INACTIVE:0 INACTIVE_STATE",
        "ERROR:0 ERROR_STATE",
        "INACTIVE:0 INACTIVE_STATE",
    ]
    component.exit()
    assert told.drain() == [(EC_STATUS, "SHUTDOWN:0"), (RTC_STATUS, "FINALIZE:0")]
    told.observer.close()


def test_contexts_of_others(component: Component) -> None:
    told = Told(observed_status="RTC_STATUS, ec_status")
    watch(component, told.observer)
    other = SynchronousExecutionContext()
    other.bind_owner(Actor(), 0)
    other.start()
    me = component.participation
    other.add_component(me)
    other.activate_component(me)
    other.remove_component(me)
    told.until(lambda: len(told.messages) == 6)
    assert told.messages == [
        (EC_STATUS, "ATTACHED:1000"),
        (EC_STATUS, "STARTUP:1000"),
        (RTC_STATUS, "ACTIVE:1000"),
        (RTC_STATUS, "INACTIVE:1000"),
        (EC_STATUS, "SHUTDOWN:1000"),
        (EC_STATUS, "DETACHED:1000"),
    ]
    other.close()
    told.observer.close()


def test_a_context_of_another_process_is_seen_by_the_actions(component: Component) -> None:
    told = Told()
    me = component.participation
    handle = component.attach_context(object())  # type: ignore[arg-type]
    watch(component, told.observer)
    me.on_activated(handle)
    me.on_deactivated(handle)
    me.on_aborting(handle)
    me.on_reset(handle)
    assert told.drain() == [
        (RTC_STATUS, f"{state}:{handle}") for state in ("ACTIVE", "INACTIVE", "ERROR", "INACTIVE")
    ]
    component.detach_context(handle)
    told.observer.close()


def test_ports_and_connections(component: Component) -> None:
    told = Told()
    watch(component, told.observer)
    ports = [Port(name, PortType.SERVICE) for name in ("a", "b")]
    component.add_port(ports[0])
    component.add_port(ports[1])
    code, profile = ports[0].connect(ConnectorProfile("c", "", tuple(ports)))
    assert code is ReturnCode.RTC_OK
    ports[1].disconnect(profile.connector_id)
    component.remove_port(ports[1])
    assert [hint for kind, hint in told.drain() if kind is PORT_PROFILE] == [
        "ADD:Comp0.a",
        "ADD:Comp0.b",
        "CONNECT:Comp0.b",
        "CONNECT:Comp0.a",
        "DISCONNECT:Comp0.b",
        "DISCONNECT:Comp0.a",
        "REMOVE:Comp0.b",
    ]
    told.observer.close()
    ports[0].connect(ConnectorProfile("c", "", (ports[0],)))
    component.add_port(Port("d", PortType.SERVICE))


def test_values_are_told_of_as_often_as_asked(component: Component) -> None:
    told = Told(
        observed_status="PORT_PROFILE",
        port_profile__send_event__min_interval="1000",
        port_profile__receive_event__min_interval="0",
    )
    pair = Pair()
    component.add_port(pair.out)
    component.add_port(pair.in_)
    watch(component, told.observer)
    pair.connect({"dataport.interface_type": "direct"})
    for number in range(3):
        assert pair.out.write(long(number))
    told.until(lambda: len(told.messages) == 6)
    hints = [hint for _, hint in told.messages]
    assert hints[:2] == ["CONNECT:Comp0.in", "CONNECT:Comp0.out"]
    assert hints[2:] == ["SEND:Comp0.out", *["RECEIVE:Comp0.in"] * 3]
    told.observer.close()


def test_a_port_is_listened_to_again_after_a_while(component: Component) -> None:
    told = Told(port_profile__send_event__min_interval="0.001")
    pair = Pair()
    component.add_port(pair.out)
    watch(component, told.observer)
    pair.connect({"dataport.interface_type": "direct"})
    for number in range(3):
        pair.out.write(long(number))
        told.until(lambda count=number + 1: told.messages.count((PORT_PROFILE, "SEND:Comp0.out")) >= count)  # type: ignore[misc]
        again = threading.Event()
        told.observer.after(0.002, again.set)
        assert again.wait(SOON)
    told.observer.close()


@pytest.mark.parametrize(("dialect", "blank"), [(Dialect.OPENRTM, " "), (Dialect.RTC, "")])
def test_configuration(component: Component, dialect: Dialect, blank: str) -> None:
    told = Told(dialect, observed_status="CONFIGURATION")
    watch(component, told.observer)
    configuration = component.configuration
    configuration.bind("gain", "1", int)
    configuration.set_values(ConfigurationSet("default", values={"gain": "2"}))
    configuration.add(ConfigurationSet("more"))
    configuration.remove("more")
    configuration.activate("fast")
    configuration.update()
    assert told.drain() == [
        (CONFIGURATION, f"{name}:{blank}{what}")
        for name, what in (
            ("SET_CONFIG_SET", "default"),
            ("ADD_CONFIG_SET", "more"),
            ("REMOVE_CONFIG_SET", "more"),
            ("ACTIVATE_CONFIG_SET", "fast"),
            ("UPDATE_CONFIG_PARAM", "fast.gain"),
            ("UPDATE_CONFIG_SET", "fast"),
        )
    ]
    told.observer.close()
    configuration.activate("default")
    assert told.messages == []


def test_an_observer_that_blocks_blocks_nobody(component: Component) -> None:
    told = Told()
    told.blocking.clear()
    watch(component, told.observer)
    context = component.owned_contexts[0]
    assert context.set_rate(10.0) is ReturnCode.RTC_OK
    assert told.sending.wait(SOON)
    for _ in range(2 * CAPACITY):
        assert context.set_rate(10.0) is ReturnCode.RTC_OK
    told.observer.tell(CONFIGURATION, "end")
    told.blocking.set()
    told.until(lambda: (CONFIGURATION, "end") in told.messages)
    (finding,) = told.findings
    assert (finding.code, finding.new) == ("rtc-observer-slow", CAPACITY + 1)
    told.observer.close()


def test_an_observer_that_is_gone_is_told_nothing_any_more(component: Component) -> None:
    told = Told()
    watch(component, told.observer)
    told.failing = OSError("nobody there")
    context = component.owned_contexts[0]
    for _ in range(3):
        context.set_rate(10.0)
    assert told.gone.wait(SOON)
    assert told.observer.is_closed
    (finding,) = told.findings
    assert (finding.code, finding.who) == ("rtc-observer-lost", "editor")
    assert finding.why.endswith("OSError: nobody there")
    assert not component.listeners.of(("POST", "x"))  # type: ignore[arg-type]
    told.failing = None
    context.set_rate(10.0)
    assert told.messages == []


def test_one_failure_is_forgiven(component: Component) -> None:
    told = Told()
    told.failing = OSError("busy")
    told.observer.tell(EC_STATUS, "lost")
    told.observer.after(0.0, lambda: setattr(told, "failing", None))
    told.observer.tell(EC_STATUS, "kept")
    told.until(lambda: (EC_STATUS, "kept") in told.messages)
    assert not told.observer.is_closed
    told.observer.close()


def test_heartbeats_come_by_themselves() -> None:
    told = Told(heartbeat__enable="YES", heartbeat__interval="0.01")
    told.until(lambda: len(told.messages) >= 3)
    assert set(told.messages) == {(StatusKind.HEARTBEAT, "")}
    told.observer.close()


def test_what_rtctree_asks_for() -> None:
    options = ObserverOptions.from_properties(
        {
            "heartbeat.enable": "YES",
            "heartbeat.interval": "1.0",
            "rtc_heartbeat.enable": "YES",
            "rtc_heartbeat.interval": "2.0",
            "ec_heartbeat.enable": "YES",
            "ec_heartbeat.interval": "3.0",
            "observed_status": "ALL",
        },
        Dialect.RTC,
    )
    assert options.heartbeats == {StatusKind.RTC_HEARTBEAT: 2.0, StatusKind.EC_HEARTBEAT: 3.0}
    assert StatusKind.FSM_STATUS in options.kinds
    assert StatusKind.HEARTBEAT not in options.kinds


def test_options() -> None:
    options = ObserverOptions.from_properties({}, Dialect.OPENRTM)
    assert {kind.value for kind in options.kinds} == {
        *("COMPONENT_PROFILE", "RTC_STATUS", "EC_STATUS", "PORT_PROFILE", "CONFIGURATION")
    }
    assert options.heartbeats == {}
    options = ObserverOptions.from_properties(
        {
            "observed_status": "ec_status, FSM_STATUS,nonsense",
            "heartbeat.enable": "yes",
            "heartbeat.interval": "0",
        },
        Dialect.OPENRTM,
    )
    assert options.kinds == {EC_STATUS}
    assert options.heartbeats == {StatusKind.HEARTBEAT: 0.01}
    options = ObserverOptions.from_properties(
        {"heartbeat.enable": "YES", "port_profile.send_event.min_interval": "2"}, Dialect.RTC
    )
    assert options.heartbeats == {StatusKind.RTC_HEARTBEAT: 1.0}
    assert (options.send_interval, options.receive_interval) == (2.0, 0.1)
    with pytest.raises(RtcError, match=r"heartbeat\.interval: 'often' is no time"):
        ObserverOptions.from_properties(
            {"heartbeat.enable": "YES", "heartbeat.interval": "often"}, Dialect.OPENRTM
        )


def test_the_outbox_in_virtual_time() -> None:
    box = Outbox({StatusKind.HEARTBEAT: 1.0}, 100.0, capacity=2)
    assert box.deadline == 101.0
    assert box.take(100.5) is None
    for hint in "abc":
        box.put(EC_STATUS, hint)
    assert box.dropped == 1
    assert box.take(101.0) == (StatusKind.HEARTBEAT, "")
    assert box.take(101.0) == (EC_STATUS, "b")
    assert box.deadline == 102.0
    # After a long stall one heartbeat is told, not all that were due.
    assert box.take(150.0) == (StatusKind.HEARTBEAT, "")
    assert box.take(150.0) == (EC_STATUS, "c")
    assert box.take(150.0) is None
    assert box.deadline == 151.0
    assert Outbox({}, 0.0).deadline == math.inf
