"""Publishes numbers that count up, for examples that are about something else."""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from muros.rclc import Node


def count_up(node: "Node", topic: str = "int32") -> None:
    """Has a node publish a number five times a second, and print it: `Sent: 0`."""
    from std_msgs.msg import Int32  # which is there once muros is

    publisher = node.publisher(Int32, topic)
    message = Int32(data=0)

    def send() -> None:
        if publisher.publish(message):
            print("Sent:", message.data)
            message.data += 1

    node.timer(0.2, send)
