"""Bounds of what received messages may take: a longer one is refused before it takes anything, and told.

    python static_types.py local:

prints

    heard ['shoulder', 'elbow']
    72 B of sensor_msgs/msg/JointState dropped: name is longer than the rules allow

On a board that is why a foreign message never takes the memory that was meant for something else.
"""

from way import open_context

from muros.rclc import Executor
from muros.rclc.memory import Rules

from sensor_msgs.msg import JointState

# At most 2 names of 8 characters, and 2 numbers each; the frame's name has at most 4.
RULES = Rules({"header.frame_id": 4, "name": 2, "name.data": 8, "position": 2, "velocity": 2, "effort": 2})

context = open_context()
context.on_problem(lambda code, text: print(text))
node = context.node("static_types")
publisher = node.publisher(JointState, "joint_states")
node.subscription(
    JointState, "joint_states", lambda message: print("heard", list(message.name)), memory=RULES
)
arms = (["shoulder", "elbow"], ["shoulder", "elbow", "wrist"])
count = 0


def send() -> None:
    """Publishes a message that fits, then one that does not."""
    global count
    if publisher.publish(JointState(name=arms[count % 2])):
        count += 1


node.timer(0.25, send)
Executor(context).spin()
