"""Composites over CORBA: members in other processes, organizations as editors change them."""

from collections.abc import Iterator
from typing import Any

import pytest

from muros.findings import Finding
from muros.rtc.composite import PeriodicECSharedComposite
from muros.rtc.corba import (
    NameServer,
    Objects,
    Orb,
    RunningNameServer,
    _configuration,
    _organization,
    set_up,
)
from muros.rtc.corba._conversion import to_nv_list
from muros.rtc.corba._organization import ForeignMember
from muros.rtc.corba._stubs import RTC, OpenRTM, OpenRTM__POA, SDOPackage
from tests.rtc.corba._world import World


@pytest.fixture(scope="module")
def world(
    orb: Orb, shared_name_server: RunningNameServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[World]:
    one = World(orb, shared_name_server, tmp_path_factory.mktemp("members"))
    yield one
    one.process.end()


class Composed:
    """A composite of this process, with members of another."""

    def __init__(self, orb: Orb, world: World) -> None:
        self.findings: list[Finding] = []
        self.objects: Objects = set_up(orb)
        self._server = NameServer(orb, world.root[1:])
        self.composite = PeriodicECSharedComposite(lambda name: ForeignMember(self.find(name), self.objects))
        self.composite.configure(
            "Both0",
            {
                "conf.default.members": "Giver0,Taker0",
                "conf.default.exported_ports": "Taker0.inp",
                "exec_cxt.periodic.rate": "100",
            },
        )
        self.composite.reporter.on_finding(self.findings.append)
        assert self.composite.initialize() == 0
        self.reference = self.objects.offer(self.composite)

    def find(self, name: str) -> Any:
        """The reference to a component of the other process."""
        return self._server.resolve(f"test.host_cxt/{name}.rtc")._narrow(OpenRTM.DataFlowComponent)  # type: ignore[union-attr]

    def end(self) -> None:
        self.composite.exit()
        self.objects.withdraw(self.composite)


@pytest.fixture
def composed(orb: Orb, world: World) -> Iterator[Composed]:
    one = Composed(orb, world)
    yield one
    one.end()


def test_members_of_another_process_run_in_the_context_of_the_composite(
    world: World, composed: Composed
) -> None:
    giver, taker = composed.find("Giver0"), composed.find("Taker0")
    (context,) = composed.reference.get_owned_contexts()
    assert not giver.get_owned_contexts()[0].is_running()
    assert [len(one.get_participating_contexts()) for one in (giver, taker)] == [1, 1]
    assert giver.get_participating_contexts()[0]._is_equivalent(context)
    profile = context.get_profile()
    assert [
        one._is_equivalent(other) for one, other in zip(profile.participants, (giver, taker), strict=True)
    ] == [True, True]
    out, inp = giver.get_ports()[0], composed.reference.get_ports()[0]
    assert inp._is_equivalent(taker.get_ports()[0])
    assert [one.name for one in composed.reference.get_component_profile().port_profiles] == ["Taker0.inp"]
    properties = to_nv_list(
        {
            "dataport.interface_type": "corba_cdr",
            "dataport.dataflow_type": "push",
            "dataport.subscription_type": "flush",
        }
    )
    code, connection = out.connect(RTC.ConnectorProfile("c", "", [out, inp], properties))
    assert code == RTC.RTC_OK
    world.process.forget()
    context.activate_component(composed.reference)
    world.process.until(r"got \d+")
    assert context.get_component_state(giver) == RTC.ACTIVE_STATE
    assert giver.get_participating_contexts()[0].get_component_state(giver) == RTC.ACTIVE_STATE
    context.deactivate_component(composed.reference)
    world.until(lambda: context.get_component_state(giver) == RTC.INACTIVE_STATE)
    out.disconnect(connection.connector_id)


def test_tools_see_who_belongs_to_whom(world: World, composed: Composed) -> None:
    giver = composed.find("Giver0")
    (owned,) = composed.reference.get_owned_organizations()
    (joined,) = giver.get_organizations()
    assert joined._is_equivalent(owned)
    assert giver.get_owned_organizations() == []
    assert owned.get_organization_id() == joined.get_organization_id() != ""
    assert owned.get_owner()._is_equivalent(composed.reference)
    assert owned.get_dependency() == SDOPackage.OWN
    assert [member.get_sdo_id() for member in owned.get_members()] == ["Giver0", "Taker0"]
    assert "Monolithic composite member" in world.run("rtcat", "-l", world.giver)


def test_editors_change_the_members(world: World, composed: Composed) -> None:
    (organization,) = composed.reference.get_owned_organizations()
    giver = composed.find("Giver0")
    assert organization.remove_member("Giver0")
    assert [member.get_sdo_id() for member in organization.get_members()] == ["Taker0"]
    assert giver.get_organizations() == giver.get_participating_contexts() == []
    assert giver.get_owned_contexts()[0].is_running()
    with pytest.raises(SDOPackage.InvalidParameter):
        organization.remove_member("Giver0")
    assert organization.add_members([giver])
    assert organization.add_members([giver])
    assert [member.get_sdo_id() for member in organization.get_members()] == ["Taker0", "Giver0"]
    assert organization.set_members([giver])
    assert [member.get_sdo_id() for member in organization.get_members()] == ["Giver0"]
    for wrong in (None, organization):
        with pytest.raises(SDOPackage.InvalidParameter):
            organization.add_members([wrong])
    with pytest.raises(SDOPackage.NotAvailable):
        organization.set_owner(giver)
    values = to_nv_list({"a": "1"})
    assert organization.add_organization_property(SDOPackage.OrganizationProperty(values))
    assert organization.set_organization_property_value("b", values[0].value)
    assert [one.name for one in organization.get_organization_property().properties] == ["a", "b"]
    assert organization.get_organization_property_value("a").value() == "1"
    assert organization.remove_organization_property("a")
    for missing in (organization.remove_organization_property, organization.get_organization_property_value):
        with pytest.raises(SDOPackage.InvalidParameter):
            missing("a")


def test_others_can_not_fill_the_memory(composed: Composed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_organization, "PROPERTIES", 2)
    monkeypatch.setattr(_configuration, "ORGANIZATIONS", 1)
    (organization,) = composed.reference.get_owned_organizations()
    values = to_nv_list({"a": "1", "b": "2"})
    assert organization.add_organization_property(SDOPackage.OrganizationProperty(values))
    assert organization.set_organization_property_value("b", values[0].value)
    with pytest.raises(SDOPackage.NotAvailable, match="2 properties at most"):
        organization.set_organization_property_value("c", values[0].value)
    configuration = composed.reference.get_configuration()
    assert configuration.add_organization(organization)
    with pytest.raises(SDOPackage.NotAvailable, match="1 organizations at most"):
        configuration.add_organization(organization)
    assert configuration.remove_organization(organization.get_organization_id())


def test_a_composite_that_shows_foreign_ports_is_observed(orb: Orb, composed: Composed) -> None:
    class Deaf(OpenRTM__POA.ComponentObserver):  # type: ignore[misc]
        def update_status(self, status_kind: Any, hint: str) -> None: ...

    servant = Deaf()
    configuration = composed.reference.get_configuration()
    try:
        given = SDOPackage.ServiceProfile(
            "editor", "IDL:OpenRTM/ComponentObserver:1.0", to_nv_list({}), orb.activate(servant)
        )
        assert configuration.add_service_profile(given)
        assert configuration.remove_service_profile("editor")
    finally:
        orb.deactivate(servant)


def test_members_are_free_again_when_the_composite_ends(world: World, composed: Composed) -> None:
    giver = composed.find("Giver0")
    composed.reference.exit()
    assert giver.get_organizations() == giver.get_participating_contexts() == []
    assert giver.get_owned_contexts()[0].is_running()


def test_a_member_whose_process_ends_is_a_member_no_longer(world: World, composed: Composed) -> None:
    (organization,) = composed.reference.get_owned_organizations()
    (context,) = composed.reference.get_owned_contexts()
    context.activate_component(composed.reference)
    world.process.end(kill=True)
    world.until(lambda: organization.get_members() == [])
    assert "rtc-member-lost" in {finding.code for finding in composed.findings}
    world.process = world.start()
