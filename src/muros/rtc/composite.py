"""Composites: several components that run in one execution context, and look like one.

A composite takes its members out of their own contexts into its own, in the order in which they are named: they are
called one after the other in each pass, and come active and inactive with the composite. Ports that it exports appear
as its own. Who belongs to it is said by its parameters `members` and `exported_ports`, or by tools, through its
organization.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import ClassVar, Final

from muros.findings import Severity
from muros.rtc.codes import LifeCycleState, PeerLostError, ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.configuration import ConfigEvent, ConfigurationSet
from muros.rtc.contexts import ContextEvent, ContextEventKind, ExecutionContext, MultilayerCompositeEC
from muros.rtc.organization import LocalMember, Member, Organization, organizations_of
from muros.rtc.ports import Port
from muros.rtc.profiles import ComponentProfile
from muros.rtc.properties import split_list

__all__ = ["PeriodicECSharedComposite"]

OK: Final = ReturnCode.RTC_OK


class PeriodicECSharedComposite(Component):
    """PeriodicECSharedComposite"""

    type_name: ClassVar[str] = "PeriodicECSharedComposite"
    version: ClassVar[str] = "1.0"
    vendor: ClassVar[str] = "jp.go.aist"
    category: ClassVar[str] = "composite.PeriodicECShared"
    specification: ClassVar[dict[str, str]] = {
        "exec_cxt.periodic.sync_transition": "NO",
        "exec_cxt.periodic.sync_activation": "NO",
        "exec_cxt.periodic.sync_deactivation": "NO",
        "exec_cxt.periodic.sync_reset": "NO",
        "conf.default.members": "",
        "conf.default.exported_ports": "",
    }

    def __init__(self, find_member: Callable[[str], Member | Component | None] = lambda name: None) -> None:
        """`find_member` gives the component of an instance name, here or in another process."""
        super().__init__()
        self._find_member = find_member
        self._exporting: tuple[str, ...] = ()
        self._exported: tuple[Port, ...] = ()
        self._following = self._settling = self._stale = False
        self._taken: list[Member] = []
        self.organization: Final = Organization(self)
        self.organization.on_change(self._members_changed)
        organizations_of(self).add_owned(self.organization)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Its own ports, if any, then those of members that it exports."""
        return (*super().ports, *self._exported)

    def port(self, name: str) -> Port:
        """An exported port by its full name, `<member>.<port>`; others as with all components."""
        for port in self._exported:
            if name in (port.full_name, f"{self.instance_name}.{port.full_name}"):
                return port
        return super().port(name)

    def profile(self) -> ComponentProfile:
        """As tools see it. Who looks finds out that the process of an exported port has gone, with a member in it."""
        gone = {port for port in self._exported if not port.is_there()}
        for member in self.organization.members if gone else ():
            try:
                lost = not gone.isdisjoint(member.ports())
            except PeerLostError:
                lost = True
            if lost:
                self.organization.remove_member(member.instance_name)
        return super().profile()

    @property
    def context(self) -> ExecutionContext:
        """The context that its members share. RtcError for a composite without one."""
        if not self.owned_contexts:
            raise RtcError(f"{self.instance_name} has no execution context, which its members are to share")
        return self.owned_contexts[0]

    # The actions

    def on_initialize(self) -> ReturnCode:
        """Take the members in that the configuration names."""
        self.configuration.bind("members", "", str)
        self.configuration.bind("exported_ports", "", str)
        self.context.on_event(self._context_event)
        values = self.configuration.get(self.configuration.active_id).values
        self._exporting = _unique(split_list(self._said("exported_ports", values)))
        self._take_members(self._said("members", values))
        for event in (ConfigEvent.SET_CONFIG_SET, ConfigEvent.ADD_CONFIG_SET):
            self.configuration.listeners.add(event, self._set_changed)
        self.configuration.listeners.add(ConfigEvent.ACTIVATE_CONFIG_SET, self._set_activated)
        return OK

    def on_activated(self, context: int) -> ReturnCode:
        """Members come active with it."""
        for member in self.organization.members:
            self.context.activate_component(member.participant)
        return OK

    def on_deactivated(self, context: int) -> ReturnCode:
        """Members come inactive with it."""
        for member in self.organization.members:
            self.context.deactivate_component(member.participant)
        return OK

    def on_reset(self, context: int) -> ReturnCode:
        """Members that are in Error are reset with it."""
        for member in self.organization.members:
            if self.context.get_component_state(member.participant) is LifeCycleState.ERROR_STATE:
                self.context.reset_component(member.participant)
        return OK

    def on_finalize(self) -> ReturnCode:
        """Members run by themselves again."""
        self.organization.set_members(())
        return OK

    # Members

    def _said(self, key: str, values: Mapping[str, str]) -> str:
        """What the configuration says, and what the request that made it said beside that."""
        return ",".join(filter(None, (values.get(key, ""), self.properties.get(key, ""))))

    def _take_members(self, text: str) -> None:
        """Have the members that a text names: `a,b`, or `a,b|c,d` in groups that run side by side."""
        if self.owned_contexts and isinstance(self.context, MultilayerCompositeEC):
            self.context.set_groups(text)
        members = []
        for name in _unique(split_list(text.replace("|", ","))):
            found = self._find_member(name)
            if found is None or found is self:
                self.reporter.report(
                    "rtc-member-not-found",
                    who=self.instance_name,
                    what=f"member {name} is not taken in",
                    why="a composite cannot be a member of itself"
                    if found is self
                    else "there is no such component",
                    remedy="Make the members before the composite, or name others in its parameter 'members'",
                    subject=name,
                )
                continue
            members.append(LocalMember(found) if isinstance(found, Component) else found)
        self._following = True
        try:
            self.organization.set_members(members)
        finally:
            self._following = False
        self._export()

    def _members_changed(self, added: tuple[Member, ...], removed: tuple[Member, ...]) -> None:
        """Bring context and members in line with the organization.

        One thread at a time does so; it goes on to what others have changed meanwhile.
        """
        with self._lock:
            self._stale = True
            if self._settling:
                return
            self._settling = True
        while True:
            with self._lock:
                if not self._stale:
                    self._settling = False
                    break
                self._stale = False
            wanted = self.organization.members
            for member in [member for member in self._taken if member not in wanted]:
                self._taken.remove(member)
                self._each(member, "let go", self._let_go)
            for member in [member for member in wanted if member not in self._taken]:
                self._taken.append(member)
                self._each(member, "taken in", self._take_in)
        if not self._following:
            self._export()
            self._write_down()

    def _take_in(self, member: Member) -> None:
        member.suspend()
        self.context.add_component(member.participant)
        member.join(self.organization)

    def _let_go(self, member: Member) -> None:
        self.context.remove_component(member.participant)
        member.leave(self.organization)
        member.resume()

    def _each(self, member: Member, what: str, action: Callable[[Member], None]) -> None:
        """What goes wrong with one member is said and stops nothing."""
        try:
            action(member)
        except Exception as error:
            self.reporter.report(
                "rtc-member-failed",
                who=self.instance_name,
                what=f"member {member.instance_name} was not {what} as it should be",
                why=f"{type(error).__name__}: {error}",
                subject=member.instance_name,
                severity=Severity.ERROR,
            )

    def _export(self) -> None:
        """Look for the exported ports among those of the members."""
        ports: list[Port] = []
        missing = []
        for name in self._exporting:
            owner = name.partition(".")[0]
            member = next((m for m in self.organization.members if m.instance_name == owner), None)
            found = [port for port in member.ports() if port.full_name == name] if member is not None else []
            ports += found
            if not found:
                missing.append(name)
        self._exported = tuple(ports)
        for name in missing:
            self.reporter.report(
                "rtc-port-not-exported",
                who=self.instance_name,
                what=f"port {name} is not exported",
                why="no member has it",
                remedy="Write it as <member>.<port> in the parameter 'exported_ports'",
                subject=name,
            )

    # Configuration and context

    def _set_changed(self, given: ConfigurationSet) -> None:
        if given.id == self.configuration.active_id:
            self._follow()

    def _set_activated(self, id_: str) -> None:
        self._follow()

    def _follow(self) -> None:
        """Be made of what the active configuration set says."""
        values = self.configuration.get(self.configuration.active_id).values
        self._exporting = split_list(values.get("exported_ports", ""))
        if split_list(values.get("members", "").replace("|", ",")) != self._names():
            self._take_members(values.get("members", ""))
        else:
            self._export()

    def _write_down(self) -> None:
        """Let the active configuration set say who belongs to it, where tools have changed that."""
        if not self.is_initialized:
            return
        id_ = self.configuration.active_id
        text = self.configuration.get(id_).values.get("members", "")
        if split_list(text.replace("|", ",")) != self._names():
            self.configuration.set_values(ConfigurationSet(id_, values={"members": ",".join(self._names())}))
            self.configuration.activate(id_)

    def _names(self) -> tuple[str, ...]:
        return tuple(member.instance_name for member in self.organization.members)

    def _context_event(self, event: ContextEvent) -> None:
        """A member that ended, or whose process did, has left the context: it is a member no longer."""
        if event.kind is ContextEventKind.DISMISSED:
            left = [m.instance_name for m in self.organization.members if m.participant == event.component]
            for name in left:
                self.organization.remove_member(name)


def _unique(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(names))
