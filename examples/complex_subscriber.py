"""Hears messages with messages and sequences in them.

    python complex_subscriber.py dds:

prints

    arm at 3
    shoulder 1.5
    elbow -0.25
"""

from way import open_context

from muros.rclc import Executor

from sensor_msgs.msg import JointState


def hear(message: "JointState") -> None:
    """Prints a message, part by part."""
    print(message.header.frame_id, "at", message.header.stamp.sec)
    for i in range(len(message.name)):
        print(message.name[i], message.position[i])


context = open_context()
node = context.node("complex_subscriber")
node.subscription(JointState, "joint_states", hear)
Executor(context).spin()
