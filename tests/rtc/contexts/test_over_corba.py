"""Contexts, composites and observers between processes, as tools and other components meet them."""

import os
import signal
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from muros.rtc.corba import Orb, RunningNameServer
from muros.rtc.corba._naming import NameServer
from muros.rtc.corba._stubs import RTC, RTC__POA, OpenRTM, OpenRTM__POA, SDOPackage
from tests.rtc.manager._processes import Managers, wait_until

SOON = 20.0
COMPOSITE = "PeriodicECSharedComposite0"
MODULE = """
from muros.rtc import Component, ReturnCode
class Part(Component):
    category = "test"
    calls = 0
    def on_activated(self, context):
        print(self.instance_name, "activated", context, flush=True)
    def on_deactivated(self, context):
        print(self.instance_name, "deactivated", context, flush=True)
    def on_execute(self, context):
        self.calls += 1
        if self.calls == 10:
            print(self.instance_name, "ran", flush=True)
"""


class World:
    """Two processes of ours, and this one as the tool."""

    def __init__(self, orb: Orb, managers: Managers, names: RunningNameServer) -> None:
        self.orb = orb
        self.managers = managers
        self.names = NameServer(orb, names.address)

    def start(self, components: str, *options: str) -> subprocess.Popen[str]:
        """A process with these components."""
        return self.managers.start(
            *("-o", "manager.modules.preload:Part.py"),
            *("-o", f"manager.components.precreate:{components}"),
            *("-o", "naming.formats:%n.rtc"),
            *("-o", "exec_cxt.periodic.rate:100"),
            *("-o", "manager.shutdown_on_nortcs:NO"),
            *options,
        )

    def component(self, name: str) -> Any:
        found = self.names.resolve(f"{name}.rtc")
        assert found is not None
        return found._narrow(RTC.RTObject)

    def state(self, context: Any, component: Any) -> str:
        return str(context.get_component_state(component))


@pytest.fixture
def world(tmp_path: Path, orb: Orb, name_server: RunningNameServer) -> Iterator[World]:
    (tmp_path / "Part.py").write_text(MODULE)
    with Managers(tmp_path, name_server.address) as managers:
        yield World(orb, managers, name_server)


def test_a_composite_runs_a_component_of_another_process(world: World) -> None:
    there = world.start("Part?instance_name=There0")
    prefix = f"composite.PeriodicECShared.{COMPOSITE}.conf.default"
    here = world.start(
        "Part?instance_name=Here0,PeriodicECSharedComposite", "-o", f"{prefix}.members:Here0,There0"
    )
    composite, member, local = (world.component(name) for name in (COMPOSITE, "There0", "Here0"))
    (context,) = composite.get_owned_contexts()
    names = [
        one._narrow(RTC.RTObject).get_component_profile().instance_name
        for one in context._narrow(RTC.ExecutionContextService).get_profile().participants
    ]
    assert names == ["Here0", "There0"]
    (own,) = member.get_owned_contexts()
    assert not own.is_running()
    (shared,) = member.get_participating_contexts()
    assert shared._is_equivalent(context)
    assert member.get_context_handle(shared) == 1000
    (organization,) = member.get_organizations()
    assert organization.get_owner()._is_equivalent(composite)
    assert organization.get_dependency() == SDOPackage.OWN

    assert context.activate_component(composite) == RTC.RTC_OK
    world.managers.wait_for(there, "There0 ran")
    world.managers.wait_for(here, "Here0 ran")
    assert "There0 activated 1000" in world.managers.said(there)
    assert world.state(context, member) == "ACTIVE_STATE"
    assert context.deactivate_component(composite) == RTC.RTC_OK
    world.managers.wait_for(there, "There0 deactivated 1000")

    # A tool takes the member out, and in again.
    assert organization.remove_member("There0")
    assert own.is_running()
    assert member.get_participating_contexts() == []
    assert member.get_organizations() == []
    (owned,) = composite.get_owned_organizations()
    assert owned.add_members([member])
    assert not own.is_running()

    # Its process is killed: the composite and its other member go on.
    assert context.activate_component(composite) == RTC.RTC_OK
    wait_until(lambda: world.state(context, member) == "ACTIVE_STATE")
    os.kill(there.pid, signal.SIGKILL)
    there.wait(SOON)
    wait_until(lambda: len(owned.get_members()) == 1)
    assert world.state(context, local) == "ACTIVE_STATE"
    assert "There0 is no longer called" in world.managers.said(here)
    assert composite.exit() == RTC.RTC_OK
    assert local.get_owned_contexts()[0].is_running()


def test_answers_at_a_low_rate_are_true(world: World) -> None:
    """Where OpenRTM-aist answers RTC_ERROR, as it polls once in 10 s for at most 0.5 s."""
    world.start("Part?instance_name=Slow0&exec_cxt.periodic.rate=0.1")
    component = world.component("Slow0")
    (context,) = component.get_owned_contexts()
    for _ in range(3):
        assert context.activate_component(component) == RTC.RTC_OK
        assert world.state(context, component) == "ACTIVE_STATE"
        assert context.activate_component(component) == RTC.PRECONDITION_NOT_MET
        assert context.set_rate(0.2) == RTC.RTC_OK
        assert context.deactivate_component(component) == RTC.RTC_OK
        assert context.deactivate_component(component) == RTC.PRECONDITION_NOT_MET
    assert context.stop() == RTC.RTC_OK
    assert context.stop() == RTC.PRECONDITION_NOT_MET
    assert context.set_rate(-1.0) == RTC.BAD_PARAMETER


@pytest.mark.parametrize("kind", ["ExtTrigExecutionContext", "SimulatorExecutionContext"])
def test_a_tool_ticks(world: World, kind: str) -> None:
    process = world.start(f"Part?instance_name=Ticked0&exec_cxt.periodic.type={kind}")
    component = world.component("Ticked0")
    (context,) = component.get_owned_contexts()
    context = context._narrow(OpenRTM.ExtTrigExecutionContextService)
    assert context.activate_component(component) == RTC.RTC_OK
    wait_until(lambda: "Ticked0 activated 0" in world.managers.said(process))
    ticks = 0
    while "Ticked0 ran" not in world.managers.said(process):
        context.tick()
        ticks += 1
        assert ticks < 10_000
    assert ticks >= 10
    assert context.deactivate_component(component) == RTC.RTC_OK


class ForeignContext(RTC__POA.ExecutionContextService):  # type: ignore[misc]
    """A context written on the stubs alone, as far as components ask it for something."""

    def __init__(self) -> None:
        self.removed = threading.Event()

    def get_profile(self) -> Any:
        return RTC.ExecutionContextProfile(RTC.PERIODIC, 10.0, None, [], [])

    def get_component_state(self, component: Any) -> Any:
        return RTC.ACTIVE_STATE

    def deactivate_component(self, component: Any) -> Any:
        return RTC.RTC_OK

    def remove_component(self, component: Any) -> Any:
        self.removed.set()
        return RTC.RTC_OK


def test_a_context_of_others_drives_a_component_of_ours(world: World) -> None:
    process = world.start("Part?instance_name=Driven0")
    component = world.component("Driven0")._narrow(OpenRTM.DataFlowComponent)
    servant = ForeignContext()
    context = servant._this()
    handle = component.attach_context(context)
    assert handle == 1000
    assert [one._is_equivalent(context) for one in component.get_participating_contexts()] == [True]
    assert component.get_context(handle)._is_equivalent(context)
    assert component.get_context_handle(context) == handle
    assert component.on_startup(handle) == RTC.RTC_OK
    assert component.on_activated(handle) == RTC.RTC_OK
    for _ in range(10):
        assert component.on_execute(handle) == RTC.RTC_OK
        assert component.on_state_update(handle) == RTC.RTC_OK
    world.managers.wait_for(process, "Driven0 ran")
    assert "Driven0 activated 1000" in world.managers.said(process)
    second = component.attach_context(ForeignContext()._this())
    assert second == 1001
    assert component.detach_context(second) == RTC.RTC_OK
    assert component.detach_context(second) == RTC.BAD_PARAMETER
    assert component.exit() == RTC.RTC_OK
    assert servant.removed.wait(SOON)


@pytest.mark.parametrize("dialect", [OpenRTM, RTC])
def test_observers_hear_of_a_component(world: World, dialect: Any) -> None:
    class Ears((OpenRTM__POA if dialect is OpenRTM else RTC__POA).ComponentObserver):  # type: ignore[misc]
        def update_status(self, kind: Any, hint: str) -> None:
            with changed:
                heard.append(f"{kind} {hint}".strip())
                changed.notify_all()

    heard: list[str] = []
    changed = threading.Condition()
    world.start("Part?instance_name=Seen0")
    component = world.component("Seen0")
    (context,) = component.get_owned_contexts()
    ears = Ears()
    profile = SDOPackage.ServiceProfile(
        "ears",
        dialect.ComponentObserver._NP_RepositoryId,
        [SDOPackage.NameValue("observed_status", _text("ALL")), *_texts("heartbeat", "YES", "0.05")],
        ears._this(),
    )
    assert component.get_configuration().add_service_profile(profile)
    context.activate_component(component)
    context.set_rate(50.0)
    context.deactivate_component(component)
    expected = ["RTC_STATUS ACTIVE:0", "EC_STATUS RATE_CHANGED:0", "RTC_STATUS INACTIVE:0"]
    beat = "HEARTBEAT" if dialect is OpenRTM else "RTC_HEARTBEAT"
    with changed:
        assert changed.wait_for(lambda: beat in heard and heard[-1:] and expected[-1] in heard, SOON)
        assert [line for line in heard if line != beat] == expected
    assert component.get_configuration().remove_service_profile("ears")


def _text(value: str) -> Any:
    from omniORB import any as conversions

    return conversions.to_any(value)


def _texts(key: str, enable: str, interval: str) -> list[Any]:
    return [
        SDOPackage.NameValue(f"{key}.enable", _text(enable)),
        SDOPackage.NameValue(f"{key}.interval", _text(interval)),
    ]
