"""Connecting service ports from a program."""

from __future__ import annotations

from collections.abc import Mapping

from muros.rtc.ports import Port, connect_ports
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
    given = {"port.connection.strictness": "strict" if strict else "best_effort", **properties}
    return connect_ports(ports, given, name)
