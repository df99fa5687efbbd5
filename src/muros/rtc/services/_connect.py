"""Connecting service ports from a program."""

from __future__ import annotations

from collections.abc import Mapping

from muros.rtc.codes import ReturnCode, RtcError
from muros.rtc.ports import Port
from muros.rtc.profiles import ConnectorProfile

__all__ = ["connect"]


def connect(
    *ports: Port, properties: Mapping[str, str] = {}, strict: bool = True, name: str = ""
) -> ConnectorProfile:
    """Connect service ports of this process; the profile that they agreed on.

    `properties` may map interfaces, `{"Guest0.port.desk.required.Greeting.host": "Greeter0.port.desk.provided..."}`.
    Unless `strict` is False, each required interface must find a provided one. RtcError where a port refuses; it
    reports why.
    """
    if not ports:
        raise RtcError("connect needs the ports to connect")
    given = {"port.connection.strictness": "strict" if strict else "best_effort", **properties}
    names = "_".join(port.name for port in ports)
    code, profile = ports[0].connect(ConnectorProfile(name or names, "", ports, given))
    if code is not ReturnCode.RTC_OK:
        full = " and ".join(port.full_name for port in ports)
        raise RtcError(f"{full} are not connected: {code.name}; the findings of the ports tell why")
    return profile
