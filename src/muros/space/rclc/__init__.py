"""rclc straight on a data space: a context without an agent.

    context = Context("dds:")                # the ROS 2 graph, no agent
    context = Context("local:")              # this process
    context = Context(space)                 # a space of your own

`muros.rclc` comes here by itself for such a context. What stands behind it is a `SpaceMiddleware`, which offers rclc
what a session with an agent offers, so that a program need not know which of the two carries it. See
docs/write-a-node.md.
"""

from muros.space.rclc._middleware import SpaceMiddleware
from muros.space.rclc._opening import open_way
from muros.space.rclc._problems import ENCODING, NETWORK, NOT_SPUN, OTHER, PROBLEMS

__all__ = ["ENCODING", "NETWORK", "NOT_SPUN", "OTHER", "PROBLEMS", "SpaceMiddleware", "open_way"]
