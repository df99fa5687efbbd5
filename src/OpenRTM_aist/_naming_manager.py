"""What `Manager.getNaming()` gives: components found by their addresses, and names for objects."""
# ruff: noqa: N802 (the names are those that programs know)

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

from muros.rtc.codes import RtcError

if TYPE_CHECKING:
    from muros.rtc.manager import Manager as Core

__all__ = ["NamingManager"]


class NamingManager:
    """The names that a manager knows. The manager has to be active: RtcError otherwise."""

    def __init__(self, core: Core) -> None:
        self._core = core

    def string_to_component(self, name: str) -> list[Any]:
        """References to the components at an address, those that answer.

        `rtcname://HOST[:PORT]/PATH`: a name server (`*`: those of `corba.nameservers`) and a name, as
        `robot.host_cxt/Motor0`; `*/Motor0`: in whatever context. `rtcloc://HOST:PORT/CATEGORY/NAME`: a manager.
        Nothing where there is no such component, no such server, or the address is another's.
        """
        from muros.rtc.corba._lost import quick_answer

        world = self._core.world
        with contextlib.suppress(RtcError), quick_answer():
            return list(world.components_at(name))
        return []

    def bindObject(self, name: str, rtobj: Any) -> None:
        """Give a component one more name, until the manager ends."""
        self._core.world.bind((name,), rtobj.getObjRef())

    def unbindObject(self, name: str) -> None:
        self._core.world.unbind((name,))

    def update(self) -> None:
        """Give name servers the names that they lack."""
        self._core.world.update_names()
