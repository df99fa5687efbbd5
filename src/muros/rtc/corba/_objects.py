"""What this process offers to others, and what it knows of theirs: the model's objects and their references.

Each component, port and context of the model that others ask for gets a servant, once; `component`, `port` and
`context` give the reference to it, and `port_behind`, `participant_behind` and `context_behind` go the other way: to
the model's own object where the reference leads into this process, else to one that stands for it (`ForeignPort` ...).
So a port that is connected with one of the same process is called directly, and two references to the same object are
one peer.

`offer` makes a component known; `withdraw` takes it away with all that belongs to it, so that nothing stays behind.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final
from weakref import WeakKeyDictionary, WeakSet

from muros.findings import Finding
from muros.rtc.codes import RtcError
from muros.rtc.corba._conversion import from_nv_list, to_interface, to_nv_list
from muros.rtc.corba._orb import Orb
from muros.rtc.corba._stubs import RTC
from muros.rtc.organization import LocalMember
from muros.rtc.profiles import ConnectorProfile, PortProfile

if TYPE_CHECKING:
    from muros.rtc.component import Component
    from muros.rtc.contexts import ExecutionContext, Participant
    from muros.rtc.corba._component import ComponentServant
    from muros.rtc.organization import Member, Organization
    from muros.rtc.ports import Port
    from muros.rtc.profiles import PeerPort

__all__ = ["Objects"]


class Objects:
    """The servants of one ORB. Any thread may call. `report` takes findings."""

    def __init__(self, orb: Orb, *, report: Callable[[Finding], object] = lambda finding: None) -> None:
        self.orb: Final = orb
        self._report = report
        self._lock = threading.RLock()
        self._servants: dict[object, Any] = {}
        """By the model's object."""
        self._references: WeakKeyDictionary[object, Any] = WeakKeyDictionary()
        """Of these, and of those that were withdrawn: profiles of others may still name them."""
        self._gone: WeakSet[object] = WeakSet()
        """What was withdrawn: nobody becomes callable again by being mentioned."""

    # ---- from the model to references

    def offer(self, component: Component, key: str = "") -> Any:
        """Let others call `component`, by `corbaloc::HOST:PORT/KEY`, too. The reference, an RTC::RTObject."""
        with self._lock:
            self._gone.discard(component)
            return self._offered(component, key)

    def withdraw(self, component: Component) -> None:
        """Take `component` away, with its ports, its contexts that have ended, its configuration and observers."""
        with self._lock:
            servant: ComponentServant | None = self._servants.get(component)
            gone: list[Any] = []
            for model in tuple(self._servants):
                if component in (model, getattr(model, "owner", None)) or getattr(model, "is_closed", False):
                    gone.append(self._servants.pop(model))
                    self._gone.add(model)
        if servant is not None:
            servant.close()
        for one in gone:
            self.orb.deactivate(one)

    def part_with_the_gone(self) -> None:
        """Let components part with what other processes have left behind: asks these, which may take its time."""
        for servant in self.belonging_elsewhere():
            servant.part_with_the_gone()

    def belonging_elsewhere(self) -> list[ComponentServant]:
        """The components that have contexts or organizations of other processes. Nobody is asked."""
        from muros.rtc.component import Component

        with self._lock:
            servants = [servant for model, servant in self._servants.items() if isinstance(model, Component)]
        return [servant for servant in servants if servant.belongs_elsewhere()]

    def component(self, component: Component) -> Any:
        """The reference to a component of this process."""
        return self._offered(component)

    def port(self, port: PeerPort) -> Any:
        """The reference to a port, of this process or another. RtcError for what is neither."""
        from muros.rtc.corba._port import ForeignPort, PortServant
        from muros.rtc.ports import Port

        if isinstance(port, ForeignPort):
            return port.reference
        if not isinstance(port, Port):
            raise RtcError(f"{port!r} is no port that other processes could be told of")
        return self._reference(port, lambda: PortServant(port, self))

    def drop_port(self, port: Port) -> None:
        """A port has been removed from its component: nobody can call it any more."""
        with self._lock:
            servant = self._servants.pop(port, None)
            self._gone.add(port)
        if servant is not None:
            self.orb.deactivate(servant)

    def participant(self, participant: Participant | None) -> Any | None:
        """The reference to a component as contexts know it; nil for nobody."""
        from muros.rtc.corba._foreign import ForeignComponent
        from muros.rtc.participation import Participation

        if isinstance(participant, ForeignComponent):
            return participant.reference
        return self.component(participant.component) if isinstance(participant, Participation) else None

    def context(self, context: ExecutionContext) -> Any:
        """The reference to a context, of this process or another."""
        from muros.rtc.corba._context import servant_for
        from muros.rtc.corba._foreign import ForeignContext

        if isinstance(context, ForeignContext):
            return context.reference
        return self._reference(context, lambda: servant_for(context, self))

    def organization(self, organization: Organization) -> Any:
        """The reference to an organization that a component of this process owns."""
        from muros.rtc.corba._organization import OrganizationServant

        return self._reference(organization, lambda: OrganizationServant(organization, self))

    def member(self, member: Member) -> Any:
        """The reference to a member of an organization."""
        return self.participant(member.participant)

    def port_profile(self, profile: PortProfile) -> Any:
        """As RTC::PortProfile."""
        return RTC.PortProfile(
            profile.name,
            [to_interface(one) for one in profile.interfaces],
            self.port(profile.port),
            [self.connector(one) for one in profile.connectors],
            self._owner(profile.owner),
            to_nv_list(profile.properties),
        )

    def connector(self, profile: ConnectorProfile) -> Any:
        """As RTC::ConnectorProfile."""
        return RTC.ConnectorProfile(
            profile.name,
            profile.connector_id,
            [self.port(one) for one in profile.ports],
            to_nv_list(profile.properties),
        )

    # ---- from references to the model

    def connector_behind(self, profile: Any) -> ConnectorProfile:
        """Of an RTC::ConnectorProfile. RtcError if a port of it is nil."""
        return ConnectorProfile(
            profile.name,
            profile.connector_id,
            tuple(self.port_behind(one) for one in profile.ports),
            from_nv_list(profile.properties),
        )

    def member_behind(self, reference: Any) -> Member:
        """The component that a reference leads to, as an organization has it. RtcError for nil."""
        from muros.rtc.corba._component import ComponentServant
        from muros.rtc.corba._organization import ForeignMember

        servant = self._local(reference, "component")
        return (
            LocalMember(servant.component)
            if isinstance(servant, ComponentServant)
            else ForeignMember(reference, self)
        )

    def organization_behind(self, reference: Any) -> object:
        """The organization that a reference leads to; the reference itself if that is another process's."""
        from muros.rtc.corba._organization import OrganizationServant

        servant = self._local(reference, "organization")
        return servant.organization if isinstance(servant, OrganizationServant) else reference

    def port_behind(self, reference: Any) -> PeerPort:
        """The port that a reference leads to. RtcError for nil."""
        from muros.rtc.corba._port import ForeignPort, PortServant

        servant = self._local(reference, "port")
        return servant.port if isinstance(servant, PortServant) else ForeignPort(reference, self)

    def participant_behind(self, reference: Any) -> Participant:
        """The component that a reference leads to, as contexts call it. RtcError for nil."""
        from muros.rtc.corba._component import ComponentServant
        from muros.rtc.corba._foreign import ForeignComponent

        servant = self._local(reference, "component")
        if isinstance(servant, ComponentServant):
            return servant.component.participation
        return ForeignComponent(reference, self)

    def context_behind(self, reference: Any) -> ExecutionContext:
        """The context that a reference leads to. RtcError for nil."""
        from muros.rtc.corba._context import ContextServant
        from muros.rtc.corba._foreign import ForeignContext

        servant = self._local(reference, "execution context")
        return servant.context if isinstance(servant, ContextServant) else ForeignContext(reference, self)

    def refused(self, who: str, what: str, error: RtcError) -> None:
        """A request of somebody's made no sense: a finding."""
        self._report(Finding("request-refused", who, what, str(error), subject=what))

    # ---- inside

    def _owner(self, owner: object) -> Any:
        from muros.rtc.component import Component
        from muros.rtc.corba._foreign import ForeignComponent

        if isinstance(owner, ForeignComponent):
            return owner.reference
        return self.component(owner) if isinstance(owner, Component) else RTC.RTObject._nil

    def _local(self, reference: Any, what: str) -> Any | None:
        if reference is None:
            raise RtcError(f"a {what} is named by a nil reference")
        return self.orb.servant_of(reference)

    def _offered(self, component: Component, key: str = "") -> Any:
        from muros.rtc.corba._component import ComponentServant

        return self._reference(component, lambda: ComponentServant(component, self), key)

    def _reference(self, model: object, make: Callable[[], Any], key: str = "") -> Any:
        with self._lock:
            if model in self._gone and model in self._references:
                return self._references[model]
            servant = self._servants.get(model)
            if servant is None:
                servant = self._servants[model] = make()
                self._references[model] = self.orb.activate(servant, key)
            return self._references[model]
