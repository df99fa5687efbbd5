"""Publishes a message that is larger than what one datagram takes: it travels in fragments, reliably.

    python fragmented_publisher.py udp:192.168.1.10:8888

prints

    Sent: 10000 bytes
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import UInt8MultiArray

SIZE = 10_000

context = open_context()
node = context.node("fragmented_publisher")
publisher = node.publisher(UInt8MultiArray, "image")
message = UInt8MultiArray(data=bytes(i % 251 for i in range(SIZE)))


def send() -> None:
    """Publishes the image; refused while the last one is still on its way."""
    if publisher.publish(message):
        print("Sent:", SIZE, "bytes")


node.timer(0.5, send)
Executor(context).spin()
