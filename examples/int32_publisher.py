"""Publishes a number that counts up.

    python int32_publisher.py dds:
    micropython int32_publisher.py udp:192.168.1.10:8888

prints

    Sent: 0
    Sent: 1
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import Int32

context = open_context()
node = context.node("int32_publisher")
publisher = node.publisher(Int32, "int32")
message = Int32(data=0)


def send() -> None:
    """Publishes the number; one that is refused, since no agent is there yet, is tried again."""
    if publisher.publish(message):
        print("Sent:", message.data)
        message.data += 1


node.timer(0.2, send)
Executor(context).spin()
