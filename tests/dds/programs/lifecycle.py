"""`ros.py` with managed nodes: `lifecycle_node` makes one, whose callbacks fail as told.

`tests/dds/peers.py` starts it as another program of a ROS 2 peer.
"""

import threading
from typing import Any

import rclpy
import ros
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn


class Managed(LifecycleNode):  # type: ignore[misc]
    """A managed node; `fails` names the transitions that fail."""

    def __init__(self, name: str, fails: list[str], **arguments: Any) -> None:
        super().__init__(name, **arguments)
        self.fails = fails

    def _done(self, name: str) -> TransitionCallbackReturn:
        return TransitionCallbackReturn.FAILURE if name in self.fails else TransitionCallbackReturn.SUCCESS

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        return self._done("configure")

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        return self._done("activate")


class Ros(ros.Ros):  # type: ignore[misc]
    """What the other side can ask for besides."""

    def lifecycle_node(self, name: str, domain: int, namespace: str, fails: list[str]) -> int:
        """A managed node in a context of its own."""
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        node = Managed(name, fails, namespace=namespace, context=context)
        executor = MultiThreadedExecutor(3, context=context)
        executor.add_node(node)
        threading.Thread(target=executor.spin, daemon=True).start()
        self.contexts.append((context, node))
        return int(self._keep(node))


if __name__ == "__main__":
    ros.Ros = Ros
    ros.main()
