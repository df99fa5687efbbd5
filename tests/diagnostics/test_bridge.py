"""The bridge and its table, by the cases D6 to D9."""

import asyncio
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.cli import main
from muros.diagnostics import NOT_FOUND, Bridge, Table, TableError, read_table, read_table_untrusted
from muros.interfaces import message
from muros.rclc import DiagnosticUpdater
from muros.rclc.diagnostics import ERROR, WARN, Task
from tests.cli.scene import Scene
from tests.rclc_space.ways import Stage

VECTORS: dict[str, Any] = json.loads((Path(__file__).parents[1] / "vectors/rmw/diagnostics.json").read_text())
ARRAY = message("diagnostic_msgs/msg/DiagnosticArray")
STATUS = message("micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticStatus")
VALUE = message("micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticKeyValue")

TABLE = """
hardware_ids:
  ros__parameters:
    7: left arm
    "8": right arm
updaters:
  ros__parameters:
    1:
      name: battery
      description: the accumulator
      keys:
        0: {name: voltage}
        1: {name: mode, values: {0: charging, 1: in use}}
        2: {name: present}
    2: {name: motor}
"""


def pairs(status: Any) -> list[tuple[str, str]]:
    """Keys and values of a status."""
    return [(pair.key, pair.value) for pair in status.values]


class Rig:
    """A board, a bridge, and who listens to it."""

    def __init__(self, stage: Stage, text: str = TABLE) -> None:
        self.stage = stage
        self.board = DiagnosticUpdater(stage.node("board"))
        self.missing: list[str] = []
        self.told: list[Any] = []
        self.bridge = Bridge(
            stage.node("bridge"),
            read_table_untrusted(text),
            on_missing=self.missing.append,
            on_status=self.told.append,
            time=lambda: (12, 34),
        )
        self.heard: list[Any] = []
        stage.node("tool").subscription(ARRAY, "diagnostics", self.heard.append)
        stage.meet(self.board.publisher, self.bridge.publisher)

    def update(self) -> Any:
        """What comes of an update of a board with one task."""
        self.board.update()
        self.stage.until(lambda: self.heard)
        array = self.heard.pop(0)
        assert (array.header.stamp.sec, array.header.stamp.nanosec) == (12, 34)
        (status,) = array.status
        return status


def test_d6_words_for_numbers(stage: Stage) -> None:
    rig = Rig(stage)

    def check(task: Task) -> None:
        task.set(0, 12.5, WARN)
        task.lookup(1, 1)

    rig.board.task(1, 8, check)
    status = rig.update()
    assert (status.level, status.name, status.message) == (WARN, "battery", "the accumulator")
    assert status.hardware_id == "right arm"
    assert pairs(status) == [("voltage", "12.5"), ("mode", "in use")]
    assert rig.missing == []
    assert [told.serialize() for told in rig.told] == [status.serialize()]
    assert rig.bridge.lost == 0


def test_d7_what_is_missing(stage: Stage) -> None:
    assert VECTORS["bridge"]["missing"] == NOT_FOUND
    rig = Rig(stage)
    values = [9]

    def check(task: Task) -> None:
        task.lookup(1, values[0])
        task.set(5, 1)
        task.lookup(6, 6, ERROR)

    rig.board.task(1, 99, check)
    status = rig.update()
    assert (status.level, status.name, status.hardware_id) == (ERROR, "battery", NOT_FOUND)
    assert pairs(status) == [("mode", NOT_FOUND), (NOT_FOUND, "1"), (NOT_FOUND, NOT_FOUND)]
    said = ["hardware 99", "value 9 of key 1 of updater 1", "key 5 of updater 1", "key 6 of updater 1"]
    assert rig.missing == said
    values[0] = 0
    assert pairs(rig.update())[0] == ("mode", "charging")
    assert rig.missing == said, "each is told of once"


def test_d7_an_updater_that_is_missing(stage: Stage) -> None:
    rig = Rig(stage)
    rig.board.task(70, 7, lambda task: task.set(0, 1))
    status = rig.update()
    assert (status.name, status.message, status.hardware_id) == (NOT_FOUND, NOT_FOUND, "left arm")
    assert rig.missing == ["updater 70", "key 0 of updater 70"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "True"),
        (False, "False"),
        (-17, "-17"),
        (0.1, "0.1"),
        (1e10, "1e+10"),
        (3.0, "3"),
        (float("nan"), "nan"),
    ],
)
def test_d8_values_as_text(stage: Stage, value: Any, text: str) -> None:
    rig = Rig(stage)
    rig.board.task(1, 7, lambda task: task.set(2, value))
    assert pairs(rig.update()) == [("present", text)]


def test_d8_what_another_board_may_send(stage: Stage) -> None:
    rig = Rig(stage)
    strange = VALUE(key=0, value_type=77)
    stale = VALUE(key=2, value_type=1)
    status = rig.bridge.convert(STATUS(level=200, updater_id=2, number_of_values=1, values=[strange, stale]))
    assert pairs(status) == [(NOT_FOUND, "value of unknown type 77")]
    assert status.level == 3
    assert status.message == NOT_FOUND
    assert pairs(rig.bridge.convert(STATUS(number_of_values=9, values=[stale]))) == [(NOT_FOUND, "False")]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "names with values are due here, not nothing"),
        ("- 1", "not a list"),
        ("a: 1", "has neither hardware_ids nor updaters"),
        ("hardware_ids: {1: a}", "hardware_ids has no ros__parameters"),
        ("hardware_ids: {ros__parameters: {x: a}}", "'x' is no number from 0 to 65535"),
        ("hardware_ids: {ros__parameters: {70000: a}}", "70000 is no number"),
        ("hardware_ids: {ros__parameters: {true: a}}", "True is no number"),
        ("hardware_ids: {ros__parameters: {1: [a]}}", "hardware_ids.1: words are due here, not a list"),
        (
            "updaters: {ros__parameters: {1: battery}}",
            "updaters.1: names with values are due here, not 'battery'",
        ),
        ("updaters: {ros__parameters: {1: {keys: {0: voltage}}}}", "updaters.1.keys.0: names with values"),
        (
            "updaters: {ros__parameters: {1: {keys: {0: {values: 3}}}}}",
            "updaters.1.keys.0.values: names with",
        ),
        ("updaters: {ros__parameters: {1: {name: {}}}}", "updaters.1.name: words are due here, not a dict"),
        ("a: [", "is no YAML: while parsing"),
        ("{" * 3000, "is no YAML"),
        ("hardware_ids: {ros__parameters: {1: 0x" + "f" * 9000 + "}}", "a number that is too long"),
    ],
)
def test_d9_wrong_yaml(text: str, why: str, tmp_path: Path) -> None:
    file = tmp_path / "table.yaml"
    file.write_text(text)
    with pytest.raises(TableError) as caught:
        read_table(file)
    said = str(caught.value)
    assert said.startswith(str(file))
    assert why in said
    assert "\n" not in said
    assert len(said) < 400


def test_d9_a_file_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "table.yaml").write_bytes(b"\xff\xfe\xfd")
    with pytest.raises(TableError, match="is no text in UTF-8"):
        read_table(tmp_path / "table.yaml")
    with pytest.raises(OSError, match="missing"):
        read_table(tmp_path / "missing.yaml")


def test_half_a_table_will_do() -> None:
    assert read_table_untrusted("hardware_ids: {ros__parameters: {1: 2.5}}") == Table({1: "2.5"})
    assert read_table_untrusted("updaters: {ros__parameters: }").updaters == {}


@given(st.text(alphabet="{}[]:,&*!'\"-0123456789 \nabkeysnmevalu#|>", max_size=80))
def test_any_text_is_a_table_or_one_error(text: str) -> None:
    for before in ("", "updaters: {ros__parameters: {1: ", "hardware_ids:\n  ros__parameters:\n    "):
        with suppress(TableError):
            read_table_untrusted(before + text)


def test_aliases_that_grow_do_not() -> None:
    text = "a0: &a0 [x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 30))
    with pytest.raises(TableError, match="not a list"):
        read_table_untrusted(text + "hardware_ids: *a29\n")


def test_the_command(tmp_path: Path) -> None:
    asyncio.run(_the_command(tmp_path))


async def _the_command(folder: Path) -> None:
    file = folder / "table.yaml"
    file.write_text(TABLE)
    with Scene() as scene:
        running = scene.start(f"diagnostics bridge {file} -n lab")
        writer = scene.writer("/lab/board", "/lab/diagnostics_uros", STATUS.TYPE)
        reader = scene.reader("/tool", "/lab/diagnostics", ARRAY.TYPE)
        await scene.until(lambda: writer.matched and reader.matched)
        value = VALUE(key=0, value_type=3, double_value=11.5, level=1)
        writer.write(
            STATUS(level=1, updater_id=1, hardware_id=9, number_of_values=1, values=[value]).serialize()
        )
        await scene.until(lambda: running.out.getvalue())
        assert any("micro_ros_diagnostic_bridge" in str(node) for node in scene.space.graph.nodes)
        done = await running.stop()
        sample = reader.take()
        assert sample is not None
        assert ARRAY.deserialize(sample.data).status[0].name == "battery"
    assert done.out == "WARN  battery (NOTFOUND): voltage: 11.5\n"
    assert done.err == f"muros: hardware 9 is not in {file}\n"


def test_the_command_with_a_wrong_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.yaml").write_text("a: 1")
    for name, why in (
        ("bad", "bad.yaml has neither hardware_ids nor updaters"),
        ("no", "no.yaml: No such file"),
    ):
        assert main(["diagnostics", "bridge", str(tmp_path / f"{name}.yaml"), "--space", "local:"]) == 1
        assert why in capsys.readouterr().err
