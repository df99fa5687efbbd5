"""Hears the numbers of `int32_publisher.py`.

    python int32_subscriber.py dds:

prints

    Received: 4
    Received: 5
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import Int32

context = open_context()
node = context.node("int32_subscriber")
node.subscription(Int32, "int32", lambda message: print("Received:", message.data))
Executor(context).spin()
