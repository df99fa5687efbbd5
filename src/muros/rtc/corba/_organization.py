"""Organizations over CORBA: composites as editors change them, and members of composites in other processes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from omniORB import CORBA

from muros.rtc.codes import LifeCycleState
from muros.rtc.contexts import Participant
from muros.rtc.corba._foreign import ForeignComponent
from muros.rtc.corba._lost import asked_again, peer
from muros.rtc.corba._port import ForeignPort
from muros.rtc.corba._stubs import RTC, SDOPackage, SDOPackage__POA
from muros.rtc.organization import Dependency, Member, Organization, OrganizationError

if TYPE_CHECKING:
    from muros.rtc.corba._objects import Objects

__all__ = ["ForeignMember", "OrganizationServant"]

PROPERTIES: Final = 1000
"""Properties that an organization may have before others can add no more."""


class OrganizationServant(SDOPackage__POA.Organization):  # type: ignore[misc]
    """SDOPackage::Organization. SDO 1.1, 2.6."""

    def __init__(self, organization: Organization, objects: Objects) -> None:
        self.organization: Final = organization
        self._objects = objects

    def get_organization_id(self) -> str:
        return self.organization.id

    def get_organization_property(self) -> Any:
        values = [SDOPackage.NameValue(name, value) for name, value in self.organization.properties.items()]
        return SDOPackage.OrganizationProperty(values)

    def get_organization_property_value(self, name: str) -> Any:
        return self.organization.properties[self._known(name)]

    def add_organization_property(self, organization_property: Any) -> bool:
        self._put({one.name: one.value for one in organization_property.properties})
        return True

    def set_organization_property_value(self, name: str, value: Any) -> bool:
        if not name:
            raise SDOPackage.InvalidParameter("the name of the property is empty")
        self._put({name: value})
        return True

    def remove_organization_property(self, name: str) -> bool:
        del self.organization.properties[self._known(name)]
        return True

    def get_owner(self) -> Any:
        return self._objects.component(self.organization.owner)

    def set_owner(self, sdo: Any) -> bool:
        """A composite is owned by the component that it is."""
        raise SDOPackage.NotAvailable("the owner of this organization cannot be changed")

    def get_members(self) -> list[Any]:
        return [self._objects.member(one) for one in self.organization.members]

    def set_members(self, sdos: list[Any]) -> bool:
        self.organization.set_members([self._member(one) for one in sdos])
        return True

    def add_members(self, sdo_list: list[Any]) -> bool:
        self.organization.add_members([self._member(one) for one in sdo_list])
        return True

    def remove_member(self, id: str) -> bool:
        try:
            self.organization.remove_member(id)
        except OrganizationError as error:
            raise SDOPackage.InvalidParameter(str(error)) from error
        return True

    def get_dependency(self) -> Any:
        return SDOPackage.DependencyType._items[self.organization.dependency]

    def set_dependency(self, dependency: Any) -> bool:
        self.organization.dependency = Dependency(dependency._v)
        return True

    def _put(self, values: dict[str, Any]) -> None:
        properties = self.organization.properties
        if len(properties.keys() | values.keys()) > PROPERTIES:
            raise SDOPackage.NotAvailable(f"an organization has {PROPERTIES} properties at most")
        properties.update(values)

    def _known(self, name: str) -> str:
        if name not in self.organization.properties:
            raise SDOPackage.InvalidParameter(f"there is no property '{name}'")
        return name

    def _member(self, reference: Any) -> Member:
        try:
            component = (
                asked_again(lambda: reference._narrow(RTC.RTObject)) if reference is not None else None
            )
        except CORBA.Exception:
            component = None
        if component is None:
            raise SDOPackage.InvalidParameter("a member must be a component that lives")
        return self._objects.member_behind(component)


class ForeignMember:
    """A component of another process as a `Member`. Its operations raise PeerLostError when it does not answer."""

    def __init__(self, reference: Any, objects: Objects) -> None:
        self.component: Final = ForeignComponent(reference, objects)
        self._objects = objects

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ForeignMember) and other.component == self.component

    def __hash__(self) -> int:
        return hash(self.component)

    def __repr__(self) -> str:
        return f"<{self.instance_name}>"

    @property
    def reference(self) -> Any:
        """The RTC::RTObject."""
        return self.component.reference

    @property
    def instance_name(self) -> str:
        """Its SDO id; "" where it never answered."""
        return self.component.instance_name

    @property
    def participant(self) -> Participant:
        """As contexts call it."""
        return self.component

    def suspend(self) -> None:
        """Its own contexts stand still; it is not active in them any more."""
        with peer(self.instance_name):
            for context in self.reference.get_owned_contexts():
                if context.get_component_state(self.reference)._v == LifeCycleState.ACTIVE_STATE:
                    context.deactivate_component(self.reference)
                context.stop()

    def resume(self) -> None:
        """Its own contexts run again."""
        with peer(self.instance_name):
            for context in self.reference.get_owned_contexts():
                context.start()

    def join(self, organization: Organization) -> None:
        """It belongs to an organization."""
        with peer(self.instance_name):
            self.reference.get_configuration().add_organization(self._objects.organization(organization))

    def leave(self, organization: Organization) -> None:
        """It belongs to it no longer."""
        with peer(self.instance_name):
            self.reference.get_configuration().remove_organization(organization.id)

    def ports(self) -> tuple[Any, ...]:
        """Its ports, as `ForeignPort`s."""
        with peer(self.instance_name):
            return tuple(ForeignPort(one, self._objects) for one in self.reference.get_ports())
