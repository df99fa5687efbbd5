"""Publishes numbers and hears others, in one node: two of these talk to each other.

    python int32_publisher_subscriber.py dds:

prints

    Sent: 0
    Received: 0
"""

from counting import count_up
from way import open_context

from muros.rclc import Executor

from std_msgs.msg import Int32

context = open_context()
node = context.node("int32_publisher_subscriber")
count_up(node)
node.subscription(Int32, "int32", lambda heard: print("Received:", heard.data))
Executor(context).spin()
