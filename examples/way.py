"""The way into the graph that the examples take: what their first word names. A board has this file beside them.

dds:  dds:42                      straight in the ROS 2 graph, where the program runs on a computer
local:                            a data space of this program alone
udp:192.168.1.10:8888             through an agent; tcp:... too
serial:/dev/ttyUSB0:115200
"""

import sys

from muros.rclc import Context

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any


def open_context(**options: "Any") -> "Context":
    """A context on the way that the command line names; ``options`` are those of the session with an agent, if any."""
    if len(sys.argv) < 2 or ":" not in sys.argv[1]:
        print("usage:", sys.argv[0], "dds:|local:|udp:HOST:PORT|tcp:HOST:PORT|serial:DEVICE:BAUD")
        sys.exit(2)
    found = way(sys.argv[1])
    if options and not isinstance(found, str):
        from muros.client import Session

        found = Session(found, **options)
    return Context(found)


def way(text: str) -> "Any":
    """The transport, or the URL, that a text names; a board imports only the one it uses."""
    words = text.split(":")
    if len(words) < 3:
        return text
    if words[0] == "udp":
        from muros.client import Udp

        return Udp(words[1], int(words[2]))
    if words[0] == "tcp":
        from muros.client import Tcp

        return Tcp(words[1], int(words[2]))
    from muros.client import Serial

    return Serial(words[1], int(words[2]))
