"""The order of adding is the order of processing, in whatever order messages come.

    python executor_order.py local:

prints

    published: second, first
    first
    second
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import String

context = open_context()
node = context.node("executor_order")
to_first, to_second = node.publisher(String, "first"), node.publisher(String, "second")
first = node.subscription(String, "first", lambda message: print(message.data))
second = node.subscription(String, "second", lambda message: print(message.data))


def publish() -> None:
    """Publishes for the second one before the first."""
    if to_second.publish(String(data="second")) and to_first.publish(String(data="first")):
        print("published: second, first")


executor = Executor(context, handles=3)
executor.add(node.timer(0.2, publish))
executor.add(first)
executor.add(second)
executor.spin()
