"""What a received message holds, as values (DDSI-RTPS 2.3, 8.3.7).

Each event carries what stood before it in its message: `source`, the participant it comes from; `destination`,
the participant it is for (None = everybody); and where samples may follow, `time`, when they were written in ns
since 1970 (None = not said). `reader` 0 means all readers that match. They are tuples, because one is made for
each submessage and no other frozen value is made as quickly; `count` hides the method of tuples.
"""

from typing import NamedTuple

from muros.rtps._parameters import Parameters
from muros.rtps._values import EntityId, GuidPrefix, Locator

__all__ = [
    "AckNack",
    "Data",
    "DataFrag",
    "Event",
    "Gap",
    "Heartbeat",
    "HeartbeatFrag",
    "InfoReply",
    "InvalidMessage",
    "Message",
    "NackFrag",
]


class Data(NamedTuple):
    """A sample, or news of an instance (8.3.7.2)."""

    source: GuidPrefix
    destination: GuidPrefix | None
    time: int | None
    reader: EntityId
    writer: EntityId
    sequence: int
    payload: bytes
    """Its first 4 bytes are the encapsulation; padding may follow. Empty when there is none."""
    inline_qos: Parameters | None
    key: bool
    """Whether the payload is only the instance's key."""


class DataFrag(NamedTuple):
    """Fragments of a sample (8.3.7.3). They hold `fragment_size` bytes each; the sample's last one may be shorter."""

    source: GuidPrefix
    destination: GuidPrefix | None
    time: int | None
    reader: EntityId
    writer: EntityId
    sequence: int
    first_fragment: int
    fragments_in: int
    """How many there are in this submessage, at least 1."""
    fragment_size: int
    sample_size: int
    """Bytes of the whole sample. Claimed by the peer: up to 2**32 - 1."""
    payload: bytes
    """Exactly these fragments' bytes."""
    inline_qos: Parameters | None
    key: bool


class Heartbeat(NamedTuple):
    """What a writer has (8.3.7.5); nothing when `last` is `first` - 1."""

    source: GuidPrefix
    destination: GuidPrefix | None
    reader: EntityId
    writer: EntityId
    first: int
    last: int
    count: int  # type: ignore[assignment]
    final: bool
    """Whether no answer is asked for."""
    liveliness: bool
    """Whether it also asserts the liveliness of a writer with manual liveliness."""


class Gap(NamedTuple):
    """What a reader shall not wait for: from `start` up to `base` - 1, and `numbers` (8.3.7.4).

    The range may be as large as the peer likes: do not walk it.
    """

    source: GuidPrefix
    destination: GuidPrefix | None
    reader: EntityId
    writer: EntityId
    start: int
    base: int
    numbers: tuple[int, ...]
    """At most 256, rising, none below `base`."""


class AckNack(NamedTuple):
    """What a reader has (all below `base`) and misses (8.3.7.1).

    `base` is 0 in the first one that some peers send, before they know anything of the writer.
    """

    source: GuidPrefix
    destination: GuidPrefix | None
    reader: EntityId
    writer: EntityId
    base: int
    missing: tuple[int, ...]
    """At most 256, rising, none below `base`."""
    count: int  # type: ignore[assignment]
    final: bool
    """Whether no answer is asked for."""


class HeartbeatFrag(NamedTuple):
    """Fragments up to `last_fragment` of a sample are there (8.3.7.6)."""

    source: GuidPrefix
    destination: GuidPrefix | None
    reader: EntityId
    writer: EntityId
    sequence: int
    last_fragment: int
    count: int  # type: ignore[assignment]


class NackFrag(NamedTuple):
    """Fragments of a sample that a reader misses (8.3.7.11)."""

    source: GuidPrefix
    destination: GuidPrefix | None
    reader: EntityId
    writer: EntityId
    sequence: int
    base: int
    missing: tuple[int, ...]
    """At most 256, rising, none below `base`."""
    count: int  # type: ignore[assignment]


class InfoReply(NamedTuple):
    """Where answers to what follows shall go, instead of where its source is known to listen (8.3.7.8)."""

    source: GuidPrefix
    destination: GuidPrefix | None
    unicast: tuple[Locator, ...]
    multicast: tuple[Locator, ...]


Event = Data | DataFrag | Heartbeat | Gap | AckNack | HeartbeatFrag | NackFrag | InfoReply


class Message(NamedTuple):
    """A datagram as read."""

    prefix: GuidPrefix
    vendor: bytes
    version: tuple[int, int]
    submessages: list[Event]
    trouble: str
    """What was wrong with the rest of the datagram, which is left out; empty when nothing was."""


class InvalidMessage(ValueError):  # noqa: N818
    """Foreign bytes that are no RTPS 2 message."""
