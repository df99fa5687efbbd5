"""Two threads: a callback that takes long does not hold up the timer of the other one. For computers.

    python multithread.py local:

prints

    control 1
    logging begins
    control 2
    control 3
    logging ends

The groups ask the system for priorities. Where it does not permit them the program says so once, and runs without.
"""

import time

from way import open_context

from muros.rclc import BEST_EFFORT, REAL_TIME_CRITICAL, CallbackGroup, Threads

from std_msgs.msg import Int32

context = open_context()
node = context.node("multithread")
publisher = node.publisher(Int32, "measured")
count = 0


def control() -> None:
    """Counts, and has each tenth number logged."""
    global count
    count += 1
    print("control", count)
    if count % 10 == 1:
        publisher.publish(Int32(data=count))


def log(message: "Int32") -> None:
    """Takes its time."""
    print("logging begins")
    time.sleep(0.3)
    print("logging ends")


fast = CallbackGroup("control", REAL_TIME_CRITICAL)
fast.add(node.timer(0.05, control))
slow = CallbackGroup("logging", BEST_EFFORT)
slow.add(node.subscription(Int32, "measured", log))
threads = Threads(context)
threads.assign(fast, slow)
threads.run()
