"""Diagnostics of a board on every runtime, by the ids of the acceptance cases; D6 to D9 are the bridge's, on hosts."""

from muros.compat import const
from muros.rclc import CapacityError, DiagnosticUpdater
from muros.rclc.diagnostics import ERROR, WARN
from tests.board.broker import Broker
from tests.board.harness import raises

from std_msgs.msg import Empty

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

_BOOL = const(1)
_INT = const(2)
_FLOAT = const(3)
_LOOKUP = const(10)


class Rig:
    """A board with an updater, and another that hears it and may force it."""

    def __init__(self) -> None:
        self.broker = Broker()
        self.updater = DiagnosticUpdater(self.broker.context().node("board"))
        node = self.broker.context().node("other")
        kind: "Any" = type(self.updater._status)
        self.heard: "list[Any]" = []
        node.subscription(kind, "diagnostics_uros", self.hear)
        self.force = node.publisher(Empty, "diagnostics_uros/force_update")
        self.broker.settle()

    def hear(self, status: "Any") -> None:
        """Keeps a status: what it is about, its level, its values."""
        values = [
            (
                value.key,
                value.value_type,
                value.bool_value,
                value.int_value,
                value.double_value,
                value.value_id,
            )
            for value in status.values
        ]
        assert status.number_of_values == len(values)
        self.heard.append((status.updater_id, status.hardware_id, status.level, values))

    def update(self) -> "list[Any]":
        """What an update publishes."""
        heard: "list[Any]" = []
        refused = -1
        while self.updater.refused != refused:
            refused = self.updater.refused
            sent = self.updater.update()
            self.broker.run(20)
            assert len(self.heard) == sent
            heard += self.heard
            self.heard.clear()
        return heard


def nothing(task: "Any") -> None:
    """Sets nothing."""


def test_d1_create_updater() -> None:
    rig = Rig()
    assert rig.update() == []
    objects = rig.broker.lines[0].objects
    named = [objects[number] for number in sorted(objects) if number & 15 == 2]
    assert named == ["rt/diagnostics_uros", "rt/diagnostics_uros/force_update"]


def test_d2_add_tasks() -> None:
    rig = Rig()
    for number in range(5):
        rig.updater.task(number, 0, nothing)
    with raises(CapacityError) as caught:
        rig.updater.task(9, 0, nothing)
    error: "Any" = caught.value
    assert error.code == 1
    assert [status[0] for status in rig.update()] == [0, 1, 2, 3, 4]


def test_d3_unchanged_is_silent() -> None:
    rig = Rig()
    volts = [12.5]
    rig.updater.task(1, 7, lambda task: task.set(0, volts[0]))
    rig.updater.task(2, 7, lambda task: task.set(0, True))
    assert len(rig.update()) == 2
    assert rig.update() == []
    volts[0] = 12.0
    assert rig.update() == [(1, 7, 0, [(0, _FLOAT, False, 0, 12.0, 0)])]
    assert rig.update() == []


def test_d4_forced_once() -> None:
    rig = Rig()
    rig.updater.task(1, 7, lambda task: task.set(0, 5))
    rig.updater.task(2, 7, nothing)
    assert len(rig.update()) == 2
    assert rig.force.publish(Empty())
    rig.broker.run(20)
    assert [status[0] for status in rig.update()] == [1, 2]
    assert rig.update() == []


def test_d5_values_arrive_with_their_types() -> None:
    rig = Rig()

    def check(task: "Any") -> None:
        task.set(10, True)
        task.set(11, -(2**31))
        task.set(12, 0.5, WARN)
        task.lookup(13, 4)

    rig.updater.task(1, 7, check)
    assert rig.update() == [
        (
            1,
            7,
            WARN,
            [
                (10, _BOOL, True, 0, 0.0, 0),
                (11, _INT, False, -(2**31), 0.0, 0),
                (12, _FLOAT, False, 0, 0.5, 0),
                (13, _LOOKUP, False, 0, 0.0, 4),
            ],
        )
    ]


def test_d5_a_task_that_raises_is_an_error() -> None:
    rig = Rig()
    text: "Any" = "text"
    rig.updater.task(1, 7, lambda task: task.set(0, text))
    assert rig.update() == [(1, 7, ERROR, [])]
