"""What names of DDS mean to ROS 2: which service a topic carries, and the hash of a type's definition."""

from functools import lru_cache
from typing import Final

from muros import interfaces
from muros.interfaces import InterfaceError, ros_service, ros_type_name

__all__ = ["service_of", "type_hash"]

HASHES_MOST: Final = 4096
"""Types whose hash is remembered; names come from clients, so there is no end to them."""


def service_of(topic: str) -> str:
    """Name of the service whose requests or replies a topic carries, "" if it carries none."""
    return ros_service(topic) or ""


@lru_cache(HASHES_MOST)
def type_hash(type_name: str, distro: str | None = None) -> str:
    """RIHS01 hash for a DDS type name, "" when its definition is not known.

    For a request or response it is that of the whole service, as ROS 2 has it.
    """
    try:
        name = ros_type_name(type_name)
        if "/srv/" in name or "/action/" in name:
            name = name.removesuffix("_Request").removesuffix("_Response")
        return interfaces.rihs01(name, distro)
    except InterfaceError:
        return "" if distro is None else type_hash(type_name)
