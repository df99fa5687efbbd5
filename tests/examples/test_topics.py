"""The examples of topics print what they say: by one interpreter to the other through an agent, and in the graph."""

import re
from typing import Any

import pytest

from tests.examples.stage import Program, Stage, interrupt
from tests.micropython.runtimes import require

WAYS = [("graph", "python", "python"), ("agent", "python", "micropython"), ("agent", "micropython", "python")]


@pytest.fixture(params=WAYS, ids=["graph", "agent_to_board", "board_to_agent"])
def pair(request: pytest.FixtureRequest, stage: Stage) -> Any:
    """Starts the example that talks and the one that hears."""
    way, talks, hears = request.param
    if "micropython" in (talks, hears):
        require("unix")

    def start(talker: str, hearer: str, *words: str) -> tuple[Program, Program]:
        place = "dds:" if way == "graph" else stage.agent()
        heard = stage.start(hearer, place, *words[1:], on=hears)
        return stage.start(talker, place, *words[:1], on=talks), heard

    return start


def follow(lines: list[str], shape: str) -> bool:
    """Whether several lines have that shape and their numbers count up, in order and none left out."""
    numbers = [int(match[1]) for line in lines if (match := re.fullmatch(shape, line))]
    if len(numbers) < 3:
        return False
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert len(numbers) == len(lines)
    return True


def test_int32(stage: Stage, pair: Any) -> None:
    talker, hearer = pair("int32_publisher", "int32_subscriber")
    stage.until(lambda: follow(talker.lines, r"Sent: (\d+)") and follow(hearer.lines, r"Received: (\d+)"))


def test_text(stage: Stage, pair: Any) -> None:
    talker, hearer = pair("string_publisher", "string_subscriber")
    stage.until(
        lambda: (
            follow(talker.lines, r'I have published: "Hello World! (\d+)"')
            and follow(hearer.lines, r'I have heard: "Hello World! (\d+)"')
        )
    )


def test_messages_in_messages(stage: Stage, pair: Any) -> None:
    talker, hearer = pair("complex_publisher", "complex_subscriber")
    stage.until(lambda: len(hearer.lines) >= 6)
    assert set(talker.lines) == {"Sent joints: 2"}
    first = int(hearer.lines[0].removeprefix("arm at "))
    expected = []
    for i in (first, first + 1):
        expected += [f"arm at {i}", f"shoulder {i * 0.5}", "elbow -0.25"]
    assert hearer.lines[:6] == expected


def test_fragments(stage: Stage, pair: Any) -> None:
    talker, hearer = pair("fragmented_publisher", "fragmented_subscriber")
    stage.until(lambda: len(hearer.lines) >= 2)
    assert set(talker.lines) == {"Sent: 10000 bytes"}
    assert set(hearer.lines) == {"Received: 10000 bytes, all well"}


def test_quality_of_service(stage: Stage, pair: Any) -> None:
    talker, hearer = pair("qos", "qos", "publish", "listen")
    stage.until(lambda: "map 1" in hearer.lines)
    stage.until(lambda: follow([s for s in hearer.lines if s != "map 1"], r"sensor (\d+)"))
    assert hearer.lines.count("map 1") == 1
    late = stage.start("qos", talker.process.args[-2])
    stage.until(lambda: "map 1" in late.lines)
    assert talker.lines == ["the map is out"]


def test_both_in_one_node(stage: Stage) -> None:
    one, other = (stage.start("int32_publisher_subscriber", "dds:") for _ in range(2))

    def hears_both(program: Program) -> bool:
        """Each number comes from itself and from the other one."""
        heard = [line for line in program.lines if line.startswith("Received: ")]
        return any(heard.count(line) == 2 for line in heard)

    stage.until(lambda: hears_both(one) and hears_both(other))
    stage.until(lambda: follow([line for line in one.lines if line.startswith("Sent")], r"Sent: (\d+)"))
    interrupt(one)


@pytest.mark.parametrize("on", ["python", "micropython"])
def test_two_nodes_in_one_program(stage: Stage, on: str) -> None:
    if on == "micropython":
        require("unix")
    program = stage.start("int32_multinode", stage.agent(), on=on)
    stage.until(lambda: len(program.lines) >= 6)
    assert program.lines[:4] == [
        "/one/counter sent: 0",
        "/two/counter sent: 0",
        "/one/counter sent: 1",
        "/two/counter sent: 1",
    ]


@pytest.mark.parametrize(
    ("place", "on"), [("local:", "python"), ("agent", "python"), ("agent", "micropython")]
)
def test_hello_world(stage: Stage, place: str, on: str) -> None:
    if on == "micropython":
        require("unix")
    program = stage.start("hello_world", stage.agent() if place == "agent" else place, on=on)
    stage.until(lambda: len(program.lines) >= 4)
    assert "Published message Hello World! 0" in program.lines
    assert "Callback: I heard: Hello World! 1" in program.lines
    if on == "python":
        interrupt(program)


@pytest.mark.parametrize("on", ["python", "micropython"])
def test_the_shortest_program(stage: Stage, on: str) -> None:
    if on == "micropython":
        require("unix")
    program = stage.start("convenience", stage.agent(), on=on)
    stage.until(lambda: program.lines[:2] == ["hello", "hello"])


@pytest.mark.parametrize(("place", "on"), [("local:", "python"), ("agent", "micropython")])
def test_bounds_of_what_messages_take(stage: Stage, place: str, on: str) -> None:
    if on == "micropython":
        require("unix")
    program = stage.start("static_types", stage.agent() if place == "agent" else place, on=on)
    stage.until(lambda: len(program.lines) >= 4)
    heard = "heard ['shoulder', 'elbow']"
    refused = "72 B of sensor_msgs/msg/JointState dropped: name is longer than the rules allow"
    assert {heard, refused} == set(program.lines)
    assert program.lines[:2] == [heard, refused]


@pytest.mark.parametrize("on", ["python", "micropython"])
@pytest.mark.parametrize("words", [[], ["udp"], ["udp:127.0.0.1:x"], ["smoke:1:2"]])
def test_a_way_that_is_none(stage: Stage, on: str, words: list[str]) -> None:
    if on == "micropython":
        require("unix")
    program = stage.start("hello_world", *words, on=on)
    assert program.process.wait(30) == 2
    stage.programs.clear()
    program.stop()
    assert program.lines[0].startswith("usage: ")
    assert len(program.lines) == 1


def test_a_board_has_no_space_of_its_own(stage: Stage) -> None:
    require("unix")
    program = stage.start("hello_world", "local:", on="micropython")
    assert program.process.wait(30) == 2
    stage.programs.clear()
    program.stop()
    assert program.lines[0].startswith("usage: ")
