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
    found = way()
    if options and not isinstance(found, str):
        from muros.client import Session

        found = Session(found, **options)
    return Context(found)


def way() -> "Any":
    """The transport or the URL that the command line names; ends the program where it names none.

    Imported here, so that a board loads only what it uses.
    """
    text = sys.argv[1] if len(sys.argv) > 1 else ""
    words = text.split(":")
    kind = words[0]
    if (
        len(words) == 2
        and kind in ("dds", "local", "cyclonedds")
        and sys.implementation.name != "micropython"
    ):
        return text
    if len(words) == 3 and words[2].isdigit():
        if kind == "udp":
            from muros.client import Udp

            return Udp(words[1], int(words[2]))
        if kind == "tcp":
            from muros.client import Tcp

            return Tcp(words[1], int(words[2]))
        if kind == "serial":
            from muros.client import Serial

            return Serial(words[1], int(words[2]))
    print(
        "usage:",
        sys.argv[0],
        "udp:HOST:PORT|tcp:HOST:PORT|serial:DEVICE:BAUD, on computers dds:[DOMAIN]|local:",
    )
    sys.exit(2)
