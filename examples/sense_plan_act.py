"""Sense, plan, act: an executor for each phase. The first waits for both sensors, each other for the one before it.

    python sense_plan_act.py local:

prints

    sense: laser 0
    sense: imu 0
    plan: 0 m to the wall, turn by 0
    act: turning by 0
    sense: laser 1
    sense: imu 1
    plan: 1 m to the wall, turn by 10
    act: turning by 10

The laser scans at half the rate of the IMU; each time the newest of both are taken, and always both.
"""

from way import open_context

from muros.client import Qos
from muros.rclc import Executor, all_of

from std_msgs.msg import Int32

NEWEST = Qos(depth=1)

context = open_context()
robot = context.node("robot")
sensors = {name: robot.publisher(Int32, name) for name in ("laser", "imu")}
goal, drive = robot.publisher(Int32, "goal"), robot.publisher(Int32, "drive")
sensed = {"laser": 0, "imu": 0}
ticks = 0


def measure() -> None:
    """What the sensors would do: the IMU at each tick, the laser at each second one."""
    global ticks
    sensors["imu"].publish(Int32(data=ticks // 2))
    if ticks % 2:
        sensors["laser"].publish(Int32(data=ticks // 2))
    ticks += 1


def on_sensor(name: str, message: "Int32") -> None:
    """Keeps what was sensed; the last sensor of the phase begins the next one."""
    sensed[name] = message.data
    print(f"sense: {name} {message.data}")
    if name == "imu":
        goal.publish(message)


def on_goal(message: "Int32") -> None:
    """Plans with what both sensors have seen."""
    turn = 10 * sensed["imu"]
    print(f"plan: {sensed['laser']} m to the wall, turn by {turn}")
    drive.publish(Int32(data=turn))


laser = robot.subscription(Int32, "laser", lambda message: on_sensor("laser", message), NEWEST)
imu = robot.subscription(Int32, "imu", lambda message: on_sensor("imu", message), NEWEST)

sense = Executor(context, trigger=all_of(laser, imu))
sense.add(laser)
sense.add(imu)
plan = Executor(context)
plan.add(robot.subscription(Int32, "goal", on_goal))
act = Executor(context)
act.add(robot.subscription(Int32, "drive", lambda message: print(f"act: turning by {message.data}")))
robot.timer(0.1, measure)

others = Executor(context)  # runs what no executor was given: the timer
while context.running:
    others.spin_some(0.02)
    sense.spin_some()
    plan.spin_some()
    act.spin_some()
