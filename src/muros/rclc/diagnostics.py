"""Diagnostics: what a node says about its own health, in numbers that a bridge on a host turns into words.

    updater = DiagnosticUpdater(node)

    def check_battery(task):
        task.set(VOLTAGE, battery.volts(), WARN if battery.volts() < 11.0 else OK)
        task.lookup(MODE, MODE_CHARGING)

    updater.task(BATTERY, hardware_id=7, check=check_battery)
    node.timer(1.0, updater.update)

Keys, tasks, hardware and looked-up values are numbers, and what has not changed is not sent again: that keeps messages
short. A table beside the bridge has the words, see docs/diagnostics.md. Boards need the message
micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticStatus with its MicroROSDiagnosticKeyValue, and std_msgs/msg/Empty.
"""

from muros.compat import MPY, borrow, const
from muros.rclc.errors import CapacityError

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.context import Node

OK = const(0)
WARN = const(1)
ERROR = const(2)
STALE = const(3)
"""Levels of a value and of a task, whose level is that of its worst value."""

FAILED = const(57)
"""The code with which problems tell of a task that has raised."""

_BOOL = const(1)
_INT = const(2)
_FLOAT = const(3)
_LOOKUP = const(10)
_LARGEST = const(0x7FFFFFFF)
_LARGEST_ID = const(0xFFFF)


class DiagnosticUpdater:
    """Publishes the tasks of a node on ``<prefix>diagnostics_uros``; an Empty on ``.../force_update`` has it send all.

    At most ``tasks``, each with ``values`` at most. ``refused`` counts messages that were not taken: they are sent at
    the next update.
    """

    def __init__(self, node: "Node", prefix: str = "", tasks: int = 5, values: int = 4) -> None:
        self.node = node
        self.tasks: "list[Task]" = []
        self.refused = 0
        self.most_tasks = tasks
        self.most_values = values
        topic = prefix + "diagnostics_uros"
        self._value = _kind("micro_ros_diagnostic_msgs", "MicroROSDiagnosticKeyValue")
        status = _kind("micro_ros_diagnostic_msgs", "MicroROSDiagnosticStatus")
        self.publisher = node.publisher(status, topic)
        self._status: "Any" = status()
        self.subscription = node.subscription(
            _kind("std_msgs", "Empty"), topic + "/force_update", self._on_force
        )

    def task(self, updater_id: int, hardware_id: int, check: "Callable[[Task], object]") -> "Task":
        """A task: at each update ``check(task)`` sets its values.

        Raises CapacityError when there is no more room, ValueError for a number that has more than 16 bits.
        """
        if len(self.tasks) >= self.most_tasks:
            raise CapacityError(
                "the updater has %d tasks, its most: make it with tasks=%d"
                % (len(self.tasks), len(self.tasks) + 1)
            )
        _within(updater_id)
        _within(hardware_id)
        made = Task(self, updater_id, hardware_id, check)
        self.tasks.append(made)
        return made

    def update(self) -> int:
        """Asks every task and publishes those that have changed; how many that were.

        What a task raises is told to ``on_problem`` and makes its level ERROR; the others go on.
        """
        sent = 0
        for task in self.tasks:
            try:
                task.begin()
                task.check(task)
                task.finish()
            except Exception as error:
                task.fail(error)
            if task.fresh:
                if self._publish(task):
                    task.fresh = False
                    sent += 1
                else:
                    self.refused += 1
        return sent

    def force(self) -> None:
        """Has the next update send every task."""
        for task in self.tasks:
            task.fresh = True

    def _on_force(self, message: "Any") -> None:
        self.force()

    def _publish(self, task: "Task") -> bool:
        status = self._status
        status.level = task.level
        status.updater_id = task.updater_id
        status.hardware_id = task.hardware_id
        status.values = task.values
        status.number_of_values = len(task.values)
        return self.publisher.publish(status)


class Task:
    """Made by ``DiagnosticUpdater.task``. ``level`` is that of its worst value; ``failures`` counts what was raised."""

    def __init__(
        self, updater: DiagnosticUpdater, updater_id: int, hardware_id: int, check: "Callable[[Task], object]"
    ) -> None:
        self.updater = updater
        self.updater_id = updater_id
        self.hardware_id = hardware_id
        self.check = check
        self.level = OK
        self.values: "list[Any]" = []
        self.failures = 0
        self.fresh = True  # there is something to send
        self._count = 0
        self._level = OK

    def set(self, key: int, value: "bool | int | float", level: int = OK) -> None:
        """Sets the next value.

        Raises CapacityError for one too many, ValueError for an int of more than 32 bits or a key of more than 16.
        """
        if isinstance(value, bool):
            self._put(key, _BOOL, level, value, 0, 0.0, 0)
        elif isinstance(value, int):
            if not -_LARGEST - 1 <= value <= _LARGEST:
                raise ValueError("%d does not fit 32 bits: set it as a float" % value)
            self._put(key, _INT, level, False, value, 0.0, 0)
        else:
            self._put(key, _FLOAT, level, False, 0, float(value), 0)

    def lookup(self, key: int, value_id: int, level: int = OK) -> None:
        """Sets the next value to one that the bridge's table has words for."""
        _within(value_id)
        self._put(key, _LOOKUP, level, False, 0, 0.0, value_id)

    def worsen(self, level: int) -> None:
        """Sets the level of the task, unless a value is worse."""
        self._level = max(self._level, level)

    def begin(self) -> None:
        """The check begins."""
        self._count = 0
        self._level = OK

    def finish(self) -> None:
        """It has ended: what was set is all there is."""
        if self._count < len(self.values):
            del self.values[self._count :]
            self.fresh = True
        if self._level != self.level:
            self.level = self._level
            self.fresh = True

    def fail(self, error: Exception) -> None:
        """It has raised; what it had set until then stays."""
        self.failures += 1
        if self.level < ERROR:
            self.level = ERROR
            self.fresh = True
        if self.failures & self.failures - 1 == 0:  # the 1st, 2nd, 4th, 8th time
            text = "diagnostic task %d raised %s: %s" % (self.updater_id, type(error).__name__, error)
            middleware = self.updater.node.context.middleware
            if middleware.on_problem is not None:
                middleware.on_problem(FAILED, text)
            elif not MPY:
                borrow("muros.client.reasons").say(text)

    def _put(self, key: int, kind: int, level: int, *values: "Any") -> None:
        at = self._count
        if at == self.updater.most_values:
            raise CapacityError(
                "a task has %d values, its most: make the updater with values=%d" % (at, at + 1)
            )
        _within(key)
        if at == len(self.values):
            self.values.append(self.updater._value())
            self.fresh = True
        found = self.values[at]
        new = (key, kind, level) + values
        old = (
            found.key,
            found.value_type,
            found.level,
            found.bool_value,
            found.int_value,
            found.double_value,
            found.value_id,
        )
        if new != old:
            self.fresh = True
            found.key, found.value_type, found.level = key, kind, level
            found.bool_value, found.int_value, found.double_value, found.value_id = values
        self._count = at + 1
        self._level = max(self._level, level)


def _within(number: int) -> None:
    """Raises ValueError for what is no number of 16 bits; boards would cut it off."""
    if not 0 <= number <= _LARGEST_ID:
        raise ValueError("%d is no number from 0 to %d" % (number, _LARGEST_ID))


def _kind(package: str, name: str) -> "Any":
    """A message class."""
    if MPY:
        return getattr(__import__(package + ".msg", None, None, (name,)), name)
    return borrow("muros.interfaces").message(package + "/msg/" + name)
