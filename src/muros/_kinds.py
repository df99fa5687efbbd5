"""Kinds of quality of service, with the numbers that DDSI-RTPS 2.3, 9.6.2.2 gives them.

They stand below the rooms that speak of them, so that the data space needs no network protocol to name them.
"""

from enum import IntEnum

__all__ = ["Durability", "History", "Liveliness", "Ownership", "Reliability"]


class Reliability(IntEnum):
    """Whether samples may be lost."""

    BEST_EFFORT = 1
    RELIABLE = 2


class Durability(IntEnum):
    """What a late reader gets of what was written before."""

    VOLATILE = 0
    TRANSIENT_LOCAL = 1
    TRANSIENT = 2
    PERSISTENT = 3


class History(IntEnum):
    """What is kept when samples come faster than they go."""

    KEEP_LAST = 0
    KEEP_ALL = 1


class Liveliness(IntEnum):
    """Who says that a writer is alive."""

    AUTOMATIC = 0
    MANUAL_BY_PARTICIPANT = 1
    MANUAL_BY_TOPIC = 2


class Ownership(IntEnum):
    """Whether several writers may update the same data."""

    SHARED = 0
    EXCLUSIVE = 1
