"""Endpoints of the graph as values; see ``graph``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

__all__ = ["CLIENT", "KINDS", "PUBLISHER", "SERVER", "SUBSCRIPTION", "Endpoint"]

KINDS: Final = ("publisher", "subscription", "server", "client")
"""What an endpoint is, in the order of the numbers of micro_ros_msgs/msg/Entity."""

PUBLISHER, SUBSCRIPTION, SERVER, CLIENT = KINDS


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Something that a node made."""

    kind: str
    """publisher, subscription, server or client."""
    name: str
    """Full name of the topic or service."""
    type: str
    """As in ROS: std_msgs/msg/String. A DDS name that ROS has not made is left as it is."""
    node: str
    """Full name of the node; empty for an endpoint of none."""
    gid: bytes = b""
    """16 bytes; empty through an agent that is not that of muros."""
    qos: Any = None
    """A ``muros.space.Qos``; None through an agent that is not that of muros."""
    type_hash: str = ""
    """RIHS01_...; empty when unknown."""
