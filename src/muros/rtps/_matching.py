"""Whether a writer and a reader of one topic fit together, and if not, why (DDS 1.4, 2.2.3: "RxO" policies).

What the writer offers must be at least what the reader requests. The reasons are for people to read.
"""

from collections.abc import Callable
from typing import Final

from muros._partitions import partitions_meet, partitions_text
from muros.rtps._constants import keyed
from muros.rtps._discovery_data import EndpointData
from muros.rtps._news import Mismatch, Policy
from muros.rtps._qos import XCDR1, XCDR2, EndpointQos, Liveliness, Ownership, Reliability
from muros.rtps._values import INFINITE, split_guid

__all__ = ["mismatches"]


def mismatches(writer: EndpointData, reader: EndpointData) -> tuple[Mismatch, ...]:
    """Why the two, which have the same topic, do not match; nothing when they do."""
    found = []
    if writer.type_name != reader.type_name:
        found.append(
            Mismatch(
                Policy.TYPE,
                f"the writer's type is {writer.type_name}, the reader's type is {reader.type_name}",
            )
        )
    with_key = [keyed(split_guid(endpoint.guid)[1]) for endpoint in (writer, reader)]
    if with_key[0] != with_key[1]:
        words = ["a topic with a key" if one else "a topic without a key" for one in with_key]
        found.append(Mismatch(Policy.KEY, f"the writer has {words[0]}, the reader {words[1]}"))
    if writer.qos is not reader.qos:
        offered, wanted = writer.qos, reader.qos
        for policy, fits, words_of in _POLICIES:
            if not fits(offered, wanted):
                text = f"the writer offers {words_of(offered)}, the reader wants {words_of(wanted)}"
                found.append(Mismatch(policy, text))
    if not partitions_meet(writer.qos.partitions, reader.qos.partitions):
        found.append(
            Mismatch(
                Policy.PARTITION,
                f"the writer is in {partitions_text(writer.qos.partitions)}, "
                f"the reader in {partitions_text(reader.qos.partitions)}",
            )
        )
    if (offers := _offered_representation(writer.qos)) not in (accepts := _accepted(reader.qos)):
        found.append(
            Mismatch(
                Policy.REPRESENTATION,
                f"the writer sends {_representation(offers)}, "
                f"the reader accepts {', '.join(map(_representation, accepts))}",
            )
        )
    return tuple(found)


# --- Helpers ---------------------------------------------------------------------------------------------


def _period(ns: int) -> str:
    return "no limit" if ns >= INFINITE else f"{ns / 1e9:.6g} s"


def _offered_representation(qos: EndpointQos) -> int:
    """A writer uses the first it names (XTypes 1.3, 7.6.3.1.1)."""
    return qos.representations[0] if qos.representations else XCDR1


def _accepted(qos: EndpointQos) -> tuple[int, ...]:
    return qos.representations or (XCDR1,)


def _representation(number: int) -> str:
    return {XCDR1: "XCDR1", 1: "XML", XCDR2: "XCDR2"}.get(number, f"data representation {number}")


def _presentation(qos: EndpointQos) -> str:
    words = [f"{qos.access_scope.name.lower()} access"]
    if qos.coherent:
        words.append("coherent")
    if qos.ordered:
        words.append("ordered")
    return " ".join(words)


_RELIABILITIES: Final = {Reliability.BEST_EFFORT: "best effort", Reliability.RELIABLE: "reliable"}
_LIVELINESS: Final = {
    Liveliness.AUTOMATIC: "automatic liveliness",
    Liveliness.MANUAL_BY_PARTICIPANT: "liveliness by hand of the participant",
    Liveliness.MANUAL_BY_TOPIC: "liveliness by hand of the writer",
}
_OWNERSHIPS: Final = {Ownership.SHARED: "shared ownership", Ownership.EXCLUSIVE: "exclusive ownership"}

# What is compared, when an offer is good enough for a wish, and how either is called.
_POLICIES: Final[
    tuple[tuple[Policy, Callable[[EndpointQos, EndpointQos], bool], Callable[[EndpointQos], str]], ...]
] = (
    (
        Policy.RELIABILITY,
        lambda offered, wanted: offered.reliability >= wanted.reliability,
        lambda qos: _RELIABILITIES[qos.reliability],
    ),
    (
        Policy.DURABILITY,
        lambda offered, wanted: offered.durability >= wanted.durability,
        lambda qos: qos.durability.name.lower().replace("_", " "),
    ),
    (
        Policy.DEADLINE,
        lambda offered, wanted: offered.deadline <= wanted.deadline,
        lambda qos: f"a deadline of {_period(qos.deadline)}",
    ),
    (
        Policy.LATENCY_BUDGET,
        lambda offered, wanted: offered.latency_budget <= wanted.latency_budget,
        lambda qos: f"a latency budget of {_period(qos.latency_budget)}",
    ),
    (
        Policy.LIVELINESS,
        lambda offered, wanted: offered.liveliness >= wanted.liveliness,
        lambda qos: _LIVELINESS[qos.liveliness],
    ),
    (
        Policy.LEASE,
        lambda offered, wanted: offered.lease <= wanted.lease,
        lambda qos: f"a liveliness lease of {_period(qos.lease)}",
    ),
    (
        Policy.OWNERSHIP,
        lambda offered, wanted: offered.ownership == wanted.ownership,
        lambda qos: _OWNERSHIPS[qos.ownership],
    ),
    (
        Policy.DESTINATION_ORDER,
        lambda offered, wanted: offered.destination_order >= wanted.destination_order,
        lambda qos: f"order {qos.destination_order.name.lower().replace('_', ' ')}",
    ),
    (
        Policy.PRESENTATION,
        lambda offered, wanted: (
            offered.access_scope >= wanted.access_scope
            and offered.coherent >= wanted.coherent
            and offered.ordered >= wanted.ordered
        ),
        _presentation,
    ),
)
