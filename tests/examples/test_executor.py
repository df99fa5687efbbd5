"""The examples of the executor print what they say."""

import pytest

from tests.examples.stage import Program, Stage, interrupt
from tests.micropython.runtimes import require

RUNS = [("local:", "python"), ("agent", "micropython")]


def start(stage: Stage, name: str, place: str, on: str) -> Program:
    """Starts an example on its own."""
    if on == "micropython":
        require("unix")
    return stage.start(name, stage.agent() if place == "agent" else place, on=on)


@pytest.mark.parametrize(("place", "on"), RUNS)
def test_the_order_of_adding_is_the_order_of_processing(stage: Stage, place: str, on: str) -> None:
    program = start(stage, "executor_order", place, on)
    stage.until(lambda: len(program.lines) >= 6)
    heard = [line for line in program.lines if ":" not in line]
    if place == "local:":  # both are there before the pass
        assert program.lines[:6] == ["published: second, first", "first", "second"] * 2
    assert {"first", "second"} == set(heard)
    if on == "python":
        interrupt(program)


@pytest.mark.parametrize(("place", "on"), RUNS)
def test_the_trigger_prints_both_with_the_newest_text(stage: Stage, place: str, on: str) -> None:
    program = start(stage, "trigger", place, on)
    stage.until(lambda: len(program.lines) >= 4)
    before = -1
    for i in range(2):
        text, number = program.lines[2 * i : 2 * i + 2]
        count = int(number.removeprefix("Callback 2: I heard: "))
        newest = int(text.removeprefix("Callback 1: I heard: Hello World! "))
        assert count > before
        assert newest >= 10 * count + 9, "older texts were dropped"
        before = count


@pytest.mark.parametrize(("place", "on"), RUNS)
def test_timers(stage: Stage, place: str, on: str) -> None:
    program = start(stage, "timers", place, on)
    program.ends()
    assert program.lines == ["slow 1", "slow 2", "fast 1", "fast 2", "fast 3", "over"]


@pytest.mark.parametrize(("place", "on"), RUNS)
def test_subscriptions_with_something_of_their_own(stage: Stage, place: str, on: str) -> None:
    program = start(stage, "subscription_with_context", place, on)
    stage.until(lambda: len(program.lines) >= 4)
    for side in ("left", "right"):
        turns = [line for line in program.lines if line.startswith(side)]
        assert turns[:2] == [f"{side} wheel: 1 turns", f"{side} wheel: 2 turns"]


@pytest.mark.parametrize(("place", "on"), RUNS)
def test_a_short_timer_and_a_long_subscription(stage: Stage, place: str, on: str) -> None:
    program = start(stage, "short_timer_long_subscription", place, on)
    works = "subscription works for 250 ms"
    said = [
        "timer, 100 ms since the last",
        works,
        "timer, 250 ms since the last",
        "timer, 50 ms since the last",
    ]
    stage.until(lambda: said in [program.lines[at : at + 4] for at in range(len(program.lines))])


@pytest.mark.parametrize(("place", "on"), RUNS)
def test_outputs_leave_at_the_end_of_the_period(stage: Stage, place: str, on: str) -> None:
    program = start(stage, "let", place, on)
    stage.until(lambda: len(program.lines) >= 20)
    for i, line in enumerate(program.lines[:20], 1):
        period, _, seen = line.removeprefix("period ").partition(": control saw ")
        assert int(period) == i
        if place == "local:":
            assert int(seen) == i - 1
        else:  # through an agent it may travel for more than a period
            assert int(seen) < i


def test_beside_the_tasks_of_an_asyncio_program(stage: Stage) -> None:
    program = stage.start("asyncio_program", "local:")
    program.ends()
    assert program.lines == [f"{what} {i}" for i in (1, 2, 3) for what in ("a task counts", "heard")]


@pytest.mark.parametrize("place", ["local:", "agent"])
def test_a_long_callback_in_another_thread(stage: Stage, place: str) -> None:
    program = stage.start("multithread", stage.agent() if place == "agent" else place)
    stage.until(lambda: program.lines.count("logging ends") >= 2)
    begin, end = program.lines.index("logging begins"), program.lines.index("logging ends")
    assert sum(line.startswith("control") for line in program.lines[begin:end]) >= 2
    numbers = [int(line.split()[1]) for line in program.lines if line.startswith("control")]
    assert numbers == list(range(1, len(numbers) + 1))
