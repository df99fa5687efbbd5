"""Looks at the graph: who is there, what they publish and hear. Tells it again whenever it changes. For computers.

    python graph_introspection.py dds:

prints

    node /int32_publisher
      publishes /int32 [std_msgs/msg/Int32]
"""

from typing import Any

from way import open_context

from muros.rclc import Executor


def tell(graph: Any) -> None:
    """Prints all nodes but this one."""
    for name in graph.nodes():
        if name == "/graph_introspection":
            continue
        print("node", name)
        for endpoint in graph.publishers(node=name):
            print(f"  publishes {endpoint.name} [{endpoint.type}]")
        for endpoint in graph.subscriptions(node=name):
            print(f"  hears {endpoint.name} [{endpoint.type}]")
        for endpoint in graph.servers(node=name):
            print(f"  serves {endpoint.name} [{endpoint.type}]")


context = open_context()
node = context.node("graph_introspection")
node.graph.on_change(tell)
Executor(context).spin()
