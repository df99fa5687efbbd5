"""Publishes numbers and hears others, in one node: two of these talk to each other.

    python int32_publisher_subscriber.py dds:

prints

    Sent: 0
    Received: 0
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import Int32

context = open_context()
node = context.node("int32_publisher_subscriber")
publisher = node.publisher(Int32, "int32")
message = Int32(data=0)


def send() -> None:
    """Publishes the number."""
    if publisher.publish(message):
        print("Sent:", message.data)
        message.data += 1


node.subscription(Int32, "int32", lambda heard: print("Received:", heard.data))
node.timer(0.2, send)
Executor(context).spin()
