"""Publishes text.

    python string_publisher.py dds:                  # then: muros topic echo /chatter

prints

    I have published: "Hello World! 0"
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import String

context = open_context()
node = context.node("string_publisher")
publisher = node.publisher(String, "chatter")
count = 0


def send() -> None:
    """Publishes a text."""
    global count
    text = "Hello World! " + str(count)
    if publisher.publish(String(data=text)):
        print('I have published: "' + text + '"')
        count += 1


node.timer(0.2, send)
Executor(context).spin()
