"""The processing patterns that the documentation of micro-ROS describes print what the examples say they print."""

from itertools import pairwise

import pytest

from tests.examples.stage import EXAMPLES, Program, Stage
from tests.micropython.runtimes import require

RUNS = [("local:", "python"), ("dds:", "python"), ("agent", "python"), ("agent", "micropython")]


def start(stage: Stage, name: str, place: str, on: str) -> Program:
    """Starts an example on its own."""
    if on == "micropython":
        require("unix")
    return stage.start(name, stage.agent() if place == "agent" else place, on=on)


def promised(name: str) -> list[str]:
    """What an example says it prints."""
    text = (EXAMPLES / f"{name}.py").read_text().split("prints\n\n")[1].split("\n\n")[0]
    return [line.strip() for line in text.splitlines()]


@pytest.mark.parametrize(("place", "on"), RUNS)
def test_sense_plan_act(stage: Stage, place: str, on: str) -> None:
    """Never one sensor alone, never a phase before the one before it. What is sensed before all have met is lost."""
    program = start(stage, "sense_plan_act", place, on)
    stage.until(lambda: len(program.lines) >= 12)
    if place == "local:":
        assert program.lines[:8] == promised("sense_plan_act")
    lines = [line for line in program.lines if line.startswith("sense")][:4]
    assert [line.rsplit(" ", 1)[0] for line in lines] == ["sense: laser", "sense: imu"] * 2
    for i, line in enumerate(program.lines):
        if line.startswith("act"):
            before = [other.split(":")[0] for other in program.lines[:i]]
            assert before.count("plan") > before.count("act")
            assert before.count("sense") >= 2 * before.count("plan")


@pytest.mark.parametrize(("place", "on"), RUNS)
def test_rate_synchronisation(stage: Stage, place: str, on: str) -> None:
    """Each scan meets ten samples that follow each other, the next one the ten after these."""
    program = start(stage, "rate_synchronisation", place, on)
    stage.until(lambda: len(program.lines) >= 3)
    if place == "local:":
        assert program.lines[:3] == promised("rate_synchronisation")
    found = [tuple(int(word) for word in line.split() if word.isdigit()) for line in program.lines[:3]]
    for (scan, first, last), (next_scan, next_first, _) in pairwise(found):
        assert last == first + 9
        assert (next_scan, next_first) == (scan + 1, last + 1)


@pytest.mark.parametrize(("place", "on"), RUNS)
def test_the_high_priority_path(stage: Stage, place: str, on: str) -> None:
    """Before a wall the robot has stopped when it plans."""
    program = start(stage, "high_priority_path", place, on)
    stage.until(lambda: "laser 1 m" in program.lines and len(program.lines) >= 10)
    if place == "local:":
        assert program.lines[:10] == promised("high_priority_path")
    at = program.lines.index("laser 1 m")
    stage.until(lambda: len(program.lines) >= at + 4)
    assert program.lines[at + 1 : at + 4] == ["stop: too close", "plan: turn around", "act: speed 0"]


def test_stages(stage: Stage) -> None:
    """The camera that hangs is told, left alone, and there again."""
    program = stage.start("stages")
    program.ends()
    said = promised("stages")
    assert program.lines[:4] == said[:4]
    assert program.lines[-1] == said[-1].replace("4:", "5:")
