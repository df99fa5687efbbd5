"""Return codes and profiles as old components know them: values of the module RTC."""

from __future__ import annotations

from typing import Any

from muros.rtc.codes import ReturnCode
from muros.rtc.profiles import ConnectorProfile

__all__ = ["codes", "to_code", "to_connector_profile"]


def codes() -> Any:
    """The module RTC, imported when the first component runs: return codes are its values."""
    import RTC

    return RTC


def to_code(code: ReturnCode) -> Any:
    """A return code of muros as one of RTC, which old programs compare it with."""
    return codes().ReturnCode_t._item(int(code))


def to_connector_profile(profile: ConnectorProfile, ports: list[Any]) -> Any:
    """A connection of muros as RTC has it, with these ports."""
    from muros.rtc.corba._conversion import to_nv_list

    return codes().ConnectorProfile(profile.name, profile.connector_id, ports, to_nv_list(profile.properties))
