"""Engine `cyclonedds`: the ROS 2 graph by way of Eclipse Cyclone DDS, with the package cyclonedds from PyPI.

An alternative to the engine `dds`, for who wants a second opinion. Everything passes as bytes here too. What Cyclone
cannot do, and `dds` can, is told in `GAPS`.
"""

from typing import Final

from muros.space.cyclone._space import CycloneSpace, open_cyclone

__all__ = ["GAPS", "CycloneSpace", "open_cyclone"]

GAPS: Final = {
    "services of rmw_fastrtps": "no inline QoS, so services, actions and parameters work with rmw_cyclonedds and "
    "muros only, not with rmw_fastrtps, which most of ROS 2 uses",
    "related": "a sample of a plain topic does not say which request it answers, for the same reason",
    "gids": "Cyclone chooses gids: a key does not bring a gid back in another life",
    "sequence": "a reader counts the samples of each writer itself: the number is not the writer's",
    "big endian": "Cyclone reads samples as little-endian: those of big-endian writers arrive mislabelled",
    "source time": "samples of a writer with a lifespan carry the time of the call as their source time",
    "patience": "when a reader of another process that keeps all is full, a writer is refused until it has room",
    "first samples": "a volatile reader skips what a writer of another vendor sends before its first HEARTBEAT",
    "leaving": "Fast DDS notices a participant's leaving when its lease of 10 s is over; its node goes at once",
    "machines": "there are no wheels for aarch64 Linux, musl and Python 3.14",
}
"""What this engine cannot do, by keyword."""
