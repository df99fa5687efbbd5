"""A trigger: the executor takes nothing until both a text and a number have come, then the newest of each.

    python trigger.py local:

prints

    Callback 1: I heard: Hello World! 9
    Callback 2: I heard: 0

Texts are published ten times as often as numbers; each number finds the newest text.
"""

from way import open_context

from muros.client import Qos
from muros.rclc import Executor, all_of

from std_msgs.msg import Int32, String

NEWEST = Qos(depth=1)

context = open_context()
talker = context.node("talker")
texts, numbers = talker.publisher(String, "topic_0"), talker.publisher(Int32, "topic_1")
count = 0


def publish() -> None:
    """Publishes a text, and each tenth time a number."""
    global count
    texts.publish(String(data="Hello World! " + str(count)))
    if count % 10 == 9:
        numbers.publish(Int32(data=count // 10))
    count += 1


talker.timer(0.05, publish)

listener = context.node("listener")
text = listener.subscription(
    String, "topic_0", lambda message: print("Callback 1: I heard:", message.data), NEWEST
)
number = listener.subscription(
    Int32, "topic_1", lambda message: print("Callback 2: I heard:", message.data), NEWEST
)

fusion = Executor(context, trigger=all_of(text, number))
fusion.add(text)
fusion.add(number)
others = Executor(context)  # runs what no executor was given: the timer
while context.running:
    others.spin_some(0.05)
    fusion.spin_some()
