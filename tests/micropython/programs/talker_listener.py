"""A board's program: a reliable publisher and a subscription of 64 B strings over UDP, MTU 256, history 4.

Arguments: host, port. It ends with ``done`` when it has heard 20 of its own messages, and without after 5 s.
"""

import sys

from muros.client import Session, Udp
from muros.compat import ticks_add, ticks_diff, ticks_ms
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
executor = Executor(context)
end = ticks_add(ticks_ms(), 5000)
while context.running and ticks_diff(end, ticks_ms()) > 0:
    executor.spin_some(0.1)
if heard[0] >= 20:
    print("done")
