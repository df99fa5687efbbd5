"""Logical execution time: inputs are read when a period begins, outputs leave when it ends, however long it computes.

    python let.py local:

prints

    period 1: control saw 0
    period 2: control saw 1
    period 3: control saw 2

The sensor runs before the control in each period, yet the control sees what the sensor published a period ago: always
the same, on a slow computer and on a fast one. With `semantics=RCLCPP` it might see this period's.
"""

from way import open_context

from muros.rclc import LET, Executor

from std_msgs.msg import Int32

context = open_context()
node = context.node("let")
publisher = node.publisher(Int32, "measured")
period = 0
seen = 0


def sense() -> None:
    """Begins a period and publishes its number."""
    global period
    period += 1
    publisher.publish(Int32(data=period))


def note(message: "Int32") -> None:
    """Keeps what was measured."""
    global seen
    seen = message.data


def control() -> None:
    """Acts on what was measured."""
    print(f"period {period}: control saw {seen}")


executor = Executor(context, semantics=LET, period=0.1)
executor.add(node.timer(0.1, sense))
executor.add(node.subscription(Int32, "measured", note))
executor.add(node.timer(0.1, control))
executor.spin_period()
