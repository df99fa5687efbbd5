"""Ports over CORBA: `PortServant` is a port of this process as others call it, `ForeignPort` one of theirs."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from omniORB import CORBA

from muros.rtc.codes import PeerLostError, Polarity, ReturnCode, RtcError
from muros.rtc.corba._conversion import (
    from_nv_list,
    from_return_code,
    texts_of,
    to_return_code,
)
from muros.rtc.corba._foreign import ForeignComponent
from muros.rtc.corba._lost import asked_again, is_late, peer, quick_answer
from muros.rtc.corba._naming import is_same
from muros.rtc.corba._stubs import RTC, RTC__POA
from muros.rtc.ports import Port
from muros.rtc.profiles import ConnectorProfile, InterfaceProfile, PortProfile

if TYPE_CHECKING:
    from muros.rtc.corba._objects import Objects

__all__ = ["ForeignPort", "PortServant"]

PATIENCE: Final = 3
"""Times that a port is asked whether it exists until its silence counts as an answer."""


class PortServant(RTC__POA.PortService):  # type: ignore[misc]
    """RTC::PortService of a port. RTC 1.1, 5.4.2.8. What cannot be is answered by a code, nothing is raised."""

    def __init__(self, port: Port, objects: Objects) -> None:
        self.port: Final = port
        self._objects = objects

    def get_port_profile(self) -> Any:
        return self._objects.port_profile(self.port.profile())

    def get_connector_profiles(self) -> list[Any]:
        return [self._objects.connector(one) for one in self.port.living_connectors()]

    def get_connector_profile(self, connector_id: str) -> Any:
        found = [one for one in self.port.living_connectors() if one.connector_id == connector_id]
        return self._objects.connector(found[0]) if found else RTC.ConnectorProfile("", "", [], [])

    def connect(self, connector_profile: Any) -> tuple[Any, Any]:
        try:
            asked = self._objects.connector_behind(connector_profile)
        except RtcError as error:
            return self._refused(connector_profile, error)
        code, agreed = self.port.connect(asked)
        return to_return_code(code), self._objects.connector(agreed)

    def notify_connect(self, connector_profile: Any) -> tuple[Any, Any]:
        try:
            asked = self._objects.connector_behind(connector_profile)
        except RtcError as error:
            return self._refused(connector_profile, error)
        code, agreed = self.port.notify_connect(asked)
        return to_return_code(code), self._objects.connector(agreed)

    def disconnect(self, connector_id: str) -> Any:
        return to_return_code(self.port.disconnect(connector_id))

    def disconnect_all(self) -> Any:
        return to_return_code(self.port.disconnect_all())

    def notify_disconnect(self, connector_id: str) -> Any:
        return to_return_code(self.port.notify_disconnect(connector_id))

    def _refused(self, profile: Any, error: RtcError) -> tuple[Any, Any]:
        self._objects.refused(f"port {self.port.full_name}", f"connection {profile.name} refused", error)
        return RTC.BAD_PARAMETER, profile


class ForeignPort:
    """A port of another process, as `PeerPort`. Equal to all others that stand for it.

    What it does not answer raises PeerLostError, what its ORB refuses RtcError.
    """

    __slots__ = ("_hash", "_late", "_objects", "_told", "reference")

    def __init__(self, reference: Any, objects: Objects) -> None:
        self.reference: Final = reference
        self._objects = objects
        self._hash = objects.orb.hash_of(reference)
        self._late = 0
        self._told: PortProfile | None = None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ForeignPort) and is_same(self.reference, other.reference)

    def __hash__(self) -> int:
        return self._hash

    def notify_connect(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
        with peer(str(self)):
            asked = self._objects.connector(profile)
            code, agreed = asked_again(lambda: self.reference.notify_connect(asked))
        # The ports are as they were asked for: they are not looked up a second time.
        properties = from_nv_list(agreed.properties)
        return from_return_code(code), replace(profile, name=agreed.name, properties=properties)

    def notify_disconnect(self, connector_id: str) -> ReturnCode:
        """One that did not answer when it was last looked for is not waited for long."""
        if self._late >= PATIENCE:
            raise PeerLostError(f"{self} has been silent for long")
        with peer(str(self)), quick_answer() if self._late else nullcontext():
            return from_return_code(asked_again(lambda: self.reference.notify_disconnect(connector_id)))

    def is_there(self) -> bool:
        """Whether its process says so. One that does not answer in time is given PATIENCE looks."""
        try:
            with quick_answer():
                there = not asked_again(self.reference._non_existent)
        except CORBA.Exception as error:
            self._late += 1
            return is_late(error) and self._late < PATIENCE
        self._late = 0
        return there

    # As a port that a composite of this process exports: what tools see of it is what it says itself.

    @property
    def full_name(self) -> str:
        """`<instance>.<port>`"""
        return (self._told or self.profile()).name

    def profile(self) -> PortProfile:
        """As its process tells it; as it told before, while it does not answer."""
        try:
            with peer(str(self)), quick_answer():
                found = asked_again(self.reference.get_port_profile)
        except PeerLostError:
            if self._told is None:
                raise
            return replace(self._told, connectors=())
        self._told = PortProfile(
            found.name,
            self,
            ForeignComponent(found.owner, self._objects) if found.owner is not None else None,
            tuple(
                InterfaceProfile(one.instance_name, one.type_name, Polarity(one.polarity._v))
                for one in found.interfaces
            ),
            tuple(self._objects.connector_behind(one) for one in found.connector_profiles),
            texts_of(found.properties),
        )
        return self._told

    def activate(self) -> None:
        """Its own component does that."""

    def deactivate(self) -> None:
        """Its own component does that."""

    def __str__(self) -> str:
        return "a port of another process"
