"""An ordinary ROS 2 node (rclpy) that listens to the ping-pong: nothing of muros is in it.

    python3 ros2_listener.py [SECONDS]

It ends with status 0 when it saw the boards' nodes and heard their pings.
"""

import sys
import time

import rclpy
from rclpy.node import Node

from std_msgs.msg import Header


class Listener(Node):  # type: ignore[misc]
    """Hears pings and pongs, and sees who is there."""

    def __init__(self) -> None:
        super().__init__("ros2_listener")
        self.heard = {"ping": 0, "pong": 0}
        self.boards: set[str] = set()
        self.create_subscription(Header, "/ping", lambda message: self.hear("ping", message), 10)
        self.create_subscription(Header, "/pong", lambda message: self.hear("pong", message), 10)

    def hear(self, what: str, message: Header) -> None:
        """Counts a message; shows the first of each kind."""
        if not self.heard[what]:
            print(f"heard a {what} on /{what}: {message.frame_id}", flush=True)
        self.heard[what] += 1

    def look(self) -> None:
        """Tells of new nodes."""
        for name, namespace in self.get_node_names_and_namespaces():
            full = f"{namespace.rstrip('/')}/{name}"
            if namespace == "/demo" and full not in self.boards:
                self.boards.add(full)
                print(f"sees the node {full}", flush=True)


def main() -> int:
    """Listens for some seconds."""
    rclpy.init()
    node = Listener()
    end = time.monotonic() + float(sys.argv[1] if len(sys.argv) > 1 else 5.0)
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
        node.look()
    print(f"{len(node.boards)} nodes, {node.heard['ping']} pings, {node.heard['pong']} pongs", flush=True)
    fine = bool(node.boards) and all(node.heard.values())
    node.destroy_node()
    rclpy.shutdown()
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
