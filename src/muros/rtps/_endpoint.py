"""What the cores of writers and readers share: how they send, what they report, and how counts are compared.

A core never owns a socket. It calls its `Send` with the submessages of one datagram, the prefix of the
participant they are for, and a place to send them to; whoever gave it puts the RTPS header (and, for a prefix,
INFO_DST) in front and is free to put several calls for one place into one message. Places are opaque to the cores.
"""

from collections.abc import Hashable
from enum import Enum
from typing import Final, Protocol, TypeAlias

from muros.rtps._values import Guid, GuidPrefix

__all__ = [
    "MILLISECOND",
    "NEVER",
    "SECOND",
    "Place",
    "Problem",
    "Report",
    "Send",
    "first_count",
    "newer",
    "next_slot",
]

MILLISECOND: Final = 10**6
"""In ns, the unit of all times here."""

SECOND: Final = 10**9
"""In ns."""

COUNT_UNIT: Final = 10 * MILLISECOND
"""Counts rise more slowly than this in the long run."""

NEVER: Final = 2**63
"""A time that does not come."""

Place: TypeAlias = Hashable
"""Where datagrams can be sent, such as a `Locator` and a socket: only compared here and handed back to `Send`."""


class Send(Protocol):
    """Takes one datagram's submessages. Must not raise or call a core; what cannot be sent is lost, as on any network.

    Submessages of several calls may share a message: each call brings the INFO_TS it needs.
    """

    def __call__(self, submessages: list[bytes], destination: GuidPrefix | None, place: Place, /) -> object:
        """`destination`: the participant meant, None for whoever listens there. The list must not be changed."""


class Problem(Enum):
    """What went wrong between a writer and a reader, told to `Report` with the peer's GUID and a number."""

    READER_STALLED = "reader-stalled"
    """A reader that acknowledged nothing for too long no longer holds the writer; the number: samples it lacks."""
    READER_RETURNED = "reader-returned"
    """A stalled reader acknowledges again; the number: samples it has lost at most."""
    SAMPLES_LOST = "samples-lost"
    """The writer no longer has what had not arrived; the number: samples."""
    SAMPLE_TOO_LARGE = "sample-too-large"
    """A sample does not fit the memory allowed for reassembly; the number: its size in bytes."""
    MEMORY_FULL = "reader-memory-full"
    """Samples or fragments that came early were dropped, to be asked for again; the number: bytes."""
    INCOMPLETE = "samples-incomplete"
    """Fragments of best-effort samples whose rest never came were dropped; the number: samples."""
    SAMPLES_FULL = "samples-full"
    """A reader rejected a sample, to be asked for again, for as many wait already as its resource limits allow; the
    number: the limit. The peer is the writer of the sample; so with the next two."""
    INSTANCE_FULL = "instance-full"
    """A sample was refused by the writer or rejected by the reader, for its instance has as many already as the
    resource limits allow; the number: the limit."""
    INSTANCES_FULL = "instances-full"
    """A sample was refused by the writer or dropped by the reader, for its instance is one too many; the number: the
    limit."""
    INCONSISTENT = "fragments-inconsistent"
    """Fragments contradict each other or themselves; the number: submessages dropped."""


class Report(Protocol):
    """Takes a problem. Called in passing: must be quick and must not raise or call the core."""

    def __call__(self, problem: Problem, peer: Guid, number: int, /) -> object:
        """`peer`: the GUID of the reader or writer at the other end."""


def first_count(now: int) -> int:
    """Where the counts of a writer or reader begin that begins at `now`.

    They follow the clock, since peers may remember those of an earlier life of the same GUID.
    """
    return now // COUNT_UNIT & 0x3FFFFFFF


def next_slot(now: int, width: int) -> int:
    """The next time after `now` that is a multiple of `width`: what waits for it leaves together."""
    return now - now % width + width


def newer(count: int, than: int | None) -> bool:
    """Whether a 32-bit `count` was given after `than`, None = none was seen yet. Counts wrap, which
    DDSI-RTPS 2.3, 8.3.7 leaves open.
    """
    return than is None or 0 < (count - than & 0xFFFFFFFF) < 0x80000000
