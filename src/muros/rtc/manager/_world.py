"""What a manager needs of the world outside its process: an ORB, the name service, other managers.

`muros.rtc.corba` has the real one; tests of the manager's own logic have one in memory. Calls to other processes raise
`PeerLostError` where nobody answers, RtcError where the answer is no.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from muros.rtc.codes import ReturnCode
from muros.rtc.profiles import PeerPort, Reference

if TYPE_CHECKING:
    from muros.rtc.component import Component
    from muros.rtc.manager._manager import Manager
    from muros.rtc.organization import Member
    from muros.rtc.ports import Port

__all__ = ["RemoteManager", "World"]


class RemoteManager(Protocol):
    """A manager of another process. Two that stand for the same one are equal."""

    @property
    def reference(self) -> Reference:
        """As the ORB has it."""
        ...

    def name(self) -> str:
        """Its `manager.instance_name`."""
        ...

    def language(self) -> str:
        """That of the components it can make."""
        ...

    def instance_names(self) -> set[str]:
        """The names of its components and of those of its slaves."""
        ...

    def create_component(self, request: str) -> Reference | None:
        """A component made after `request`; None where it cannot."""
        ...

    def delete_component(self, name: str) -> ReturnCode: ...

    def listed(self, what: str) -> Sequence[Any]:
        """What one of its operations without arguments lists, as CORBA values that are only passed on."""
        ...

    def components_by_name(self, name: str) -> Sequence[Reference]: ...

    def add_slave(self, slave: Reference) -> ReturnCode: ...

    def remove_slave(self, slave: Reference) -> ReturnCode: ...

    def add_master(self, master: Reference) -> ReturnCode: ...

    def remove_master(self, master: Reference) -> ReturnCode: ...

    def knows_slave(self, slave: Reference) -> bool: ...

    def shutdown(self) -> ReturnCode: ...


class World(Protocol):
    """The process's place among others. Any thread may call."""

    def properties(self) -> Mapping[str, str]:
        """What is known of the ORB: `corba.endpoints` and their like."""
        ...

    def offer_component(self, component: Component, key: str) -> Reference:
        """Let others call a component, as `corbaloc:iiop:HOST:PORT/KEY`, too."""
        ...

    def withdraw_component(self, component: Component) -> None: ...

    def offer_manager(self, manager: Manager, key: str) -> Reference: ...

    def withdraw_manager(self) -> None: ...

    def bind(self, names: Iterable[str], reference: Reference) -> None:
        """Give `reference` names at all name servers, now or as soon as it can be. Raises nothing."""
        ...

    def unbind(self, names: Iterable[str]) -> None:
        """Give names back. Raises nothing."""
        ...

    def update_names(self) -> None:
        """Bind what servers lack. Raises nothing."""
        ...

    def part_with_the_gone(self) -> None:
        """Let components part with contexts and composites whose processes have ended. Returns at once."""
        ...

    def is_free(self, name: str) -> bool:
        """Whether no living object has the name at any name server that answers."""
        ...

    def instance_names(self) -> set[str]:
        """The ids of all components that the name servers know."""
        ...

    def manager_at(self, address: str) -> RemoteManager:
        """The manager of `HOST[:PORT][/KEY]`."""
        ...

    def port_reference(self, port: Port) -> Reference:
        """How others call a port."""
        ...

    def ports_in(self, context: str, kind: str) -> Sequence[tuple[str, PeerPort]]:
        """The ports that have names of a kind in a context of the naming service, with these names."""
        ...

    def member(self, name: str) -> Member | None:
        """The component of another process that a composite has as a member; None where there is none."""
        ...

    def components_at(self, address: str) -> Sequence[Reference]:
        """The components at an address that answer: RtcError where there is none, PeerLostError where it is silent.

        `rtcname://HOST[:PORT]/PATH` is a name at a name server, `.rtc` at its end left out or not; a single name, or
        `*/NAME`, may stand in any context; HOST `*`: the servers of `corba.nameservers`.
        `rtcloc://HOST:PORT/CATEGORY/NAME` is asked of a manager.
        """
        ...

    def connect(
        self, ports: Sequence[str], local: Mapping[str, Reference], name: str, properties: Mapping[str, str]
    ) -> None:
        """Connect ports by their addresses; `local` has the components of this process. RtcError if it cannot be."""
        ...

    def activate_at(self, address: str) -> None:
        """Activate the component of another process that an address means. RtcError if it cannot be."""
        ...

    def close(self) -> None:
        """End the ORB."""
        ...
