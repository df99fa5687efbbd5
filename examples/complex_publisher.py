"""Publishes a message with messages and sequences in it: the joints of an arm.

    python complex_publisher.py dds:

prints

    Sent joints: 2
"""

from way import open_context

from muros.rclc import Executor

from sensor_msgs.msg import JointState

context = open_context()
node = context.node("complex_publisher")
publisher = node.publisher(JointState, "joint_states")
message = JointState()
message.header.frame_id = "arm"
message.name = ["shoulder", "elbow"]


def send() -> None:
    """Publishes where the joints are; the stamp counts, as this program knows no time."""
    message.header.stamp.sec += 1
    message.position = [0.5 * message.header.stamp.sec, -0.25]
    if publisher.publish(message):
        print("Sent joints:", len(message.name))


node.timer(0.2, send)
Executor(context).spin()
