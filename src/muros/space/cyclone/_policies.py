"""Quality of service in the words of cyclonedds, and back."""

from __future__ import annotations

from typing import Any, Final

from muros.space._core import Limits
from muros.space._qos import Durability, History, Liveliness, Ownership, Qos, Reliability

__all__ = ["INFINITE", "from_policies", "to_policies", "user_data"]

INFINITE: Final = 0x7FFF_FFFF_FFFF_FFFF
"""Cyclone's word for no period, ns."""

BUFFER: Final = 256
"""Samples that may wait in Cyclone for a reader that keeps the last ones, until they are taken over."""


def to_policies(qos: Qos, limits: Limits, *, writes: bool, user_data: bytes = b"") -> Any:
    """What to tell Cyclone of an endpoint."""
    from cyclonedds.qos import Policy
    from cyclonedds.qos import Qos as Policies

    depth = min(qos.depth, limits.resource_limit)
    if qos.keeps_all:
        history: Any = Policy.History.KeepAll
    else:
        history = Policy.History.KeepLast(depth if writes else max(depth, BUFFER))
    liveliness = {
        Liveliness.AUTOMATIC: Policy.Liveliness.Automatic,
        Liveliness.MANUAL_BY_PARTICIPANT: Policy.Liveliness.ManualByParticipant,
        Liveliness.MANUAL_BY_TOPIC: Policy.Liveliness.ManualByTopic,
    }[qos.liveliness]
    policies: list[Any] = [
        # A full writer is refused at once: nobody waits on the event loop.
        Policy.Reliability.BestEffort
        if qos.reliability == Reliability.BEST_EFFORT
        else Policy.Reliability.Reliable(0),
        Policy.Durability.TransientLocal if qos.durability else Policy.Durability.Volatile,
        history,
        Policy.DataRepresentation(True, False),
        Policy.Deadline(qos.deadline or INFINITE),
        liveliness(qos.lease or INFINITE),
        Policy.Ownership.Exclusive if qos.ownership else Policy.Ownership.Shared,
    ]
    if qos.partitions:
        policies.append(Policy.Partition(qos.partitions))
    if qos.keeps_all:
        policies.append(Policy.ResourceLimits(limits.resource_limit, -1, limits.resource_limit))
    if writes:
        policies.append(Policy.Lifespan(qos.lifespan or INFINITE))
        if qos.ownership:
            policies.append(Policy.OwnershipStrength(qos.strength))
        if qos.durability:
            # History for who comes late follows this policy and not History.
            kept = Policy.History.KeepLast(limits.resource_limit if qos.keeps_all else depth)
            policies.append(Policy.DurabilityService(0, kept, -1, -1, -1))
    if user_data:
        policies.append(Policy.Userdata(user_data))
    return Policies(*policies)


def from_policies(policies: Any) -> Qos:
    """What Cyclone tells of an endpoint."""
    from cyclonedds.qos import Policy

    get = {policy.__scope__: policy for policy in policies.policies}.get
    history = get("History")
    deadline, lifespan, liveliness = get("Deadline"), get("Lifespan"), get("Liveliness")
    strength = get("OwnershipStrength")
    manual = (
        (Policy.Liveliness.ManualByParticipant, Liveliness.MANUAL_BY_PARTICIPANT),
        (Policy.Liveliness.ManualByTopic, Liveliness.MANUAL_BY_TOPIC),
    )
    durability = get("Durability")
    durabilities = {
        Policy.Durability.Volatile: Durability.VOLATILE,
        Policy.Durability.TransientLocal: Durability.TRANSIENT_LOCAL,
        Policy.Durability.Transient: Durability.TRANSIENT,
        Policy.Durability.Persistent: Durability.PERSISTENT,
    }
    best_effort = get("Reliability") == Policy.Reliability.BestEffort
    return Qos(
        reliability=Reliability.BEST_EFFORT if best_effort else Reliability.RELIABLE,
        durability=durabilities.get(durability, Durability.VOLATILE),
        history=History.KEEP_ALL if history == Policy.History.KeepAll else History.KEEP_LAST,
        depth=getattr(history, "depth", 1),
        deadline=_period(getattr(deadline, "deadline", INFINITE)),
        lifespan=_period(getattr(lifespan, "lifespan", INFINITE)),
        liveliness=next(
            (ours for kind, ours in manual if isinstance(liveliness, kind)), Liveliness.AUTOMATIC
        ),
        lease=_period(getattr(liveliness, "lease_duration", INFINITE)),
        ownership=Ownership.EXCLUSIVE if get("Ownership") == Policy.Ownership.Exclusive else Ownership.SHARED,
        strength=getattr(strength, "strength", 0),
        partitions=tuple(getattr(get("Partition"), "partitions", ())),
    )


def user_data(policies: Any) -> bytes:
    """The user data among policies."""
    return next((bytes(policy.data) for policy in policies.policies if policy.__scope__ == "Userdata"), b"")


def _period(ns: int) -> int:
    return 0 if ns >= INFINITE else max(0, ns)
