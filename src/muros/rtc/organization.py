"""Organizations: which component holds which others together. SDO 1.1, 5.4 (Organization); composites make them.

A component may own organizations and be a member of others'. That is kept beside the component (`organizations_of`),
as only composites and tools ask for it. Members are `Member`s: a component of this process, or one behind CORBA.
"""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import TYPE_CHECKING, Final, Protocol

from muros.rtc.codes import LifeCycleState, RtcError

if TYPE_CHECKING:
    from muros.rtc.component import Component
    from muros.rtc.contexts import Participant
    from muros.rtc.ports import Port

__all__ = [
    "Dependency",
    "LocalMember",
    "Member",
    "Organization",
    "OrganizationError",
    "Organizations",
    "organizations_of",
]


class OrganizationError(RtcError):
    """An organization cannot do what it was asked for (SDOPackage::InvalidParameter)."""


class Dependency(IntEnum):
    """How owner and members stand to each other. SDO 1.1, 5.4.2 (DependencyType)."""

    OWN = 0
    OWNED = 1
    NO_DEPENDENCY = 2


class Member(Protocol):
    """A component as an organization has it. Two that stand for the same component are equal.

    The operations of one in another process raise `PeerLostError` where it does not answer.
    """

    @property
    def instance_name(self) -> str:
        """Its SDO id."""
        ...

    @property
    def participant(self) -> Participant:
        """As contexts call it."""
        ...

    def suspend(self) -> None:
        """Its own contexts stand still: it is called by another one from now on."""
        ...

    def resume(self) -> None:
        """Its own contexts run again."""
        ...

    def join(self, organization: Organization) -> None:
        """It belongs to an organization (SDO Configuration.add_organization)."""
        ...

    def leave(self, organization: Organization) -> None: ...

    def ports(self) -> tuple[Port, ...]:
        """Its ports; what tools see of them is under its own name."""
        ...


class Organization:
    """Members that belong together, and who owns them.

    `owner` is a component of this process. Any thread may call.
    """

    def __init__(self, owner: Component, *, id_: str = "", dependency: Dependency = Dependency.OWN) -> None:
        self.id: Final = id_ or str(uuid.uuid1())
        self.owner: Component = owner
        self.dependency = dependency
        self.properties: dict[str, object] = {}
        """Values by name, as tools set them."""
        self._members: tuple[Member, ...] = ()
        self._watchers: tuple[Callable[[tuple[Member, ...], tuple[Member, ...]], object], ...] = ()
        self._lock = threading.Lock()

    @property
    def members(self) -> tuple[Member, ...]:
        """In the order of their joining."""
        return self._members

    def on_change(self, callback: Callable[[tuple[Member, ...], tuple[Member, ...]], object]) -> None:
        """Call `callback(added, removed)` after every change, in the thread that made it."""
        self._watchers = (*self._watchers, callback)

    def set_members(self, members: Iterable[Member]) -> None:
        """Have these members and no others."""
        wanted = _unique(members)
        with self._lock:
            before, self._members = self._members, wanted
        self._tell(before, wanted)

    def add_members(self, members: Iterable[Member]) -> None:
        """Have these members, too; those that are there already are passed over."""
        with self._lock:
            before, self._members = self._members, _unique((*self._members, *members))
            after = self._members
        self._tell(before, after)

    def remove_member(self, id_: str) -> None:
        """Have the member of that SDO id no longer. OrganizationError where there is none."""
        with self._lock:
            before = self._members
            after = tuple(member for member in before if member.instance_name != id_)
            if len(after) == len(before):
                names = ", ".join(member.instance_name for member in before) or "none"
                raise OrganizationError(f"{id_!r} is not a member; there are {names}")
            self._members = after
        self._tell(before, after)

    def _tell(self, before: tuple[Member, ...], after: tuple[Member, ...]) -> None:
        added = tuple(member for member in after if member not in before)
        removed = tuple(member for member in before if member not in after)
        if added or removed:
            for watcher in self._watchers:
                watcher(added, removed)


class Organizations:
    """What a component has to do with organizations. Any thread may call."""

    def __init__(self) -> None:
        self.owned: tuple[Organization, ...] = ()
        """Those it owns."""
        self.joined: tuple[object, ...] = ()
        """Those it is a member of: an `Organization` of this process, or a reference to one of another."""
        self._ids: dict[str, object] = {}
        self._lock = threading.Lock()

    def add_owned(self, organization: Organization) -> None:
        """It owns one more."""
        with self._lock:
            self.owned = (*self.owned, organization)

    def join(self, id_: str, organization: object) -> None:
        """It is a member of one more; one of the same id is replaced."""
        with self._lock:
            self._ids[id_] = organization
            self.joined = tuple(self._ids.values())

    def leave(self, id_: str) -> bool:
        """It is a member no longer. False where it was none."""
        with self._lock:
            found = self._ids.pop(id_, None) is not None
            self.joined = tuple(self._ids.values())
        return found

    def leave_those(self, have_gone: Callable[[object], bool]) -> bool:
        """It is a member no longer of those that have gone; whether there were any. No lock is held meanwhile."""
        gone = [id_ for id_, one in tuple(self._ids.items()) if have_gone(one)]
        for id_ in gone:
            self.leave(id_)
        return bool(gone)


_lock: Final = threading.Lock()


def organizations_of(component: Component) -> Organizations:
    """The organizations of a component of this process."""
    with _lock:  # they live as long as the component, which knows nothing of them
        found: Organizations = vars(component).setdefault("_organizations", Organizations())
        return found


class LocalMember:
    """A component of this process as a `Member`."""

    def __init__(self, component: Component) -> None:
        self.component: Final = component

    def __eq__(self, other: object) -> bool:
        return isinstance(other, LocalMember) and other.component is self.component

    def __hash__(self) -> int:
        return hash(id(self.component))

    def __repr__(self) -> str:
        return f"<{self.instance_name}>"

    @property
    def instance_name(self) -> str:
        """Its name."""
        return self.component.instance_name

    @property
    def participant(self) -> Participant:
        """As contexts call it."""
        return self.component.participation

    def suspend(self) -> None:
        """Its own contexts stand still; it is not active in them any more."""
        for context in self.component.owned_contexts:
            if context.get_component_state(self.participant) is LifeCycleState.ACTIVE_STATE:
                context.deactivate_component(self.participant)
            context.stop()

    def resume(self) -> None:
        """Its own contexts run again."""
        if self.component.is_initialized:
            for context in self.component.owned_contexts:
                context.start()

    def join(self, organization: Organization) -> None:
        """It belongs to an organization."""
        organizations_of(self.component).join(organization.id, organization)

    def leave(self, organization: Organization) -> None:
        """It belongs to it no longer."""
        organizations_of(self.component).leave(organization.id)

    def ports(self) -> tuple[Port, ...]:
        """Its ports."""
        return self.component.ports


def _unique(members: Iterable[Member]) -> tuple[Member, ...]:
    found: list[Member] = []
    for member in members:
        if member not in found:
            found.append(member)
    return tuple(found)
