"""The engine behind `dds:` URLs: the ROS 2 graph, with nothing but this process.

Theory of operation. A participant of the space is a participant of RTPS, its entities are RTPS writers and readers
with the gids that the door promises. A `DdsDomain` holds all participants of a domain; what carries it is a network
once the space is attached to a loop, and nothing before: the participants of the space meet each other all the same.
Samples go from RTPS into the caches that all engines share, callbacks into the queue that all engines share. Nodes,
type hashes and services are conventions of ROS 2 over DDS: `_discovery_info`, `_names`, `_dialects`.
"""

from muros.space.dds._space import DdsSpace, open_dds

__all__ = ["DdsSpace", "open_dds"]
