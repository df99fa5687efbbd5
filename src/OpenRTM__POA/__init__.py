"""`import OpenRTM__POA`: the stubs that all of the process shares (see muros.rtc.corba)."""
# ruff: noqa: N999

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:

    def __getattr__(name: str) -> Any: ...

else:
    from muros.rtc.corba._top_level import hand_out

    hand_out(__name__)
