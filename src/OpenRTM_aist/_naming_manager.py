"""What `Manager.getNaming()` gives: components found by their addresses, and names for objects."""
# ruff: noqa: N802 (the names are those that programs know)

from __future__ import annotations

import contextlib
from functools import partial
from typing import TYPE_CHECKING, Any

from muros.rtc.codes import RtcError
from OpenRTM_aist._corba_naming import CorbaNaming

if TYPE_CHECKING:
    from muros.rtc.manager import Manager as Core

__all__ = ["NamingManager"]

ANYWHERE = "*/"
"""Before a component's name: in any context of the name server."""


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
        from omniORB import CORBA

        from muros.rtc.corba._lost import asked_again

        world = self._core.world
        kind, _, rest = name.partition("://")
        place, _, path = rest.partition("/")
        if not path:
            return []
        found: list[Any] = []
        if kind == "rtcloc":
            with contextlib.suppress(RtcError):
                found += world.manager_at(place).components_by_name(path)
        elif kind == "rtcname":
            for server in self._core.settings.words("corba.nameservers") if place == "*" else [place]:
                with contextlib.suppress(CORBA.Exception, RtcError):
                    found += asked_again(partial(_named, server, path))
        return [component for one in found if (component := _component(one)) is not None]

    def bindObject(self, name: str, rtobj: Any) -> None:
        """Give a component one more name, until the manager ends."""
        self._core.world.bind((name,), rtobj.getObjRef())

    def unbindObject(self, name: str) -> None:
        self._core.world.unbind((name,))

    def update(self) -> None:
        """Give name servers the names that they lack."""
        self._core.world.update_names()


def _named(server: str, path: str) -> list[Any]:
    """What a name server has under a name. CORBA's exceptions if it does not answer, RtcError for what is no name."""
    import CosNaming
    from omniORB import CORBA

    from muros.rtc.corba import server_address
    from muros.rtc.corba._lost import quick_answer

    plain = path.removeprefix(ANYWHERE).removesuffix(".rtc")
    with quick_answer():
        names = CorbaNaming(CORBA.ORB_init([], CORBA.ORB_ID), server_address(server))
        if not path.startswith(ANYWHERE):
            with contextlib.suppress(CosNaming.NamingContext.NotFound):
                return [names.resolve(f"{plain}.rtc")]
        return [] if "/" in plain else list(names.find(plain, "rtc"))


def _component(reference: Any) -> Any:
    """The component behind a reference; None where it is none, or does not answer."""
    from omniORB import CORBA

    import RTC
    from muros.rtc.corba._lost import quick_answer

    try:
        with quick_answer():
            component = reference._narrow(RTC.RTObject)
            return None if component is None or component._non_existent() else component
    except CORBA.Exception:
        return None
