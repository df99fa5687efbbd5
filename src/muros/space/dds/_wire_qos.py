"""Quality of service of the space in the terms of RTPS, and back."""

from typing import Final

from muros.rtps import INFINITE, XCDR1, Durability, DurabilityService, EndpointQos, History
from muros.space._core import Limits
from muros.space._qos import NONE, Qos

__all__ = ["from_wire", "to_wire"]

REPRESENTATIONS: Final = (XCDR1,)
"""What ROS 2 writes and reads."""


def to_wire(qos: Qos, limits: Limits) -> EndpointQos:
    """What an endpoint announces. Cyclone DDS takes the history for late readers from the durability service."""
    depth = min(qos.depth, limits.resource_limit)
    late = qos.durability != Durability.VOLATILE
    return EndpointQos(
        reliability=qos.reliability,
        max_blocking=limits.max_blocking_time,
        durability=qos.durability,
        durability_service=DurabilityService(history=qos.history, depth=depth) if late else None,
        history=qos.history,
        depth=depth,
        deadline=qos.deadline or INFINITE,
        lifespan=qos.lifespan or INFINITE,
        liveliness=qos.liveliness,
        lease=qos.lease or INFINITE,
        ownership=qos.ownership,
        strength=qos.strength,
        partitions=qos.partitions,
        representations=REPRESENTATIONS,
    )


def from_wire(qos: EndpointQos) -> Qos:
    """What an endpoint has announced. History and depth are guesses where it does not tell them."""
    return Qos(
        reliability=qos.reliability,
        durability=qos.durability,
        history=History.KEEP_LAST if qos.history is None else qos.history,
        depth=max(qos.depth, 0),
        deadline=_period(qos.deadline),
        lifespan=_period(qos.lifespan),
        liveliness=qos.liveliness,
        lease=_period(qos.lease),
        ownership=qos.ownership,
        strength=qos.strength,
        partitions=qos.partitions,
    )


def _period(ns: int) -> int:
    return NONE if ns >= INFINITE else ns
