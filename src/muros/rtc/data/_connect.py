"""Connecting ports from a program, without tools."""

from __future__ import annotations

from collections.abc import Mapping

from muros.rtc.data._port import DIRECT
from muros.rtc.ports import Port, connect_ports
from muros.rtc.profiles import ConnectorProfile

__all__ = ["connect"]


def connect(*ports: Port, options: Mapping[str, object] = {}, name: str = "") -> ConnectorProfile:
    """Connect ports of this process; the profile that they agreed on.

    `options` are the connection's properties without `dataport.`: `{"subscription_type": "new"}`. Where they do not
    say otherwise, values go straight from port to port (`interface_type` direct, `dataflow_type` push). A single
    port is connected with `interface_type` space. RtcError where a port refuses; it reports why.
    """
    texts = {"interface_type": DIRECT, "dataflow_type": "push", "subscription_type": "flush", **options}
    properties = {f"dataport.{key.removeprefix('dataport.')}": str(value) for key, value in texts.items()}
    return connect_ports(ports, properties, name)
