"""Quality of service of an endpoint as discovery carries it: `EndpointQos` and its parameters.

The values are those of DDS 1.4, 2.2.3, on the wire as DDSI-RTPS 2.3, 9.6.2.2 says. What a peer leaves out has the
default of DDS, which for reliability is not the same for writers and readers.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple, TypeVar

from muros._kinds import Durability, History, Liveliness, Ownership, Reliability
from muros.rtps._constants import Pid
from muros.rtps._parameters import InvalidParameters, ParameterBuilder, Parameters
from muros.rtps._values import INFINITE, duration_from_wire, duration_to_wire

__all__ = [
    "READER_QOS",
    "WRITER_QOS",
    "XCDR1",
    "XCDR2",
    "AccessScope",
    "DestinationOrder",
    "Durability",
    "DurabilityService",
    "EndpointQos",
    "History",
    "Liveliness",
    "Ownership",
    "Reliability",
    "ResourceLimits",
    "read_qos",
    "write_qos",
]

UNLIMITED: Final = -1
"""A resource limit that is none."""

MAX_BLOCKING: Final = 100_000_000
"""ns a write may wait for room when nothing else is said."""

XCDR1: Final = 0
XCDR2: Final = 2
"""Data representations (XTypes 1.3, 7.6.3.1.1)."""

MAX_REPRESENTATIONS: Final = 8
"""Data representations read from an endpoint; there are three."""


class DestinationOrder(IntEnum):
    """Whose clock orders the samples of several writers."""

    BY_RECEPTION = 0
    BY_SOURCE = 1


class AccessScope(IntEnum):
    """How far coherent and ordered access reach."""

    INSTANCE = 0
    TOPIC = 1
    GROUP = 2


class ResourceLimits(NamedTuple):
    """Samples and instances an endpoint has room for; -1 = unlimited."""

    max_samples: int = UNLIMITED
    max_instances: int = UNLIMITED
    max_samples_per_instance: int = UNLIMITED


class DurabilityService(NamedTuple):
    """What the history for late readers is, where a service keeps it."""

    cleanup_delay: int = 0
    history: History = History.KEEP_LAST
    depth: int = 1
    limits: ResourceLimits = ResourceLimits()


@dataclass(frozen=True, slots=True, kw_only=True)
class EndpointQos:
    """Quality of service of a writer or reader. Durations are in ns, `INFINITE` = without end.

    The fields' defaults are those of a writer; see `WRITER_QOS` and `READER_QOS`.
    """

    reliability: Reliability = Reliability.RELIABLE
    max_blocking: int = MAX_BLOCKING
    """How long a write may wait for room."""
    durability: Durability = Durability.VOLATILE
    durability_service: DurabilityService | None = None
    """None = not said."""
    history: History | None = None
    """None = not said: peers of Fast DDS do not tell theirs."""
    depth: int = 1
    """Samples kept with keep last."""
    limits: ResourceLimits | None = None
    """None = not said."""
    deadline: int = INFINITE
    """A new sample is offered (or wanted) at least this often."""
    latency_budget: int = 0
    """Delay that is acceptable; a hint."""
    lifespan: int = INFINITE
    """Samples are worthless when older."""
    liveliness: Liveliness = Liveliness.AUTOMATIC
    lease: int = INFINITE
    """Liveliness is asserted at least this often."""
    ownership: Ownership = Ownership.SHARED
    strength: int = 0
    """With exclusive ownership, the strongest writer is heard."""
    partitions: tuple[str, ...] = ()
    """Names, or patterns with * and ?, of the partitions of its publisher or subscriber; none = the one named ""."""
    time_based_filter: int = 0
    """A reader wants samples at most this often."""
    destination_order: DestinationOrder = DestinationOrder.BY_RECEPTION
    access_scope: AccessScope = AccessScope.INSTANCE
    coherent: bool = False
    ordered: bool = False
    transport_priority: int = 0
    representations: tuple[int, ...] = ()
    """Data representations it offers or accepts, preferred first; none = not said, which means `XCDR1`."""

    @property
    def reliable(self) -> bool:
        """Whether samples may not be lost."""
        return self.reliability == Reliability.RELIABLE


WRITER_QOS: Final = EndpointQos()
"""What a writer has when nothing is said."""

READER_QOS: Final = EndpointQos(reliability=Reliability.BEST_EFFORT)
"""What a reader has when nothing is said."""


def read_qos(parameters: Parameters, *, writer: bool) -> EndpointQos:
    """The QoS in the discovery data of a writer or reader. `InvalidParameters` for what makes no sense."""
    default = WRITER_QOS if writer else READER_QOS
    reliability = parameters.unpack(Pid.RELIABILITY, "III")
    history = parameters.unpack(Pid.HISTORY, "Ii")
    liveliness = parameters.unpack(Pid.LIVELINESS, "III")
    presentation = parameters.unpack(Pid.PRESENTATION, "IBB")
    service = parameters.unpack(Pid.DURABILITY_SERVICE, "IIIiiii")
    limits = parameters.unpack(Pid.RESOURCE_LIMITS, "iii")
    # Kinds that are 0 are the defaults, and so "or" is right for them too.
    return EndpointQos(
        reliability=_kind(Reliability, reliability) or default.reliability,
        max_blocking=duration_from_wire(*reliability[1:]) if reliability else MAX_BLOCKING,
        durability=_kind(Durability, parameters.unpack(Pid.DURABILITY, "I")) or Durability.VOLATILE,
        durability_service=_service(service) if service else None,
        history=_kind(History, history),
        depth=history[1] if history else default.depth,
        limits=ResourceLimits(*limits) if limits else None,
        deadline=_period(parameters, Pid.DEADLINE, INFINITE),
        latency_budget=_period(parameters, Pid.LATENCY_BUDGET, 0),
        lifespan=_period(parameters, Pid.LIFESPAN, INFINITE),
        liveliness=_kind(Liveliness, liveliness) or Liveliness.AUTOMATIC,
        lease=duration_from_wire(*liveliness[1:]) if liveliness else INFINITE,
        ownership=_kind(Ownership, parameters.unpack(Pid.OWNERSHIP, "I")) or Ownership.SHARED,
        strength=(parameters.unpack(Pid.OWNERSHIP_STRENGTH, "i") or (0,))[0],
        partitions=parameters.texts(Pid.PARTITION),
        time_based_filter=_period(parameters, Pid.TIME_BASED_FILTER, 0),
        destination_order=_kind(DestinationOrder, parameters.unpack(Pid.DESTINATION_ORDER, "I"))
        or DestinationOrder.BY_RECEPTION,
        access_scope=_kind(AccessScope, presentation) or AccessScope.INSTANCE,
        coherent=bool(presentation and presentation[1]),
        ordered=bool(presentation and presentation[2]),
        transport_priority=(parameters.unpack(Pid.TRANSPORT_PRIORITY, "i") or (0,))[0],
        representations=_representations(parameters),
    )


def write_qos(builder: ParameterBuilder, qos: EndpointQos) -> None:
    """Add the QoS of a writer or reader: always the policies that decide whether two match, others when needed."""
    builder.pack(Pid.RELIABILITY, "III", qos.reliability, *duration_to_wire(qos.max_blocking))
    builder.uint32(Pid.DURABILITY, qos.durability)
    if qos.durability_service is not None:
        delay, history, depth, limits = qos.durability_service
        builder.pack(Pid.DURABILITY_SERVICE, "IIIiiii", *duration_to_wire(delay), history, depth, *limits)
    if qos.history is not None:
        builder.pack(Pid.HISTORY, "Ii", qos.history, qos.depth)
    if qos.limits is not None:
        builder.pack(Pid.RESOURCE_LIMITS, "iii", *qos.limits)
    builder.duration(Pid.DEADLINE, qos.deadline)
    builder.duration(Pid.LATENCY_BUDGET, qos.latency_budget)
    builder.duration(Pid.LIFESPAN, qos.lifespan)
    builder.pack(Pid.LIVELINESS, "III", qos.liveliness, *duration_to_wire(qos.lease))
    builder.uint32(Pid.OWNERSHIP, qos.ownership)
    if qos.strength:
        builder.pack(Pid.OWNERSHIP_STRENGTH, "i", qos.strength)
    if qos.partitions:
        builder.texts(Pid.PARTITION, qos.partitions)
    if qos.time_based_filter:
        builder.duration(Pid.TIME_BASED_FILTER, qos.time_based_filter)
    builder.uint32(Pid.DESTINATION_ORDER, qos.destination_order)
    builder.pack(Pid.PRESENTATION, "IBB", qos.access_scope, qos.coherent, qos.ordered)
    if qos.transport_priority:
        builder.pack(Pid.TRANSPORT_PRIORITY, "i", qos.transport_priority)
    if qos.representations:
        count = len(qos.representations)
        builder.pack(Pid.DATA_REPRESENTATION, f"I{count}h", count, *qos.representations)


_Kind = TypeVar("_Kind", bound=IntEnum)


def _kind(kind: type[_Kind], numbers: tuple[int, ...] | None) -> _Kind | None:
    """What the first of `numbers` stands for; None when there are none."""
    if numbers is None:
        return None
    try:
        return kind(numbers[0])
    except ValueError:
        raise InvalidParameters(f"{numbers[0]} is no kind of {kind.__name__.lower()}") from None


def _period(parameters: Parameters, pid: int, default: int) -> int:
    ns = parameters.duration(pid)
    return default if ns is None else ns


def _service(numbers: tuple[int, ...]) -> DurabilityService:
    history = _kind(History, numbers[2:]) or History.KEEP_LAST
    return DurabilityService(
        duration_from_wire(*numbers[:2]), history, numbers[3], ResourceLimits(*numbers[4:])
    )


def _representations(parameters: Parameters) -> tuple[int, ...]:
    """A sequence of short numbers (XTypes 1.3, 7.6.3.1.1)."""
    value = parameters.first(Pid.DATA_REPRESENTATION, 4)
    if value is None:
        return ()
    count: int = struct.unpack_from(parameters.order + "I", value)[0]
    if count > MAX_REPRESENTATIONS or len(value) < 4 + 2 * count:
        raise InvalidParameters(f"a list of {count} data representations does not fit")
    return struct.unpack_from(f"{parameters.order}{count}h", value, 4)
