"""Composites: whose context runs whom, what is exported, how tools change it."""

import gc
import json
import threading
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from muros.rtc.codes import LifeCycleState, PeerLostError, PortType, ReturnCode
from muros.rtc.component import Component
from muros.rtc.composite import PeriodicECSharedComposite
from muros.rtc.configuration import ConfigurationSet
from muros.rtc.contexts import MultilayerCompositeEC, Participant, SynchronousExecutionContext
from muros.rtc.organization import (
    Dependency,
    LocalMember,
    Organization,
    OrganizationError,
    organizations_of,
)
from muros.rtc.ports import Port
from tests.rtc.contexts.actors import Actor

OK = ReturnCode.RTC_OK
ACTIVE, INACTIVE, ERROR = (LifeCycleState[f"{s}_STATE"] for s in ("ACTIVE", "INACTIVE", "ERROR"))
VECTORS = Path(__file__).parents[1] / "vectors/rtc"


class Part(Component):
    """A member with two ports, which notes what it is called for."""

    def __init__(self, name: str, trace: list[str]) -> None:
        super().__init__()
        self.configure(name, {"execution_contexts": "SynchExtTriggerEC"})
        self.trace = trace
        self.fails = False

    def on_initialize(self) -> ReturnCode:
        self.add_port(Port("in", PortType.DATA_IN))
        self.add_port(Port("out", PortType.DATA_OUT))
        return OK

    def on_activated(self, context: int) -> None:
        self.trace.append(f"{self.instance_name} activated {context}")

    def on_deactivated(self, context: int) -> None:
        self.trace.append(f"{self.instance_name} deactivated {context}")

    def on_execute(self, context: int) -> ReturnCode:
        self.trace.append(f"{self.instance_name} {context}")
        return ReturnCode.RTC_ERROR if self.fails else OK


class Stage:
    """Sensor0, Controller0 and Motor0, and composites of them."""

    def __init__(self) -> None:
        self.trace: list[str] = []
        self.parts: dict[str, Part] = {}
        for name in ("Sensor0", "Controller0", "Motor0"):
            self.parts[name] = Part(name, self.trace)
            assert self.parts[name].initialize() is OK

    def composite(
        self, members: str, exported: str = "", properties: Mapping[str, str] = {}
    ) -> PeriodicECSharedComposite:
        composite = PeriodicECSharedComposite(self.parts.get)
        composite.configure(
            "PeriodicECSharedComposite0",
            {
                "conf.default.members": members,
                "conf.default.exported_ports": exported,
                "exec_cxt.periodic.type": "SynchExtTriggerEC",
                **properties,
            },
        )
        assert composite.initialize() is OK
        return composite

    def state(self, composite: PeriodicECSharedComposite, name: str) -> LifeCycleState:
        return composite.context.get_component_state(self.parts[name].participation)


@pytest.fixture
def stage() -> Stage:
    return Stage()


def test_it_is_made_as_the_captured_one() -> None:
    captured = json.loads((VECTORS / "component_composite.json").read_text())
    member = json.loads((VECTORS / "component_composite_member.json").read_text())
    told = {p["name"]: p["value"] for p in captured["component_profile"]["properties"]}
    stage = Stage()
    composite = stage.composite(told["conf.default.members"], told["conf.default.exported_ports"])
    profile = composite.profile()
    for key in ("type_name", "description", "version", "vendor", "category"):
        assert getattr(profile, key) == captured["component_profile"][key]
    for key in [key for key in told if key.startswith(("conf.", "exec_cxt.periodic.sync"))]:
        assert profile.properties[key] == told[key]
    assert sorted(port.name for port in profile.ports) == sorted(
        captured["component_profile"]["port_profiles"]
    )
    # The same ports as the members', not others that look so.
    assert {port.port for port in profile.ports} == {
        stage.parts["Sensor0"].port("in"),
        stage.parts["Motor0"].port("out"),
    }
    names = [part.instance_name for part in stage.parts.values()]
    assert [str(p) for p in composite.context.participants] == [f"<{name}>" for name in names]
    (organization,) = organizations_of(composite).owned
    assert [m.instance_name for m in organization.members] == names
    assert (organization.owner, organization.dependency.name) == (
        composite,
        captured["sdo"]["owned_organizations"][0]["dependency"],
    )
    motor = stage.parts["Motor0"]
    assert motor.owned_contexts[0].is_running() is member["owned_contexts"][0]["is_running"] is False
    assert [motor.handle_of(c) for c in (*motor.owned_contexts, *motor.participating_contexts)] == member[
        "context_handles"
    ]
    assert organizations_of(motor).joined == (organization,)


def test_members_are_active_with_it_and_run_in_their_order(stage: Stage) -> None:
    composite = stage.composite("Motor0, Sensor0")
    context = composite.context
    assert context.activate_component(composite.participation) is OK
    assert stage.state(composite, "Motor0") is stage.state(composite, "Sensor0") is ACTIVE
    context.tick()
    assert context.deactivate_component(composite.participation) is OK
    assert stage.trace == [
        *("Motor0 activated 1000", "Sensor0 activated 1000"),
        *("Motor0 1000", "Sensor0 1000"),
        *("Motor0 deactivated 1000", "Sensor0 deactivated 1000"),
    ]


def test_a_member_in_error_is_reset_with_it(stage: Stage) -> None:
    composite = stage.composite("Motor0,Sensor0")
    stage.parts["Motor0"].fails = True
    composite.context.activate_component(composite.participation)
    composite.context.tick()
    assert stage.state(composite, "Motor0") is ERROR
    assert stage.state(composite, "Sensor0") is ACTIVE
    assert composite.on_reset(0) is OK
    assert stage.state(composite, "Motor0") is INACTIVE


def test_an_active_component_is_stopped_before_it_is_taken_in(stage: Stage) -> None:
    motor = stage.parts["Motor0"]
    motor.owned_contexts[0].activate_component(motor.participation)
    stage.composite("Motor0")
    assert stage.trace == ["Motor0 activated 0", "Motor0 deactivated 0"]
    assert motor.state(0) is INACTIVE
    assert not motor.owned_contexts[0].is_running()


def test_members_are_given_back_at_its_end(stage: Stage) -> None:
    composite = stage.composite("Motor0,Sensor0", "Motor0.out")
    composite.context.activate_component(composite.participation)
    assert composite.exit() is OK
    motor = stage.parts["Motor0"]
    assert motor.owned_contexts[0].is_running()
    assert motor.participating_contexts == ()
    assert organizations_of(motor).joined == ()
    assert motor.port("out").owner is motor
    assert len(motor.ports) == 2
    assert stage.trace[-2:] == ["Motor0 deactivated 1000", "Sensor0 deactivated 1000"]


def test_a_member_that_ends_is_one_no_longer(stage: Stage) -> None:
    composite = stage.composite("Motor0,Sensor0", "Motor0.out,Sensor0.in")
    assert stage.parts["Motor0"].exit() is OK
    assert [member.instance_name for member in composite.organization.members] == ["Sensor0"]
    assert [port.full_name for port in composite.ports] == ["Sensor0.in"]
    assert composite.configuration.get("default").values["members"] == "Sensor0"


def test_what_is_not_there_is_said_and_taken_in_when_it_is(stage: Stage) -> None:
    motor = stage.parts.pop("Motor0")
    composite = stage.composite("Motor0,Sensor0,PeriodicECSharedComposite0", "Motor0.out,nonsense")
    counts = composite.reporter.findings.counts()
    assert counts["rtc-member-not-found"] == 2
    assert counts["rtc-port-not-exported"] == 2
    assert composite.configuration.get("default").values["members"].startswith("Motor0,")
    stage.parts["Motor0"] = motor
    composite.configuration.activate("default")
    assert [member.instance_name for member in composite.organization.members] == ["Motor0", "Sensor0"]
    assert [port.full_name for port in composite.ports] == ["Motor0.out"]


def test_it_cannot_be_its_own_member(stage: Stage) -> None:
    parts: dict[str, Component] = {}
    composite = PeriodicECSharedComposite(parts.get)
    parts["me"] = composite
    composite.configure("me", {"conf.default.members": "me", "exec_cxt.periodic.type": "SynchExtTriggerEC"})
    assert composite.initialize() is OK
    assert composite.organization.members == ()
    (finding,) = composite.reporter.findings.snapshot()
    assert finding.why == "a composite cannot be a member of itself"


def test_tools_change_members_and_exports_by_the_configuration(stage: Stage) -> None:
    composite = stage.composite("Motor0", "Motor0.out")
    values = {"members": "Sensor0,Controller0", "exported_ports": "Controller0.in, Sensor0.out"}
    assert composite.configuration.set_values(ConfigurationSet("default", values=values))
    composite.configuration.activate("default")
    assert [member.instance_name for member in composite.organization.members] == ["Sensor0", "Controller0"]
    assert [port.full_name for port in composite.ports] == ["Controller0.in", "Sensor0.out"]
    assert stage.parts["Motor0"].owned_contexts[0].is_running()
    assert composite.port("Controller0.in") is stage.parts["Controller0"].port("in")


def test_tools_change_members_by_the_organization(stage: Stage) -> None:
    composite = stage.composite("Motor0", "Motor0.out")
    composite.organization.add_members(LocalMember(stage.parts[name]) for name in ("Motor0", "Sensor0"))
    assert composite.configuration.active().values["members"] == "Motor0,Sensor0"
    assert len(composite.context.participants) == 2
    composite.organization.remove_member("Motor0")
    assert composite.ports == ()
    assert composite.configuration.active().values["members"] == "Sensor0"
    assert stage.parts["Motor0"].owned_contexts[0].is_running()
    with pytest.raises(OrganizationError, match="'Motor0' is not a member; there are Sensor0"):
        composite.organization.remove_member("Motor0")


def test_members_and_ports_of_the_request_that_made_it(stage: Stage) -> None:
    request = {"exported_ports": "Motor0.in,Motor0.out", "members": "Sensor0"}
    composite = stage.composite("Motor0", "Motor0.out", request)
    assert [member.instance_name for member in composite.organization.members] == ["Motor0", "Sensor0"]
    assert [port.full_name for port in composite.ports] == ["Motor0.out", "Motor0.in"]


def test_groups_run_side_by_side(stage: Stage) -> None:
    composite = stage.composite(
        "Motor0,Sensor0|Controller0", properties={"exec_cxt.periodic.type": "MultilayerCompositeEC"}
    )
    assert isinstance(composite.context, MultilayerCompositeEC)
    assert composite.context.groups == (("Motor0", "Sensor0"), ("Controller0",))
    assert len(composite.organization.members) == 3
    composite.exit()


class Foreign:
    """A member of another process that may have gone."""

    def __init__(self, name: str) -> None:
        self.instance_name = name
        self.actor = Actor(name)
        self.calls: list[str] = []
        self.broken = False

    @property
    def participant(self) -> Participant:
        return self.actor

    def suspend(self) -> None:
        if self.broken:
            raise PeerLostError("no answer")
        self.calls.append("suspend")

    def resume(self) -> None:
        self.calls.append("resume")

    def join(self, organization: Organization) -> None:
        self.calls.append("join")

    def leave(self, organization: Organization) -> None:
        self.calls.append("leave")

    def ports(self) -> tuple[Port, ...]:
        return ()


def test_members_of_other_processes(stage: Stage) -> None:
    there, gone = Foreign("There0"), Foreign("Gone0")
    gone.broken = True
    found: dict[str, Any] = {"There0": there, "Gone0": gone}
    composite = PeriodicECSharedComposite(found.get)
    composite.configure(
        "c0", {"conf.default.members": "Gone0,There0", "exec_cxt.periodic.type": "SynchExtTriggerEC"}
    )
    assert composite.initialize() is OK
    assert isinstance(composite.context, SynchronousExecutionContext)
    assert there.calls == ["suspend", "join"]
    assert composite.reporter.findings.counts() == {"rtc-member-failed": 1}
    composite.context.activate_component(composite.participation)
    composite.context.tick()
    assert there.actor.calls[-2:] == [("onExecute", 1000), ("onStateUpdate", 1000)]
    there.actor.lost = True
    composite.context.tick()
    assert there.instance_name not in [member.instance_name for member in composite.organization.members]
    assert there.calls == ["suspend", "join", "leave", "resume"]
    composite.exit()


def test_organizations() -> None:
    owner = Component()
    organization = Organization(owner, id_="x", dependency=Dependency.NO_DEPENDENCY)
    told: list[Any] = []
    organization.on_change(lambda added, removed: told.append((added, removed)))
    parts = [LocalMember(Part(name, [])) for name in "abc"]
    organization.set_members([*parts[:2], parts[0]])
    organization.add_members(parts[1:])
    organization.set_members(parts)
    assert organization.members == tuple(parts)
    assert told == [(tuple(parts[:2]), ()), ((parts[2],), ())]
    assert parts[0] == LocalMember(parts[0].component) != parts[1]
    assert len({parts[0], LocalMember(parts[0].component)}) == 1
    mine = organizations_of(owner)
    mine.join("x", organization)
    mine.join("x", organization)
    assert mine.joined == (organization,)
    assert mine.leave("x")
    assert not mine.leave("x")


def test_what_tools_change_while_a_member_is_slow_to_come_is_done_then(stage: Stage) -> None:
    """A second tool takes the member out again before it has been taken in: the context agrees in the end."""
    composite = stage.composite("")
    slow, sensor = Foreign("Slow0"), LocalMember(stage.parts["Sensor0"])
    came, go = threading.Event(), threading.Event()

    def suspend() -> None:
        came.set()
        assert go.wait(10)

    slow.suspend = suspend  # type: ignore[method-assign]
    first = threading.Thread(target=composite.organization.set_members, args=([slow],))
    first.start()
    assert came.wait(10)
    composite.organization.set_members([sensor])
    go.set()
    first.join(10)
    assert composite.organization.members == (sensor,)
    assert composite.context.participants == (sensor.participant,)
    assert slow.calls == ["join", "leave", "resume"]
    composite.exit()


def test_nothing_is_kept_of_what_has_ended(stage: Stage) -> None:
    composite = stage.composite("Motor0,Sensor0", "Motor0.out")
    composite.context.activate_component(composite.participation)
    composite.exit()
    gone: list[weakref.ref[Any]] = [
        weakref.ref(one) for one in (composite, composite.context, composite.organization)
    ]
    del composite
    gc.collect()
    assert [reference() for reference in gone] == [None] * 3
