"""Hello world: a timer publishes a greeting, a subscription of the same node hears it.

    python hello_world.py local:

prints

    Published message Hello World! 0
    Callback: I heard: Hello World! 0
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import String

context = open_context()
node = context.node("hello_world")
publisher = node.publisher(String, "topic_0")
count = 0


def publish() -> None:
    """Greets."""
    global count
    text = "Hello World! " + str(count)
    if publisher.publish(String(data=text)):
        print("Published message", text)
        count += 1


node.subscription(String, "topic_0", lambda message: print("Callback: I heard:", message.data))
node.timer(0.2, publish)
Executor(context).spin()
