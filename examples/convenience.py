"""The shortest program: a publisher, a subscription and a timer.

    python convenience.py local:

prints

    hello
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import String

context = open_context()
node = context.node("convenience")
publisher = node.publisher(String, "greeting")
node.subscription(String, "greeting", lambda message: print(message.data))
node.timer(0.2, lambda: publisher.publish(String(data="hello")))
Executor(context).spin()
