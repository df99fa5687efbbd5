"""Hears messages that came in fragments, and looks whether every byte is there.

    python fragmented_subscriber.py dds:

prints

    Received: 10000 bytes, all well
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import UInt8MultiArray


def hear(message: "UInt8MultiArray") -> None:
    """Checks an image."""
    data = bytes(message.data)
    wrong = 0
    for i in range(len(data)):
        if data[i] != i % 251:
            wrong += 1
    print("Received:", len(data), "bytes,", str(wrong) + " wrong" if wrong else "all well")


context = open_context(largest=16_384)  # boards join only short messages unless told
node = context.node("fragmented_subscriber")
node.subscription(UInt8MultiArray, "image", hear)
Executor(context).spin()
