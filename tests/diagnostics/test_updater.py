"""The updater of a node: what it publishes and when, by the cases D1 to D5."""

import json
from pathlib import Path
from typing import Any

import pytest

from muros.interfaces import definition, message
from muros.rclc import CapacityError, Context, DiagnosticUpdater, Executor
from muros.rclc.diagnostics import ERROR, FAILED, OK, STALE, WARN, Task
from tests.rclc_space.ways import Stage

from std_msgs.msg import Empty

VECTORS: dict[str, Any] = json.loads((Path(__file__).parents[1] / "vectors/rmw/diagnostics.json").read_text())
STATUS = message("micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticStatus")
VALUE = message("micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticKeyValue")


class Board:
    """A node with an updater, and another that hears it."""

    def __init__(self, stage: Stage, **limits: Any) -> None:
        self.stage = stage
        self.problems: list[tuple[int, str]] = []
        node = stage.node("board")
        node.context.on_problem(lambda code, text: self.problems.append((code, text)))
        self.updater = DiagnosticUpdater(node, **limits)
        other = stage.node("other")
        prefix = limits.get("prefix", "")
        self.heard: list[Any] = []
        self.subscription = other.subscription(
            STATUS, prefix + "diagnostics_uros", self.heard.append, "default"
        )
        self.force = other.publisher(Empty, prefix + "diagnostics_uros/force_update")
        stage.meet(self.updater.publisher, self.force)

    def update(self) -> list[Any]:
        """What an update publishes; for what the way to an agent had no room there is another."""
        heard: list[Any] = []
        refused = -1
        while self.updater.refused != refused:
            refused = self.updater.refused
            sent = self.updater.update()
            self.stage.until(lambda sent=sent: len(self.heard) == sent)  # type: ignore[misc]
            heard += self.heard
            self.heard.clear()
        return heard


def nothing(task: Task) -> None:
    """Sets nothing."""


def test_the_types_are_those_of_micro_ros() -> None:
    for kind, key in ((VALUE, "MicroROSDiagnosticKeyValue"), (STATUS, "MicroROSDiagnosticStatus")):
        found = definition(kind.TYPE)
        said = "; ".join(f"{field.type} {field.name}" for field in found.fields)  # type: ignore[union-attr]
        assert said.replace("micro_ros_diagnostic_msgs/", "") == VECTORS[key]
    assert {name: globals()[name] for name in VECTORS["levels"]} == VECTORS["levels"]
    assert {c.name: c.value for c in definition(VALUE.TYPE).constants} == VECTORS["value_types"]  # type: ignore[union-attr]


def test_d1_create_updater(stage: Stage) -> None:
    board = Board(stage)
    names = [VECTORS["updater"][key].replace("<prefix>", "") for key in ("topic", "force_topic")]
    graph = stage.node("looking").graph
    stage.until(lambda: len(graph.topics()) == 2)
    assert graph.topics() == {"/" + names[0]: [STATUS.TYPE], "/" + names[1]: [Empty.TYPE]}
    assert board.update() == []


def test_d1_with_a_prefix(stage: Stage) -> None:
    board = Board(stage, prefix="arm/")
    board.updater.task(1, 2, nothing)
    assert len(board.update()) == 1
    graph = stage.node("looking").graph
    stage.until(lambda: graph.publishers("/arm/diagnostics_uros"))


def test_d2_add_tasks(stage: Stage) -> None:
    limits = VECTORS["updater"]
    board = Board(stage)
    for number in range(limits["max_tasks"]):
        board.updater.task(number, 0, nothing)
    with pytest.raises(CapacityError, match="5 tasks, its most: make it with tasks=6") as caught:
        board.updater.task(9, 0, nothing)
    assert caught.value.code == 1  # ERROR
    assert [status.updater_id for status in board.update()] == [0, 1, 2, 3, 4]


def test_d2_too_many_values(stage: Stage) -> None:
    board = Board(stage)
    most = VECTORS["updater"]["max_values_per_task"]

    def check(task: Task) -> None:
        for key in range(most + 1):
            task.set(key, key)

    board.updater.task(3, 0, check)
    (status,) = board.update()
    assert [value.key for value in status.values] == [0, 1, 2, 3]
    assert board.problems == [
        (
            FAILED,
            "diagnostic task 3 raised CapacityError: a task has 4 values, its most: make the updater with values=5",
        )
    ]


def test_d3_unchanged_is_silent(stage: Stage) -> None:
    board = Board(stage)
    volts = [12.5]
    board.updater.task(1, 7, lambda task: task.set(0, volts[0]))
    board.updater.task(2, 7, lambda task: task.set(0, True))
    assert len(board.update()) == 2
    assert board.update() == []
    volts[0] = 12.0
    (status,) = board.update()
    assert (status.updater_id, status.hardware_id, status.values[0].double_value) == (1, 7, 12.0)
    assert board.update() == []


def test_d4_forced_once(stage: Stage) -> None:
    board = Board(stage)
    board.updater.task(1, 7, lambda task: task.set(0, 5))
    board.updater.task(2, 7, nothing)
    assert len(board.update()) == 2
    stage.publish(board.force, Empty())
    stage.until(lambda: all(task.fresh for task in board.updater.tasks))
    assert [status.updater_id for status in board.update()] == [1, 2]
    assert board.update() == []


def test_d5_values_arrive_with_their_types(stage: Stage) -> None:
    board = Board(stage)

    def check(task: Task) -> None:
        task.set(10, True)
        task.set(11, -(2**31))
        task.set(12, 0.5, WARN)
        task.lookup(13, 4)

    board.updater.task(1, 7, check)
    (status,) = board.update()
    types = VECTORS["value_types"]
    assert status == STATUS(
        level=WARN,
        updater_id=1,
        hardware_id=7,
        number_of_values=4,
        values=[
            VALUE(key=10, value_type=types["BOOL"], bool_value=True),
            VALUE(key=11, value_type=types["INT"], int_value=-(2**31)),
            VALUE(level=WARN, key=12, value_type=types["FLOAT"], double_value=0.5),
            VALUE(key=13, value_type=types["LOOKUP"], value_id=4),
        ],
    )


def test_a_change_of_level_alone_is_a_change_and_the_worst_counts(stage: Stage) -> None:
    board = Board(stage)
    levels = [OK, OK]

    def check(task: Task) -> None:
        for key, level in enumerate(levels):
            task.set(key, 1, level)

    board.updater.task(1, 0, check)
    assert [status.level for status in board.update()] == [OK]
    for first, second, worst in ((OK, ERROR, ERROR), (STALE, WARN, STALE), (WARN, WARN, WARN), (OK, OK, OK)):
        levels[:] = first, second
        assert [status.level for status in board.update()] == [worst]
    assert board.update() == []


def test_fewer_values_are_a_change_and_a_task_may_be_bad_as_a_whole(stage: Stage) -> None:
    board = Board(stage)
    keys = [1, 2, 3]

    def check(task: Task) -> None:
        for key in keys:
            task.set(key, 0)
        task.worsen(WARN if len(keys) < 3 else OK)

    board.updater.task(1, 0, check)
    assert [len(status.values) for status in board.update()] == [3]
    keys.pop()
    assert [(len(s.values), s.number_of_values, s.level) for s in board.update()] == [(2, 2, WARN)]


def test_a_task_that_raises_does_not_stop_the_others(stage: Stage) -> None:
    board = Board(stage)
    broken = [True]

    def check(task: Task) -> None:
        task.set(1, 5)
        if broken[0]:
            raise OSError("no sensor")

    task = board.updater.task(1, 0, check)
    board.updater.task(2, 0, nothing)
    assert [(status.updater_id, status.level) for status in board.update()] == [(1, ERROR), (2, OK)]
    assert board.update() == []
    assert board.update() == []
    assert board.update() == []
    assert task.failures == 4
    assert board.problems == [(FAILED, "diagnostic task 1 raised OSError: no sensor")] * 3  # 1st, 2nd, 4th
    broken[0] = False
    assert [(status.updater_id, status.level) for status in board.update()] == [(1, OK)]


@pytest.mark.parametrize(
    "wrong",
    [
        lambda task: task.set(0, 2**31),
        lambda task: task.set(0, -(2**31) - 1),
        lambda task: task.set(0, "text"),
        lambda task: task.set(0, None),
        lambda task: task.set(65536, 1),
        lambda task: task.lookup(0, -1),
    ],
)
def test_values_that_are_none_are_failures_of_the_task(stage: Stage, wrong: Any) -> None:
    board = Board(stage)
    board.updater.task(1, 0, wrong)
    assert [(status.level, status.values) for status in board.update()] == [(ERROR, [])]
    assert [text.split(" raised ")[0] for _, text in board.problems] == ["diagnostic task 1"]


@pytest.mark.parametrize("numbers", [(65536, 0), (0, -1)])
def test_tasks_have_numbers_of_16_bits(stage: Stage, numbers: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="is no number from 0 to 65535"):
        Board(stage).updater.task(*numbers, nothing)


def test_what_was_not_taken_is_sent_later(monkeypatch: pytest.MonkeyPatch) -> None:
    context = Context("local:")
    updater = DiagnosticUpdater(context.node("board"))
    updater.task(1, 0, nothing)
    taken = [False]
    monkeypatch.setattr(updater.publisher, "publish", lambda status: taken[0])
    assert updater.update() == 0
    assert updater.refused == 1
    taken[0] = True
    assert updater.update() == 1
    assert updater.update() == 0
    Executor(context).spin_some()
    context.close()
