"""A board's program: a reliable publisher and a subscription of 64 B strings over UDP, MTU 256, history 4.

Arguments: host, port. It ends with ``done`` when it has heard 20 of its own messages.
"""

import sys

from muros.client import Session, Udp
from muros.rclc import Context, Executor

from std_msgs.msg import String

context = Context(Session(Udp(sys.argv[1], int(sys.argv[2]), mtu=256), history=4))
node = context.node("board")
message = String(data="x" * 59)
publisher = node.publisher(String, "loop")
heard = [0]


def on_message(received: String) -> None:
    """Counts what comes back."""
    heard[0] += len(received.data) == 59
    if heard[0] == 20:
        context.close()


node.subscription(String, "loop", on_message)
node.timer(0.005, lambda: publisher.publish(message))
Executor(context).spin()
print("done")
