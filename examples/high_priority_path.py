"""A path of high priority: obstacles are avoided after sensing and before planning, in each pass, in one thread.

    python high_priority_path.py local:

prints

    laser 3 m
    plan: go on
    act: speed 3
    laser 2 m
    plan: go on
    act: speed 2
    laser 1 m
    stop: too close
    plan: turn around
    act: speed 0

A scan of the laser begins the pass; the other callbacks run in each pass, with None where nothing has come. So nobody
plans before the robot has stopped.
"""

from way import open_context

from muros.rclc import ALWAYS, Executor, one

from std_msgs.msg import Int32, String

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

context = open_context()
robot = context.node("robot")
scans = robot.publisher(Int32, "laser")
ticks = 0
state: "dict[str, Any]" = {"distance": 0, "orders": "", "stopped": False}


def measure() -> None:
    """What the laser would do: the wall comes nearer, then it is far again."""
    global ticks
    if scans.publish(Int32(data=3 - ticks % 3)):
        ticks += 1


def on_laser(message: "Int32") -> None:
    """Keeps how far the wall is."""
    state["distance"] = message.data
    print(f"laser {message.data} m")


def avoid(message: "String | None") -> None:
    """Stops the robot in front of walls."""
    state["stopped"] = state["distance"] < 2
    if state["stopped"]:
        print("stop: too close")


def plan(message: "String | None") -> None:
    """Plans as somebody orders, else straight on."""
    if message is not None:
        state["orders"] = message.data
    print("plan:", "turn around" if state["stopped"] else state["orders"] or "go on")


def act(message: "String | None") -> None:
    """Drives."""
    print(f"act: speed {0 if state['stopped'] else state['distance']}")


laser = robot.subscription(Int32, "laser", on_laser)
executor = Executor(context, trigger=one(laser))
executor.add(laser)
executor.add(robot.subscription(String, "obstacles", avoid), when=ALWAYS)
executor.add(robot.subscription(String, "orders", plan), when=ALWAYS)
executor.add(robot.subscription(String, "wheels", act), when=ALWAYS)
robot.timer(0.2, measure)

others = Executor(context)  # runs what no executor was given: the timer
while context.running:
    others.spin_some(0.02)
    executor.spin_some()
