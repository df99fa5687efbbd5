"""Rules for memory: what a message may take, how much that is, and that more is refused before any of it is taken."""

import json
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros import interfaces
from muros.cli import main
from muros.interfaces import Kind, message
from muros.rclc import Arena, CapacityError, Rules, Text
from muros.rclc.memory import check
from muros.rclc.memory_plan import make, path
from tests.interfaces.samples import NAMES, encode, sample

from std_msgs.msg import Empty, MultiArrayLayout, String

JointTrajectory = message("trajectory_msgs/msg/JointTrajectory")
VECTORS: dict[str, Any] = json.loads(
    (Path(__file__).parents[1] / "vectors/rmw/utilities_memory.json").read_text()
)
FITS = -1
BOUNDED = """
string<=10 name
string[2] pair
string<=3[<=2] few
uint16[<=7] numbers
std_msgs/Header[<=2] headers
geometry_msgs/Point[2] corners
uint8 last
"""


@pytest.fixture(scope="module")
def bounded(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A type with bounds of its own."""
    folder = tmp_path_factory.mktemp("types") / "bound_msgs"
    (folder / "msg").mkdir(parents=True)
    (folder / "msg/Bounded.msg").write_text(BOUNDED)
    interfaces.add_path(folder)
    return message("bound_msgs/msg/Bounded")


def verdict(rules: Rules, kind: Any, body: bytes) -> str | None:
    """The path of what is too long in a body, None for nothing."""
    step = check(make(rules, kind), [], body, 0, len(body))
    return None if step == FITS else path(kind, step)


# The cases of the C library, by name


def test_f2_defaults() -> None:
    defaults = VECTORS["defaults"]
    for rules in (Rules(), Rules(strings=0, messages=0, numbers=0)):
        assert rules.strings == defaults["max_string_capacity"]
        assert rules.messages == defaults["max_ros2_type_sequence_capacity"]
        assert rules.numbers == defaults["max_basic_type_sequence_capacity"]


def test_f2_dynamic_size() -> None:
    case = VECTORS["cases"][0]
    assert case["type"] == MultiArrayLayout.TYPE
    assert Rules().size(MultiArrayLayout) == case["dynamic_size_bytes"] == 260
    assert Rules().size(MultiArrayLayout, word=4) == 5 * 20 + 5 * 20


def test_f2_default_capacities() -> None:
    assert Rules().capacities(MultiArrayLayout) == {"dim": 5, "dim.label": 20}


def test_f2_rules_for_members() -> None:
    assert Rules(VECTORS["cases"][2]["rules"]).capacities(MultiArrayLayout) == {"dim": 3, "dim.label": 100}


def test_f2_strings_in_a_sequence() -> None:
    found = Rules().capacities(JointTrajectory)
    assert (found["joint_names"], found["joint_names.data"]) == (5, 20)
    found = Rules(VECTORS["cases"][4]["rules"]).capacities(JointTrajectory)
    assert (found["joint_names"], found["joint_names.data"]) == (16, 5)


def test_f2_no_memory() -> None:
    rules = Rules()
    with pytest.raises(CapacityError, match="do not fit the 0 B that are left"):
        rules.carve(MultiArrayLayout, bytearray(0))
    with pytest.raises(CapacityError):
        rules.carve(JointTrajectory, bytearray(rules.static_size(JointTrajectory) - 1))
    rules.carve(JointTrajectory, bytearray(rules.static_size(JointTrajectory)))


def test_f2_what_is_made_takes_what_was_said_and_is_given_back() -> None:
    rules = Rules({"dim": 3, "dim.label": 7})
    arena = Arena(bytearray(1000))
    made = rules.carve(MultiArrayLayout, arena)
    assert {name: list(map(len, parts)) for name, parts in made.items()} == {
        "dim": [3 * 32],
        "dim.label": [7, 7, 7],
    }
    assert sum(len(part) for parts in made.values() for part in parts) == rules.size(MultiArrayLayout)
    assert arena.used == rules.static_size(MultiArrayLayout) == 3 * 32 + 3 * 8
    arena.clear()
    assert arena.used == 0


def test_f2_a_bound_beats_the_default_and_a_rule_beats_both(bounded: Any) -> None:
    found = Rules(numbers=3, strings=4, messages=9).capacities(bounded)
    assert found == {
        "name": 10,
        "pair.data": 4,
        "few": 2,
        "few.data": 3,
        "numbers": 7,
        "headers": 2,
        "headers.frame_id": 4,
    }
    assert Rules({"name": 3, "few": 1, "numbers": 2}).capacities(bounded) | found == found
    assert Rules({"name": 3, "few": 1, "numbers": 2}).capacities(bounded)["few"] == 1


# What else there is


def test_structures_are_laid_out_as_in_c(bounded: Any) -> None:
    rules = Rules()
    string = 24
    header = 8 + string
    assert rules.size(bounded) == 10 + 2 * 20 + 2 * (string + 3) + 7 * 2 + 2 * (header + 20)
    assert rules.size(JointTrajectory) == 20 + 5 * (string + 20) + 5 * (4 * 24 + 8 + 4 * 5 * 8)
    assert rules.static_size(bounded) == 12 + 2 * 20 + 2 * string + 2 * 4 + 16 + 2 * (header + 20)


@pytest.mark.parametrize("name", ["std_msgs/msg/MultiArrayLayout", "trajectory_msgs/msg/JointTrajectory"])
def test_no_body_that_fits_is_longer_than_the_longest(name: str) -> None:
    kind = message(name)
    rules = Rules(strings=3, messages=2, numbers=2)
    if name.endswith("Layout"):
        full = kind(dim=[interfaces.message("std_msgs/msg/MultiArrayDimension")(label="abc")] * 2)
    else:
        point = interfaces.message("trajectory_msgs/msg/JointTrajectoryPoint")
        numbers = {key: [0.0, 1.0] for key in ("positions", "velocities", "accelerations", "effort")}
        full = kind(joint_names=["abc", "def"], points=[point(**numbers), point(**numbers)])
        full.header.frame_id = "abc"
    body = full.serialize()
    assert verdict(rules, kind, body) is None
    assert rules.longest(kind) == len(body)


def test_a_rule_for_nothing_is_an_error() -> None:
    with pytest.raises(ValueError, match="std_msgs/msg/String has no string or sequence 'text'"):
        make(Rules({"text": 5}), String)
    with pytest.raises(ValueError, match="sizes"):
        Rules({"data": -1})


def test_types_without_strings_and_sequences_always_fit() -> None:
    assert Rules().size(Empty) == 0
    assert verdict(Rules(), Empty, Empty().serialize()) is None


def measured(kind: str, value: Any, before: str = "") -> dict[str, int]:
    """The most elements, or bytes of text, that each string and sequence of a value has."""
    found: dict[str, int] = {}

    def note(name: str, size: int) -> None:
        found[name] = max(found.get(name, 0), size)

    definition = interfaces.definition(kind)
    assert isinstance(definition, interfaces.Message)
    for field in definition.fields:
        item, name = getattr(value, field.name), before + field.name
        items = [item]
        if field.type.kind is not Kind.ONE:
            items = list(item)
            if field.type.kind is not Kind.ARRAY:
                note(name, len(items))
        for one in items:
            if field.type.nested:
                for inner, size in measured(field.type.base, one, name + ".").items():
                    note(inner, size)
            elif field.type.base == "string":
                note(name if field.type.kind is Kind.ONE else name + ".data", len(one.encode()))
    return found


@settings(max_examples=400)
@given(name=st.sampled_from(NAMES), seed=st.integers(0, 2**32), most=st.tuples(*[st.integers(1, 6)] * 3))
def test_what_is_too_long_is_found(name: str, seed: int, most: tuple[int, int, int]) -> None:
    if ":w" in interfaces.shape(name):
        return  # rosbags writes no such strings
    random = Random(seed)
    value = sample(name, random)
    rules = Rules(strings=most[0], messages=most[1], numbers=most[2])
    sizes = measured(name, value)
    rules.rules.update({key: random.randrange(1, 30) for key in sizes if random.random() < 0.4})
    capacities = rules.capacities(message(name))
    found = verdict(rules, message(name), encode(value, name)[4:])
    over = [key for key, size in sizes.items() if size > capacities[key]]
    assert (found is None) == (not over)
    assert found is None or found in over


@settings(max_examples=300)
@given(name=st.sampled_from(NAMES), data=st.binary(max_size=200), most=st.integers(1, 1000))
def test_foreign_bytes_are_looked_at_without_harm(name: str, data: bytes, most: int) -> None:
    kind = message(name)
    verdict(Rules(strings=most, messages=most, numbers=most), kind, data)
    buf = bytes(3) + data + b"\xff" * 50
    assert check(make(Rules(), kind), [], buf, 3, len(data)) == check(
        make(Rules(), kind), [], data, 0, len(data)
    )


# Memory of a program's own


def test_an_arena_gives_out_aligned_parts() -> None:
    arena = Arena(bytearray(16))
    first, second = arena.take(5), arena.take(8)
    first[:] = b"12345"
    second[:] = b"abcdefgh"
    assert bytes(first) == b"12345"
    assert arena.used == 16
    with pytest.raises(CapacityError, match="1 B do not fit the 0 B that are left of 16"):
        arena.take(1)


def test_a_text_changes_in_its_place() -> None:
    text = Text("abc")
    assert (text.capacity, len(text), str(text)) == (4, 3, "abc")
    with pytest.raises(CapacityError, match="4 B and a NUL do not fit a text of 4 B"):
        text.append("d")
    assert str(text) == "abc"
    text = Text(8)
    assert (text.capacity, len(text)) == (8, 0)
    text.set("grün")
    text.append("!")
    assert bytes(text.view) == "grün!".encode()
    assert String(data=text.view).serialize() == String(data="grün!").serialize()
    text.shorten(2)
    assert str(text) == "grü"
    text.shorten(99)
    assert str(text) == ""
    carved = Text(Arena(bytearray(8)).take(6))
    carved.set(b"12345")
    assert str(carved) == "12345"


def test_r24_sizes_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["interface", "memory", "std_msgs/MultiArrayLayout"]
    assert main(words) == 0
    assert capsys.readouterr().out == (
        "dim              5 elements\n"
        "dim.label       20 B of text\n"
        "all of them          260 B in C on 64 bit\n"
        "in one buffer        260 B\n"
        "longest message      188 B; boards join its pieces with Session(largest=196)\n"
    )
    assert main([*words, "dim=1", "dim.label=3", "--word", "4"]) == 0
    assert "all of them           23 B in C on 32 bit\n" in capsys.readouterr().out
    assert main(["interface", "memory", "std_msgs/Int32"]) == 0
    assert "has neither strings nor sequences" in capsys.readouterr().out
    for rule, why in (
        ("dims=3", "has no string or sequence 'dims'"),
        ("dim", "'dim' is no rule such as name=8"),
    ):
        assert main([*words, rule]) == 1
        assert why in capsys.readouterr().err


def test_r24_board_classes_have_shapes_when_asked_for(tmp_path: Path) -> None:
    words = ["interface", "generate", "--board", "std_msgs/String", "-o", str(tmp_path)]
    assert main(words) == 0
    assert "SHAPE" not in (tmp_path / "std_msgs/msg/_String.py").read_text()
    assert main([*words, "--rules"]) == 0
    assert 'SHAPE = "data:s"' in (tmp_path / "std_msgs/msg/_String.py").read_text()
