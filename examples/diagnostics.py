"""Says how a board is, in numbers; ``muros diagnostics bridge`` has the words.

    python diagnostics.py udp:192.168.1.10:8888

prints

    2 of 2 tasks told
    1 of 2 tasks told
"""

from way import open_context

from muros.rclc import DiagnosticUpdater, Executor
from muros.rclc.diagnostics import OK, WARN, Task

BATTERY, MOTOR, HARDWARE = 1, 2, 7
VOLTAGE, TEMPERATURE = 0, 0

context = open_context()
node = context.node("arm")
updater = DiagnosticUpdater(node)
volts = [12.5]


def check_battery(task: "Task") -> None:
    """Becomes empty, and is charged."""
    volts[0] = volts[0] - 0.5 if volts[0] > 10.5 else 12.5
    task.set(VOLTAGE, volts[0], WARN if volts[0] < 11.0 else OK)


def check_motor(task: "Task") -> None:
    """Is always well."""
    task.set(TEMPERATURE, 21)


updater.task(BATTERY, HARDWARE, check_battery)
updater.task(MOTOR, HARDWARE, check_motor)


def tell() -> None:
    """Publishes what has changed."""
    told = updater.update()
    if told:
        print(told, "of", len(updater.tasks), "tasks told")


node.timer(0.2, tell)
Executor(context).spin()
