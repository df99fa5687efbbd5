"""Quality of service: what a writer offers, what a reader wants, and whether the two fit.

Rules and default values follow DDS 1.4, 2.2.3 (requested / offered); the presets are the profiles of ROS 2.
The kinds are those of DDSI-RTPS with the numbers it uses on the wire, so "more than" can be asked of them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final, NamedTuple

from muros._kinds import Durability, History, Liveliness, Ownership, Reliability
from muros._partitions import partitions_meet, partitions_text

__all__ = [
    "PRESETS",
    "Durability",
    "History",
    "Liveliness",
    "Mismatch",
    "Ownership",
    "Qos",
    "Reliability",
    "mismatches",
]

NONE: Final = 0
"""A period of 0 ns means: not asked for (infinite, in the words of DDS)."""

MAX_DEPTH: Final = 0x7FFFFFFF
"""Largest history depth DDS can carry (a signed 32-bit number)."""


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of a writer or reader. The fields' defaults are those of a DDS writer.

    A depth of 0 means "not said" and becomes 1, the default of DDS. Times are in nanoseconds, 0 = none.
    """

    reliability: Reliability = Reliability.RELIABLE
    durability: Durability = Durability.VOLATILE
    history: History = History.KEEP_LAST
    depth: int = 1
    """Samples kept with keep last; no meaning with keep all."""
    deadline: int = NONE
    """A new sample is offered (or wanted) at least this often."""
    lifespan: int = NONE
    """A writer's samples are worthless when older; a reader's is only carried."""
    liveliness: Liveliness = Liveliness.AUTOMATIC
    lease: int = NONE
    """Liveliness is asserted at least this often."""
    ownership: Ownership = Ownership.SHARED
    strength: int = 0
    """With exclusive ownership, the strongest writer is heard."""
    partitions: tuple[str, ...] = ()
    """Names, or patterns with * and ?, of the groups of endpoints it belongs to; none = the one named ""."""

    def __post_init__(self) -> None:
        if not 0 <= self.depth <= MAX_DEPTH:
            raise ValueError(f"history depth is {self.depth}; it must be from 0 to {MAX_DEPTH}")
        for name in ("deadline", "lifespan", "lease"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} is {getattr(self, name)} ns; it must not be negative (0 = none)")
        if self.depth == 0:
            object.__setattr__(self, "depth", 1)

    @classmethod
    def preset(cls, name: str) -> "Qos":
        """The ROS 2 profile `name` ("sensor_data", ...). ValueError names the known ones."""
        try:
            return PRESETS[name]
        except KeyError:
            raise ValueError(f"unknown QoS profile {name!r} (known: {', '.join(PRESETS)})") from None

    def replace(self, **changes: object) -> "Qos":
        """A copy with some fields changed."""
        return replace(self, **changes)  # type: ignore[arg-type]

    @property
    def keeps_all(self) -> bool:
        """Whether history is keep all."""
        return self.history == History.KEEP_ALL

    def __str__(self) -> str:
        """In words: "reliable, volatile, keep last 10, deadline 100 ms"."""
        kept = "keep all" if self.keeps_all else f"keep last {self.depth}"
        parts = [_words(self.reliability), _words(self.durability), kept]
        for name in ("deadline", "lifespan"):
            if period := getattr(self, name):
                parts.append(f"{name} {duration(period)}")
        if self.liveliness or self.lease:
            parts.append(f"liveliness {_words(self.liveliness)} {duration(self.lease)}")
        if self.ownership:
            parts.append(f"exclusive, strength {self.strength}")
        if self.partitions:
            parts.append(partitions_text(self.partitions))
        return ", ".join(parts)


class Mismatch(NamedTuple):
    """One policy in which a writer does not offer what a reader wants."""

    policy: str
    offered: str
    wanted: str
    remedy: str
    text: str = ""
    """What there is to say instead, where nothing is offered and wanted in the words of this space."""

    def __str__(self) -> str:
        return self.text or f"the reader wants {self.wanted}, the writer offers {self.offered}"


def mismatches(offered: Qos, wanted: Qos) -> tuple[Mismatch, ...]:
    """The policies in which `offered` (a writer's) does not satisfy `wanted` (a reader's); empty = they match."""
    if offered is wanted:
        return ()
    return tuple(
        Mismatch(rule.policy, rule.words(offered), rule.words(wanted), rule.remedy)
        for rule in _RULES
        if not rule.fits(offered, wanted)
    )


def duration(ns: int) -> str:
    """`ns` in the largest unit that needs no more than three digits after the point; 0 is "infinite"."""
    if ns == NONE:
        return "infinite"
    for unit, size in (("s", 10**9), ("ms", 10**6), ("us", 10**3)):
        if ns >= size:
            return f"{round(ns / size, 3):g} {unit}"
    return f"{ns} ns"


class _Rule(NamedTuple):
    """One row of the requested / offered table: the name, when it fits, how to say a side, what to do."""

    policy: str
    fits: Callable[[Qos, Qos], bool]
    words: Callable[[Qos], str]
    remedy: str


def _words(value: IntEnum) -> str:
    return value.name.lower().replace("_", " ")


def _period(name: str, ns: int) -> str:
    return f"a {name} of {duration(ns)}" if ns else f"no {name}"


def _often_enough(offered: int, wanted: int) -> bool:
    """A period is offered that is no longer than the wanted one (0 = infinite)."""
    return wanted == NONE or NONE < offered <= wanted


# DDS 1.4, 2.2.3: the policies whose "RxO" property is yes and that this space knows, and the partition.
_RULES: Final = (
    _Rule(
        "reliability",
        lambda offered, wanted: offered.reliability >= wanted.reliability,
        lambda qos: _words(qos.reliability),
        "Make the reader best effort, or the writer reliable",
    ),
    _Rule(
        "durability",
        lambda offered, wanted: offered.durability >= wanted.durability,
        lambda qos: _words(qos.durability),
        "Make the reader volatile, or the writer transient local",
    ),
    _Rule(
        "deadline",
        lambda offered, wanted: _often_enough(offered.deadline, wanted.deadline),
        lambda qos: _period("deadline", qos.deadline),
        "Give the writer a deadline no longer than the reader's, or the reader none",
    ),
    _Rule(
        "liveliness",
        lambda offered, wanted: offered.liveliness >= wanted.liveliness,
        lambda qos: f"liveliness {_words(qos.liveliness)}",
        "Use the same kind of liveliness on both sides",
    ),
    _Rule(
        "lease",
        lambda offered, wanted: _often_enough(offered.lease, wanted.lease),
        lambda qos: _period("liveliness lease", qos.lease),
        "Give the writer a lease no longer than the reader's, or the reader none",
    ),
    _Rule(
        "ownership",
        lambda offered, wanted: offered.ownership == wanted.ownership,
        lambda qos: f"{_words(qos.ownership)} ownership",
        "Use the same ownership on both sides",
    ),
    _Rule(
        "partition",
        lambda offered, wanted: partitions_meet(offered.partitions, wanted.partitions),
        lambda qos: partitions_text(qos.partitions),
        "Put both sides into one partition",
    ),
)

_BEST_EFFORT: Final = Reliability.BEST_EFFORT
_TRANSIENT_LOCAL: Final = Durability.TRANSIENT_LOCAL

PRESETS: Final = {
    "default": Qos(depth=10),
    "sensor_data": Qos(_BEST_EFFORT, depth=5),
    "services_default": Qos(depth=10),
    "parameters": Qos(depth=1000),
    "parameter_events": Qos(depth=1000),
    "action_status_default": Qos(durability=_TRANSIENT_LOCAL),
    "rosout_default": Qos(durability=_TRANSIENT_LOCAL, depth=1000, lifespan=10 * 10**9),
    "system_default": Qos(),
    "dds_writer": Qos(),
    "dds_reader": Qos(_BEST_EFFORT),
}
"""Profiles by name: those of ROS 2, and what a DDS writer and reader have when nothing is said."""
