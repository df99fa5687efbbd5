"""The bridge: from `diagnostics_uros` to `diagnostics`, one status for each of a board."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

from muros.client.qos import Qos
from muros.diagnostics._table import NOT_FOUND, Table
from muros.interfaces import message
from muros.rclc.host.context import Node

__all__ = ["BOARDS", "TOOLS", "Bridge"]

BOARDS: Final = "diagnostics_uros"
TOOLS: Final = "diagnostics"

_STALE: Final = 3
_MOST_MISSING: Final = 1000
"""Missing words that are told of one by one."""


class Bridge:
    """Takes what boards publish on `source` and publishes it for ROS 2's tools on `target`, with the words of `table`.

    `on_missing(text)` is told once of each number without words; `on_status(status)` of each
    `diagnostic_msgs/msg/DiagnosticStatus` that was published. `time()` is (seconds, nanoseconds), the system's if None.
    An executor of the node's context has to run. `converted` counts statuses, `lost` those that could not be published.
    """

    def __init__(
        self,
        node: Node,
        table: Table,
        source: str = BOARDS,
        target: str = TOOLS,
        on_missing: Callable[[str], object] | None = None,
        on_status: Callable[[Any], object] | None = None,
        time: Callable[[], tuple[int, int]] | None = None,
    ) -> None:
        self.table = table
        self.converted = 0
        self.lost = 0
        self._on_missing = on_missing
        self._on_status = on_status
        self._time = time or _now
        self._missing: set[str] = set()
        self._array = message("diagnostic_msgs/msg/DiagnosticArray")
        self._status = message("diagnostic_msgs/msg/DiagnosticStatus")
        self._pair = message("diagnostic_msgs/msg/KeyValue")
        self.publisher = node.publisher(self._array, target, Qos(depth=10))
        self.subscription = node.subscription(
            message("micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticStatus"),
            source,
            self._take,
            Qos(keep_all=True),
        )

    def convert(self, status: Any) -> Any:
        """A board's status as a `diagnostic_msgs/msg/DiagnosticStatus`."""
        table, number = self.table, status.updater_id
        updater = table.updater(number)
        values = status.values[: status.number_of_values]
        made = self._status(
            level=min(status.level, _STALE),
            name=updater.name,
            message=updater.description,
            hardware_id=table.hardware_id(status.hardware_id),
            values=[
                self._pair(key=table.key(number, value.key), value=self._text(number, value))
                for value in values
            ],
        )
        if made.name == NOT_FOUND:
            self._miss(f"updater {number}")
        if made.hardware_id == NOT_FOUND:
            self._miss(f"hardware {status.hardware_id}")
        for value, pair in zip(values, made.values, strict=True):
            if pair.key == NOT_FOUND:
                self._miss(f"key {value.key} of updater {number}")
            elif pair.value == NOT_FOUND:
                self._miss(f"value {value.value_id} of key {value.key} of updater {number}")
        return made

    def _take(self, status: Any) -> None:
        """A board says something."""
        made = self.convert(status)
        self.converted += 1
        array = self._array(status=[made])
        array.header.stamp.sec, array.header.stamp.nanosec = self._time()
        if not self.publisher.publish(array):
            self.lost += 1
        elif self._on_status is not None:
            self._on_status(made)

    def _text(self, updater: int, value: Any) -> str:
        """A value in words."""
        match value.value_type:
            case 1:  # BOOL
                return "True" if value.bool_value else "False"
            case 2:  # INT
                return str(value.int_value)
            case 3:  # FLOAT
                return f"{value.double_value:.7g}"
            case 10:  # LOOKUP
                return self.table.value(updater, value.key, value.value_id)
        return f"value of unknown type {value.value_type}"

    def _miss(self, what: str) -> None:
        """The table has no words for something."""
        if what not in self._missing and len(self._missing) < _MOST_MISSING:
            self._missing.add(what)
            if self._on_missing is not None:
                self._on_missing(what)


def _now() -> tuple[int, int]:
    return divmod(time.time_ns(), 1_000_000_000)
