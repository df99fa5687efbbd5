"""One function for several subscriptions, each with something of its own that the function is given.

    python subscription_with_context.py local:

prints

    left wheel: 1 turns
    right wheel: 1 turns
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import Int32

context = open_context()
node = context.node("wheels")


class Wheel:
    """What belongs to one subscription; its method is the callback."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.turns = 0
        self.publisher = node.publisher(Int32, name)
        node.subscription(Int32, name, self.turn)

    def turn(self, message: "Int32") -> None:
        """Counts."""
        self.turns += message.data
        print(self.name, "wheel:", self.turns, "turns")


wheels = [Wheel("left"), Wheel("right")]


def drive() -> None:
    """Turns both."""
    for wheel in wheels:
        wheel.publisher.publish(Int32(data=1))


node.timer(0.2, drive)
Executor(context).spin()
