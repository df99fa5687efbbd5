"""The ping-pong of the micro-ROS tutorial: one source for boards (MicroPython) and computers (CPython).

    python ping_pong.py alice udp 127.0.0.1 8888
    micropython ping_pong.py bob serial /dev/ttyUSB0 115200
    python ping_pong.py carol dds:

The first two go through an agent, the third is straight in the ROS 2 graph; where the agent is in the graph, they meet.

Every node sends a ping with a random sequence and its device id, and answers the pings of the others with a pong that
carries the same words. Whoever hears a pong to its own last ping counts it.
"""

import sys
from os import urandom

from muros.rclc import Context, Executor

from std_msgs.msg import Header


class PingPong:
    """A node that plays ping-pong."""

    def __init__(self, context: "Context", name: str, period: float) -> None:
        self.name = name
        self.device = int.from_bytes(urandom(4), "big") >> 2
        self.waiting = ""
        self.pongs = 0
        node = context.node(name, namespace="demo")
        self.ping = node.publisher(Header, "/ping")
        self.pong = node.publisher(Header, "/pong")
        node.subscription(Header, "/ping", self.on_ping)
        node.subscription(Header, "/pong", self.on_pong)
        node.timer(period, self.send)
        context.on_state(self.on_state)

    def send(self) -> None:
        """Sends a ping with a new sequence."""
        self.waiting = f"{int.from_bytes(urandom(4), 'big') >> 2}_{self.device}"
        if self.ping.publish(Header(frame_id=self.waiting)):
            print("Ping send seq", self.waiting)

    def on_ping(self, message: "Header") -> None:
        """Answers a ping, unless it is our own."""
        if message.frame_id.endswith(f"_{self.device}"):
            return
        print(f"Ping received with seq {message.frame_id}. Answering.")
        self.pong.publish(message)

    def on_pong(self, message: "Header") -> None:
        """Counts a pong to our last ping."""
        if message.frame_id == self.waiting:
            self.pongs += 1
            print(f"Pong for seq {message.frame_id} ({self.pongs})")

    def on_state(self, state: str) -> None:
        """Tells how the way into the graph does; there is nothing else to do about it."""
        print("state", state)


def way(words: "list[str]") -> object:
    """The way that the command line names; imported here, so that a board loads only what it uses."""
    if len(words) == 1:
        return words[0]  # the URL of a data space
    kind, place, number = words
    if kind == "udp":
        from muros.client import Udp

        return Udp(place, int(number))
    if kind == "tcp":
        from muros.client import Tcp

        return Tcp(place, int(number))
    from muros.client import Serial

    return Serial(place, int(number))


def main(arguments: "list[str]") -> int:
    """Plays until it is stopped."""
    words = 1 if len(arguments) > 1 and ":" in arguments[1] else 3
    if len(arguments) < 1 + words:
        print("usage: ping_pong.py NAME udp|tcp|serial HOST|DEVICE PORT|BAUD [PERIOD_S]")
        print("       ping_pong.py NAME dds:[DOMAIN] [PERIOD_S]")
        return 2
    context = Context(way(arguments[1 : 1 + words]))
    PingPong(context, arguments[0], float(arguments[1 + words]) if len(arguments) > 1 + words else 2.0)
    Executor(context).spin()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
