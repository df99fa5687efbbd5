"""A callback that takes longer than the period of a timer: the timer keeps its phase, and skips what it missed.

    python short_timer_long_subscription.py local:

prints

    timer, 100 ms since the last
    subscription works for 250 ms
    timer, 250 ms since the last
    timer, 50 ms since the last
    timer, 100 ms since the last
"""

import time

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import Int32

context = open_context()
node = context.node("busy")
publisher = node.publisher(Int32, "work")
count = 0


def tick() -> None:
    """Tells how long it was, to the nearest 50 ms; each fifth time there is work to do."""
    global count
    print("timer,", round(timer.since / 50) * 50, "ms since the last")
    count += 1
    if count % 5 == 1:
        publisher.publish(Int32(data=count))


def work(message: "Int32") -> None:
    """Takes its time."""
    print("subscription works for 250 ms")
    time.sleep(0.25)


timer = node.timer(0.1, tick)
node.subscription(Int32, "work", work)
Executor(context).spin()
