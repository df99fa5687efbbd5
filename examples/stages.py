"""The main loop of a robot in stages: components of one stage run at the same time, the next stage waits for them.

    python stages.py

prints

    1: sensed camera, laser; path found; driving
    2: sensed camera, laser; path found; driving
    component 'camera' of stage 'sense' has not finished within 1 s. The loop goes on without it until it has.
    3: sensed laser; path found; driving
    4: sensed camera, laser; path found; driving

In its third turn the camera hangs for a while. The loop says so and goes on without it. For computers.
"""

import threading

from muros.rclc import SensePlanAct

sensed: "set[str]" = set()
done: "list[str]" = []
repaired = threading.Event()


def camera() -> None:
    """Takes a picture."""
    if robot.turns == 2:
        repaired.wait()
    else:
        sensed.add("camera")


def laser() -> None:
    """Scans."""
    sensed.add("laser")


def localise() -> None:
    """Finds out where the robot is."""
    done.append("sensed " + ", ".join(sorted(sensed)))


def find_path() -> None:
    """Plans from there."""
    done.append("path found")


def drive() -> None:
    """Drives, and says what was done in this turn."""
    print(f"{robot.turns + 1}: {'; '.join(done)}; driving")
    sensed.clear()
    done.clear()
    if robot.turns == 2:
        repaired.set()


robot = SensePlanAct(["sense", "plan", "act"], patience=1.0, on_problem=lambda code, text: print(text))
robot.add("sense", camera)
robot.add("sense", laser)
robot.add("plan", localise)
robot.add("plan", find_path, after=[localise])
robot.add("act", drive)
robot.run(0.3, turns=5)
